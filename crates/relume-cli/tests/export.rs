//! `relume export`: files with light, read back.

use std::fs;
use std::io::Read;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use crate::common::{relume, room, text};

/// The chunks of a binary glTF file.
fn chunks(path: &Path) -> (Value, Vec<u8>) {
    let bytes = fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(8)), (&b"glTF"[..], bytes.len()));
    let json = word(12);
    (serde_json::from_slice(&bytes[20..20 + json]).unwrap(), bytes[28 + json..].to_vec())
}

/// The values of an accessor as it is stored, components one after the other; normalised where it says so.
fn values((json, binary): &(Value, Vec<u8>), accessor: &Value) -> Vec<f64> {
    let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
    let per = match accessor["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC3" => 3,
        _ => 4,
    };
    let count = accessor["count"].as_u64().unwrap() as usize * per;
    let Some(view) = accessor["bufferView"].as_u64() else { return vec![0.0; count] };
    let from = json["bufferViews"][view as usize]["byteOffset"].as_u64().unwrap() as usize;
    let data = &binary[from..];
    let of = |k: usize| match accessor["componentType"].as_u64().unwrap() {
        5126 => f64::from(f32::from_le_bytes(data[4 * k..4 * k + 4].try_into().unwrap())),
        5125 => f64::from(u32::from_le_bytes(data[4 * k..4 * k + 4].try_into().unwrap())),
        5123 => f64::from(u16::from_le_bytes(data[2 * k..2 * k + 2].try_into().unwrap())) / 65535.0,
        5122 => f64::from(i16::from_le_bytes(data[2 * k..2 * k + 2].try_into().unwrap())) / 32767.0,
        other => panic!("component type {other}"),
    };
    (0..count).map(of).collect()
}

#[test]
fn a_glb_plays_the_light_beside_the_motion() {
    let (dir, scene) = room();
    let out = dir.path().join("lit.glb");
    let flags = ["--frames", "0-12x6", "--tolerance", "0.2", "-q"];
    relume(&[&["export", text(&scene), "-o", text(&out)], &flags[..]].concat()).succeeds();
    let file = chunks(&out);
    let json = &file.0;
    assert_eq!(json["extensionsUsed"], serde_json::json!(["KHR_materials_unlit"]));
    assert_eq!(
        json["scenes"][0]["extras"]["relume"]["times_s"],
        serde_json::json!([0.0, 0.25, 0.5])
    );
    let animation = &json["animations"][0];
    let channels = animation["channels"].as_array().unwrap();
    let paths = |of: &str| channels.iter().filter(|c| c["target"]["path"] == of).count();
    // The lamp's own motion, and the light of what it shines on.
    assert!(paths("translation") >= 1 && paths("weights") >= 2, "{channels:?}");
    let mut morphed = 0;
    for primitive in
        json["meshes"].as_array().unwrap().iter().flat_map(|m| m["primitives"].as_array().unwrap())
    {
        let colour =
            &json["accessors"][primitive["attributes"]["COLOR_0"].as_u64().unwrap() as usize];
        assert_eq!((&colour["type"], &colour["componentType"]), (&"VEC4".into(), &5123.into()));
        let Some(targets) = primitive["targets"].as_array() else { continue };
        morphed += 1;
        assert_eq!(targets.len(), 2);
        for target in targets {
            let zeros = &json["accessors"][target["POSITION"].as_u64().unwrap() as usize];
            assert_eq!((zeros.get("bufferView"), &zeros["count"]), (None, &colour["count"]));
            let steps = values(&file, &target["COLOR_0"]);
            assert!(steps.chunks(4).all(|c| c[3] == 0.0) && steps.iter().any(|&s| s != 0.0));
        }
    }
    assert!(morphed >= 2);
    let weights = channels.iter().find(|c| c["target"]["path"] == "weights").unwrap();
    let sampler = &animation["samplers"][weights["sampler"].as_u64().unwrap() as usize];
    assert_eq!(values(&file, &sampler["input"]), [0.0, 0.25, 0.5]);
    let output = &json["accessors"][sampler["output"].as_u64().unwrap() as usize];
    // At the second time the first weight, at the third the second.
    assert_eq!((&output["count"], output.get("bufferView")), (&6.into(), None));
    let view = &output["sparse"]["indices"]["bufferView"];
    let at = json["bufferViews"][view.as_u64().unwrap() as usize]["byteOffset"].as_u64().unwrap()
        as usize;
    let places: Vec<u32> =
        file.1[at..at + 8].chunks(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(places, [2, 5]);
}

/// What is in the file of one frame is what `probe` reads of the mesh at the same points.
#[test]
fn a_glb_of_one_frame_has_the_radiosities_of_the_solution() {
    let (dir, scene) = room();
    let (out, sensors) = (dir.path().join("lit.glb"), dir.path().join("sensors.txt"));
    let flags = ["--frames", "6", "--tolerance", "0.2", "-q"];
    relume(&[&["export", text(&scene), "-o", text(&out), "--exposure", "1"], &flags[..]].concat())
        .succeeds();
    let file = chunks(&out);
    let json = &file.0;
    assert!(json.get("animations").is_none());
    let mesh = json["meshes"].as_array().unwrap().iter().find(|m| m["name"] == "floor");
    let primitive = &mesh.expect("there is a floor")["primitives"][0];
    let points = values(&file, &primitive["attributes"]["POSITION"]);
    let radiosity = values(&file, &primitive["attributes"]["_RADIOSITY"]);
    let colours = values(&file, &primitive["attributes"]["COLOR_0"]);
    let lines: Vec<String> =
        points.chunks(3).map(|p| format!("{} {} {} 0 1 0\n", p[0], p[1], p[2])).collect();
    fs::write(&sensors, lines.concat()).unwrap();
    let probe = ["probe", text(&scene), text(&sensors), "--interpolate"];
    let ran = relume(&[&probe[..], &flags[..]].concat()).succeeds();
    let mut same = 0;
    for (k, row) in ran.out.lines().skip(1).enumerate() {
        let e: Vec<f64> = row.split(',').skip(8).map(|e| e.parse().unwrap()).collect();
        let b = &radiosity[3 * k..3 * k + 3];
        // The middles of leaves come first; at edges pictures and the mesh differ.
        let is_same = (0..3).all(|c| (b[c] - FLOOR[c] * e[c]).abs() <= 1e-4 * b[c]);
        same += usize::from(is_same);
        for c in 0..3 {
            let shown = b[c] / std::f64::consts::PI * 2.0;
            let over = ((shown - 0.6) / 0.4).max(0.0);
            let display = shown.min(0.6) + 0.4 * (1.0 - 1.0 / (1.0 + over));
            let colour = colours[4 * k + c];
            assert!((colour - display).abs() < 1e-5, "{colour} is not {display}");
        }
    }
    assert!(2 * same > points.len() / 3, "{same} of {}", points.len() / 3);
}

/// Reflectance of the floor of the room.
const FLOOR: [f64; 3] = [0.55, 0.5, 0.43];

/// Our own check of a `.vtp`: its text is XML, and an array is where and as long as the text says.
struct Vtp {
    xml: String,
    appended: Vec<u8>,
}

impl Vtp {
    fn read(path: &Path) -> Vtp {
        let bytes = fs::read(path).unwrap();
        let mark = b"<AppendedData encoding=\"raw\">\n_";
        let at = bytes.windows(mark.len()).position(|w| w == mark).unwrap();
        let xml = String::from_utf8(bytes[..at].to_vec()).unwrap();
        let opened = xml.matches("</").count() + xml.matches("/>").count();
        // All but the file itself is closed.
        assert_eq!(xml.matches('<').count() - xml.matches("</").count() - 2, opened);
        Vtp { xml, appended: bytes[at + mark.len()..].to_vec() }
    }

    /// The bytes of an array of points, cells or polygons.
    fn array(&self, of: &str, name: &str) -> &[u8] {
        let section = self.xml.split_once(&format!("<{of}>")).unwrap().1;
        let line = section.lines().find(|l| l.contains(&format!("Name=\"{name}\""))).unwrap();
        let offset = line.split_once("offset=\"").unwrap().1.split('"').next().unwrap();
        let offset: usize = offset.parse().unwrap();
        let length = u64::from_le_bytes(self.appended[offset..offset + 8].try_into().unwrap());
        &self.appended[offset + 8..offset + 8 + length as usize]
    }

    fn floats(&self, of: &str, name: &str) -> Vec<f32> {
        let word = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
        self.array(of, name).chunks(4).map(word).collect()
    }

    fn numbers(&self, of: &str, name: &str) -> Vec<i64> {
        let word = |b: &[u8]| i64::from_le_bytes(b.try_into().unwrap());
        self.array(of, name).chunks(8).map(word).collect()
    }

    fn texts(&self, name: &str) -> Vec<String> {
        let all = String::from_utf8(self.array("CellData", name).to_vec()).unwrap();
        all.split_terminator('\0').map(str::to_owned).collect()
    }
}

/// Of the floor's elements: middles and irradiances as `probe` reads the mesh, and nearly as it gathers them.
#[test]
fn a_vtp_has_the_numbers_of_the_solution() {
    let (dir, scene) = room();
    let (out, sensors) = (dir.path().join("room.vtp"), dir.path().join("sensors.txt"));
    let flags = ["--frames", "6", "--tolerance", "0.1", "-q"];
    relume(&[&["export", text(&scene), "-o", text(&out)], &flags[..]].concat()).succeeds();
    let file = Vtp::read(&out);
    let points = file.floats("Points", "points");
    let offsets = file.numbers("Polys", "offsets");
    let irradiance = file.floats("CellData", "irradiance_W_m2");
    let radiosity = file.floats("CellData", "radiosity_W_m2");
    let (surfaces, levels) = (file.texts("surface"), file.numbers("CellData", "level"));
    let cells = offsets.len();
    let said = format!("NumberOfPoints=\"{}\"", points.len() / 3);
    assert!(file.xml.contains(&said) && file.xml.contains(&format!("NumberOfPolys=\"{cells}\"")));
    assert_eq!((irradiance.len(), surfaces.len(), levels.len()), (3 * cells, cells, cells));
    assert_eq!(file.numbers("Polys", "connectivity").len(), points.len() / 3);
    assert!(levels.iter().any(|&l| l > 1) && file.texts("body").contains(&"lamp".to_owned()));
    let floor: Vec<usize> = (0..cells).filter(|&k| surfaces[k] == "floor").collect();
    let middle = |k: usize| {
        let corner = |c: usize| (0..4).map(|i| points[3 * (4 * k + i) + c]).sum::<f32>() / 4.0;
        format!("{} {} {} 0 1 0\n", corner(0), corner(1), corner(2))
    };
    let first = floor.iter().position(|_| true).map(|at| floor[at]).unwrap();
    assert_eq!(offsets[first] as usize % 4, 0, "the room has quadrilaterals alone");
    fs::write(&sensors, floor.iter().map(|&k| middle(k)).collect::<String>()).unwrap();
    for (how, most) in [(&["--interpolate"][..], 1e-3), (&[], 0.25)] {
        let probe = ["probe", text(&scene), text(&sensors)];
        let ran = relume(&[&probe[..], how, &flags[..]].concat()).succeeds();
        for (row, &k) in ran.out.lines().skip(1).zip(&floor) {
            for (c, e) in row.split(',').skip(8).map(|e| e.parse::<f32>().unwrap()).enumerate() {
                let (h, b) = (irradiance[3 * k + c], radiosity[3 * k + c]);
                assert!((h - e).abs() <= most * e, "{h} is not {e}, {how:?}");
                assert!((b - FLOOR[c] as f32 * h).abs() <= 1e-5 * b);
            }
        }
    }
}

#[test]
fn a_pvd_lists_a_file_for_each_frame() {
    let (dir, scene) = room();
    let out = dir.path().join("clip.pvd");
    let flags = ["--frames", "0-12x6", "--tolerance", "0.3"];
    let ran = relume(&[&["export", text(&scene), "-o", text(&out)], &flags[..]].concat());
    ran.says(&["3 frames in "]);
    let list = fs::read_to_string(&out).unwrap();
    for (frame, time) in [(0, "0"), (6, "0.25"), (12, "0.5")] {
        let name = format!("clip/frame-{frame:04}.vtp");
        assert!(list.contains(&format!("timestep=\"{time}\" part=\"0\" file=\"{name}\"")));
        assert!(Vtp::read(&dir.path().join(name)).xml.contains(&format!(">{time}</DataArray>")));
    }
}

/// The page's own numbers, unpacked as it unpacks them: irradiance at the floor's points is what `probe` reads there.
#[test]
fn a_page_holds_the_light_of_every_frame_and_asks_for_nothing_else() {
    let (dir, scene) = room();
    let (out, sensors) = (dir.path().join("lit.html"), dir.path().join("sensors.txt"));
    let flags = ["--frames", "0-12x6", "--tolerance", "0.2", "-q"];
    relume(&[&["export", text(&scene), "-o", text(&out)], &flags[..]].concat()).succeeds();
    let page = fs::read_to_string(&out).unwrap();
    assert!(!page.contains("http:") && !page.contains("https:") && !page.contains("src="));
    let described: Value = serde_json::from_str(element(&page, "scene")).unwrap();
    assert_eq!(described["times"], serde_json::json!([0.0, 0.25, 0.5]));
    let moves = |body: &Value| body["poses"].as_array().unwrap().len() == 3;
    assert!(described["bodies"].as_array().unwrap().iter().any(moves), "the lamp moves");
    let mut data = Vec::new();
    let packed = STANDARD.decode(element(&page, "light")).unwrap();
    flate2::read::ZlibDecoder::new(&packed[..]).read_to_end(&mut data).unwrap();
    let (points, roots, top) = of_floor(&described, &data);
    let lines = points.chunks(3).map(|p| format!("{} {} {} 0 1 0\n", p[0], p[1], p[2]));
    fs::write(&sensors, lines.collect::<String>()).unwrap();
    let probe = ["probe", text(&scene), text(&sensors), "--interpolate"];
    let at = ["--frames", "0-6x6", "--tolerance", "0.2", "-q"];
    let ran = relume(&[&probe[..], &at[..]].concat()).succeeds();
    let (mut same, count) = (0, points.len() / 3);
    for (k, row) in ran.out.lines().skip(1 + count).enumerate() {
        let e: Vec<f64> = row.split(',').skip(8).map(|e| e.parse().unwrap()).collect();
        let h = |c: usize| top * (f64::from(roots[3 * k + c]) / 4095.0).powi(2);
        // A step is a part in some hundreds; at edges pictures and the mesh differ.
        same += usize::from((0..3).all(|c| (h(c) - e[c]).abs() <= 0.01 * e[c]));
    }
    assert!(2 * same > count, "{same} of {count}");
}

/// What stands in an element of a page.
fn element<'a>(page: &'a str, id: &str) -> &'a str {
    let from = page.split_once(&format!("<script id=\"{id}\"")).unwrap().1;
    from.split_once('>').unwrap().1.split("</script>").next().unwrap()
}

/// Points of the floor, the steps of its irradiance in the second frame, and what the last step is; all of the data is used.
fn of_floor(described: &Value, mut data: &[u8]) -> (Vec<f32>, Vec<i32>, f64) {
    let mut floor = None;
    for part in described["parts"].as_array().unwrap() {
        let count = |name: &str| part[name].as_u64().unwrap() as usize;
        let points = data.split_off(..12 * count("points")).unwrap();
        data.split_off(..12 * count("triangles")).unwrap();
        let mut now = vec![0_i32; 3 * count("points")];
        for k in 0..count("instants") {
            let low = data.split_off(..now.len()).unwrap();
            let high = data.split_off(..now.len()).unwrap();
            for (i, value) in now.iter_mut().enumerate() {
                let step = i32::from(low[i]) | i32::from(high[i]) << 8;
                *value += step >> 1 ^ -(step & 1);
            }
            if part["name"] == "floor" && k == 1 {
                floor = Some((points, now.clone(), part["top"].as_f64().unwrap()));
            }
        }
    }
    assert_eq!(data.len(), 0);
    let (points, roots, top) = floor.expect("there is a floor whose light changes");
    let word = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
    (points.chunks(4).map(word).collect(), roots, top)
}

/// Radiance times 2^1, not cut off: what a file of one frame has, on a mesh of its own.
#[test]
fn a_usda_has_colours_and_places_for_every_frame() {
    let (dir, scene) = room();
    let (out, lit) = (dir.path().join("lit.usda"), dir.path().join("lit.glb"));
    let export = |out: &Path, frames: &str| {
        let flags = ["--frames", frames, "--tolerance", "0.2", "-q", "--exposure", "1"];
        relume(&[&["export", text(&scene), "-o", text(out)], &flags[..]].concat()).succeeds();
    };
    export(&out, "0-6x6");
    export(&lit, "0");
    let usd = fs::read_to_string(&out).unwrap();
    assert!(usd.starts_with("#usda 1.0\n"));
    assert!(usd.contains("    startTimeCode = 0\n    endTimeCode = 6\n"));
    assert!(usd.contains("matrix4d xformOp:transform.timeSamples = {\n            0: (("));
    assert_eq!(usd.matches(['{', '(', '[']).count(), usd.matches(['}', ')', ']']).count());
    let floor = usd.split_once("def Mesh \"floor\"").unwrap().1.split("def Mesh").next().unwrap();
    let numbers = |of: &str| -> Vec<f64> {
        let line = floor.lines().find(|line| line.contains(of)).unwrap();
        let list = line.split_once("[(").unwrap().1.split(']').next().unwrap();
        list.replace(['(', ')', ' '], "").split(',').map(|x| x.parse().unwrap()).collect()
    };
    let (points, first, last) = (numbers("points = "), numbers(" 0: ["), numbers(" 6: ["));
    assert_eq!((points.len(), last.len()), (first.len(), first.len()));
    assert!(first != last);
    let file = chunks(&lit);
    let mesh = file.0["meshes"].as_array().unwrap().iter().find(|m| m["name"] == "floor");
    let attributes = &mesh.unwrap()["primitives"][0]["attributes"];
    let places = values(&file, &attributes["POSITION"]);
    let radiosity = values(&file, &attributes["_RADIOSITY"]);
    let mut same = 0;
    for (p, c) in points.chunks(3).zip(first.chunks(3)) {
        let near = |q: &[f64]| (0..3).all(|k| (q[k] - p[k]).abs() < 1e-6);
        let Some(at) = places.chunks(3).position(near) else { continue };
        let b = &radiosity[3 * at..3 * at + 3];
        let is_it = |k: usize| (c[k] * std::f64::consts::PI / 2.0 - b[k]).abs() < 1e-4 * b[k];
        same += usize::from((0..3).all(is_it));
    }
    assert!(4 * same > places.len() / 3, "{same} of {}", places.len() / 3);
}

#[test]
fn what_cannot_be_written_is_said_before_anything_is_solved() {
    let (dir, scene) = room();
    let at = |name: &str| dir.path().join(name);
    let run = |name: &str, more: &[&str]| {
        relume(&[&["export", text(&scene), "-o", text(&at(name))], more].concat())
    };
    run("lit.fbx", &[]).fails(2, &["no way to write .fbx", "lit.glb"]);
    run("lit", &[]).fails(2, &["has no ending"]);
    run("no/where/lit.glb", &[]).fails(1, &["cannot write", "choose another place"]);
    run("lit.glb", &["--turntable", "9"]).fails(2, &["leave out --turntable"]);
    run("lit.vtp", &[]).fails(2, &["one frame, and there are 20", "lit.pvd"]);
    run("lit.vtp", &["--exposure", "1"]).fails(2, &["leave out --exposure"]);
    run("lit.glb", &["--keys", "0"]).fails(2, &["--keys"]);
}

/// Read by a library that is not what wrote it: pixels are what the surfaces reflect of what arrives there.
#[test]
fn exr_frames_hold_radiance_with_what_it_is_made_of() {
    let (dir, scene) = room();
    let out = dir.path().join("out");
    let flags = ["--frames", "6", "--tolerance", "0.2", "--size", "64x48", "-q", "--format", "exr"];
    let render = ["render", text(&scene), "-o", text(&out)];
    relume(&[&render[..], &flags].concat()).succeeds();
    let path = out.join("frame-0006.exr");
    let first = fs::read(&path).unwrap();
    // Finished, so there is nothing to do.
    relume(&[&render[..], &flags, &["--resume"]].concat()).succeeds();
    assert!(fs::read(&path).unwrap() == first);
    relume(&[&render[..], &flags, &["--mesh"]].concat()).fails(2, &["leave out --mesh"]);
    let image = image::open(&path).unwrap().into_rgba32f();
    assert_eq!(image.dimensions(), (64, 48));
    // The whole picture is the room, and the lamp is the brightest.
    assert!(image.pixels().all(|p| p[3] == 1.0 && p[0] > 0.0));
    let layer = read_exr(&first);
    let at = |name: &str, k: usize| layer(name)[k];
    let mut checked = 0;
    for (k, pixel) in image.pixels().enumerate() {
        assert_eq!(at("R", k), pixel[0]);
        let n = ["normal.X", "normal.Y", "normal.Z"].map(|name| at(name, k));
        assert!((n.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-5, "{n:?}");
        assert!(at("depth.Z", k) > 0.1 && at("depth.Z", k) < 100.0 && at("body.id", k) >= 1.0);
        // Where a pixel sees one surface, and that is no lamp.
        let [r, g, b] = ["R", "G", "B"].map(|c| at(&format!("reflectance.{c}"), k));
        let is_floor = [r, g, b].iter().zip(FLOOR).all(|(r, f)| (r - f as f32).abs() < 1e-6);
        if is_floor {
            checked += 1;
            for c in ["R", "G", "B"] {
                let (rho, h) =
                    (at(&format!("reflectance.{c}"), k), at(&format!("irradiance.{c}"), k));
                let l = rho * h / std::f32::consts::PI;
                assert!((at(c, k) - l).abs() < 1e-4 * l, "{} is not {l}", at(c, k));
            }
            assert!(n[1] > 0.999);
        }
    }
    assert!(checked > 100, "{checked}");
}

/// The channels of an OpenEXR file by name.
fn read_exr(bytes: &[u8]) -> impl Fn(&str) -> Vec<f32> {
    use exr::prelude::{ReadChannels, ReadLayers};
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.all_layers().all_attributes().from_buffered(std::io::Cursor::new(bytes));
    let layer = image.unwrap().layer_data.remove(0);
    move |name| {
        let found = layer.channel_data.list.iter().find(|channel| channel.name == *name);
        found.unwrap().sample_data.values_as_f32().collect()
    }
}
