//! Textures, vertex colours and alpha of a file: what each patch reflects, emits and lets pass.

use std::f64::consts::{FRAC_PI_2, PI};

use relume_core::scene::{Edits, Patch, Scene};
use relume_io::{ImportOptions, import};
use serde_json::{Value, json};

use super::gltf::Gltf;
use super::{scene_of, with_code};

/// A mesh of triangles in the plane z = 0, each corner with its texture coordinates.
struct Sheet {
    points: Vec<[f32; 2]>,
    places: Vec<[f32; 2]>,
    triangles: Vec<[u16; 3]>,
}

impl Sheet {
    /// The unit square as `n` x `n` cells, with texture coordinates as a function of the place.
    fn new(n: usize, place: impl Fn(f32, f32) -> [f32; 2]) -> Sheet {
        let at = |i: usize| i as f32 / n as f32;
        let corners = || (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let cell = |i: usize, j: usize| {
            let k = |a: usize, b: usize| ((j + b) * (n + 1) + i + a) as u16;
            [[k(0, 0), k(1, 0), k(1, 1)], [k(0, 0), k(1, 1), k(0, 1)]]
        };
        Sheet {
            points: corners().map(|(i, j)| [at(i), at(j)]).collect(),
            places: corners().map(|(i, j)| place(at(i), at(j))).collect(),
            triangles: (0..n * n).flat_map(|c| cell(c % n, c / n)).collect(),
        }
    }

    /// As a file of one node, whose primitive has the material `material`.
    fn gltf(&self, material: Value) -> Gltf {
        let mut g = Gltf::new();
        g.json["materials"][0] = material;
        let points: Vec<f32> = self.points.iter().flat_map(|p| [p[0], p[1], 0.0]).collect();
        let position = g.floats("VEC3", &points);
        let places = g.floats("VEC2", self.places.as_flattened());
        let indices = g.shorts(self.triangles.as_flattened());
        let primitive = json!({"attributes": {"POSITION": position, "TEXCOORD_0": places},
            "indices": indices, "material": 0});
        g.push("meshes", json!({"name": "Sheet", "primitives": [primitive]}));
        g.node(json!({"name": "sheet", "mesh": 0}));
        g
    }
}

/// Embeds an image of another format, by the extension that it needs.
fn paint_as(g: &mut Gltf, bytes: &[u8], extension: &str) {
    let view = g.view(bytes);
    g.json["images"] = json!([{"bufferView": view}]);
    g.json["textures"] = json!([{"extensions": {extension: {"source": 0}}}]);
    g.json["extensionsRequired"] = json!([extension]);
}

/// Embeds an image, rows from the top, as texture 0 with these wrap modes.
fn paint(g: &mut Gltf, size: [u32; 2], rgba: &[[u8; 4]], wrap: u32) {
    let image = image::RgbaImage::from_raw(size[0], size[1], rgba.concat()).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    let view = g.view(&bytes.into_inner());
    g.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    g.json["samplers"] = json!([{"wrapS": wrap, "wrapT": wrap}]);
    g.json["textures"] = json!([{"source": 0, "sampler": 0}]);
}

const REPEAT: u32 = 10497;
const MIRROR: u32 = 33648;
const CLAMP: u32 = 33071;

const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];

fn base(more: Value) -> Value {
    let mut texture = json!({"index": 0});
    texture.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    json!({"name": "sheet", "pbrMetallicRoughness":
        {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "baseColorTexture": texture, "metallicFactor": 0}})
}

fn glowing() -> Value {
    json!({"name": "sheet", "emissiveFactor": [1.0, 0.5, 0.25], "emissiveTexture": {"index": 0}})
}

/// What the patches reflect, each once.
fn colours(scene: &Scene) -> Vec<[f64; 3]> {
    let mut all: Vec<[f64; 3]> = scene.patches.iter().map(|p| scene.reflectance(p)).collect();
    all.dedup();
    all
}

fn flux_w(scene: &Scene) -> [f64; 3] {
    scene.patches.iter().fold([0.0; 3], |sum, p| {
        let m = scene.exitance_at(p, 0.0);
        [0, 1, 2].map(|c| sum[c] + m[c] * p.area_m2())
    })
}

fn linear(value: u8) -> f64 {
    let c = f64::from(value) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn swatches_of_a_palette_stay_apart() {
    // Four cells in one plane; the left ones look up red, the right ones green. Each is a point of the image.
    let mut sheet = Sheet::new(2, |_, _| [0.0; 2]);
    let vertices = |t: &[u16; 3]| t.map(|v| sheet.points[usize::from(v)]);
    let is_left: Vec<bool> =
        sheet.triangles.iter().map(|t| vertices(t).iter().all(|p| p[0] <= 0.5)).collect();
    // Vertices split, as exporters do at seams.
    let corners: Vec<u16> = sheet.triangles.as_flattened().to_vec();
    let place = |k: usize| if is_left[k / 3] { [0.25, 0.5] } else { [0.75, 0.5] };
    sheet.places = (0..corners.len()).map(place).collect();
    sheet.points = corners.iter().map(|&v| sheet.points[usize::from(v)]).collect();
    sheet.triangles =
        (0..corners.len() as u16 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut g = sheet.gltf(base(json!({})));
    paint(&mut g, [2, 1], &[RED, GREEN], REPEAT);
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.patches.len(), 2, "two rectangles");
    assert_eq!(colours(&scene), [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]]);
    assert_eq!(scene.tints.len(), 2);
}

#[test]
fn a_picture_on_a_wall_does_not_cut_it() {
    let mut g = Sheet::new(3, |x, y| [x, y]).gltf(base(json!({})));
    let rgba: Vec<[u8; 4]> = (0..64).map(|k| if k * 7 % 11 < 5 { WHITE } else { BLACK }).collect();
    paint(&mut g, [8, 8], &rgba, REPEAT);
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.patches.len(), 1);
    let white = rgba.iter().filter(|t| **t == WHITE).count() as f64 / 64.0;
    assert!((scene.reflectance(&scene.patches[0])[0] - 0.5 * white).abs() < 1e-6);
}

/// An image without pattern, and the linear value of a texel.
fn patternless(n: u32) -> Vec<[u8; 4]> {
    let mix = |k: u32| (k.wrapping_mul(2_654_435_761) >> 23) as u8;
    (0..n * n).map(|k| [mix(k), mix(k + 77_777), mix(3 * k + 5), 255]).collect()
}

#[test]
fn watts_are_the_integral_of_the_image_over_the_mesh() {
    let n = 24;
    let image = patternless(n);
    // Texture coordinates from -1 to 2 on both axes; beyond a clamped edge its texels count another n times.
    for (wrap, beyond) in [(REPEAT, None), (MIRROR, None), (CLAMP, Some(f64::from(n)))] {
        let weight = |k: u32| match beyond {
            Some(more) if k == 0 || k == n - 1 => (1.0 + more) / (3.0 * f64::from(n)),
            Some(_) => 1.0 / (3.0 * f64::from(n)),
            None => 1.0 / f64::from(n),
        };
        let mut right = [0.0; 3];
        for (k, texel) in (0..).zip(&image) {
            let share = weight(k % n) * weight(k / n) * PI;
            (0..3).for_each(|c| right[c] += share * linear(texel[c]) * [1.0, 0.5, 0.25][c]);
        }
        for cells in [1, 7] {
            let mut g = Sheet::new(cells, |x, y| [3.0 * x - 1.0, 3.0 * y - 1.0]).gltf(glowing());
            paint(&mut g, [n, n], &image, wrap);
            let scene = scene_of(&g).unwrap();
            let got = flux_w(&scene);
            for c in 0..3 {
                let off = got[c] / right[c] - 1.0;
                assert!(off.abs() < 1e-3, "wrap {wrap}, {cells} cells: {got:?}, not {right:?}");
            }
        }
    }
}

#[test]
fn a_small_screen_on_a_large_wall_glows_where_it_is() {
    // 3 x 2 texels of 32 x 32 glow.
    let is_lit = |k: usize| (20..23).contains(&(k % 32)) && (9..11).contains(&(k / 32));
    let image: Vec<[u8; 4]> = (0..1024).map(|k| if is_lit(k) { WHITE } else { BLACK }).collect();
    let mut g = Sheet::new(1, |x, y| [x, y]).gltf(glowing());
    paint(&mut g, [32, 32], &image, REPEAT);
    let scene = scene_of(&g).unwrap();
    assert!((flux_w(&scene)[0] / (PI * 6.0 / 1024.0) - 1.0).abs() < 1e-5);
    let lit: Vec<&Patch> = scene.patches.iter().filter(|p| scene.patch_emits(p)).collect();
    assert_eq!(lit.len(), 1, "of {} parts", scene.patches.len());
    assert!((lit[0].area_m2() * 1024.0 - 6.0).abs() < 1e-4);
    let middle = lit[0].corners_in_body().sum::<glam::DVec3>() / 4.0;
    assert!(middle.distance(glam::DVec3::new(21.5, 10.0, 0.0) / 32.0) < 1e-6, "{middle}");
    assert!(scene.patches.len() <= 6);
    let area: f64 = scene.patches.iter().map(Patch::area_m2).sum();
    assert!((area - 1.0).abs() < 1e-6);
}

#[test]
fn an_even_glow_and_noise_are_not_cut() {
    for image in [vec![WHITE; 1024], patternless(32)] {
        let mut g = Sheet::new(1, |x, y| [x, y]).gltf(glowing());
        paint(&mut g, [32, 32], &image, REPEAT);
        assert_eq!(scene_of(&g).unwrap().patches.len(), 1);
    }
}

#[test]
fn a_wall_of_many_small_triangles_is_one_polygon() {
    let mut g = Sheet::new(200, |x, y| [x, y]).gltf(glowing());
    paint(&mut g, [32, 32], &[WHITE; 1024], REPEAT);
    assert_eq!(scene_of(&g).unwrap().patches.len(), 1);
}

#[test]
fn texture_transforms_and_further_sets_of_coordinates_count() {
    let quarters = [RED, GREEN, BLUE, WHITE];
    let seen = |more: Value, place: [f32; 2]| {
        let mut g = Sheet::new(1, |_, _| place).gltf(base(more));
        // A second set, all in the blue quarter.
        let second = g.floats("VEC2", &[0.25, 0.75].repeat(4));
        g.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(second);
        paint(&mut g, [2, 2], &quarters, REPEAT);
        colours(&scene_of(&g).unwrap())[0].map(|c| (2.0 * c).round() as u8)
    };
    let moved = |t: Value| json!({"extensions": {"KHR_texture_transform": t}});
    assert_eq!(seen(json!({}), [0.25, 0.25]), [1, 0, 0]);
    assert_eq!(seen(json!({"texCoord": 1}), [0.25, 0.25]), [0, 0, 1]);
    assert_eq!(seen(moved(json!({"texCoord": 1})), [0.25, 0.25]), [0, 0, 1]);
    assert_eq!(seen(moved(json!({"offset": [0.5, 0.0]})), [0.25, 0.25]), [0, 1, 0]);
    assert_eq!(seen(moved(json!({"scale": [3.0, 1.0]})), [0.25, 0.25]), [0, 1, 0]);
    // The example of the extension: the lower left quarter, turned. Scale first, then rotation.
    let example =
        || moved(json!({"offset": [0.0, 1.0], "rotation": FRAC_PI_2, "scale": [0.5, 0.5]}));
    for place in [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9], [0.9, 0.9]] {
        assert_eq!(seen(example(), place), [0, 0, 1]);
    }
    let turned = moved(json!({"rotation": FRAC_PI_2, "scale": [1.0, 3.0]}));
    // (0.25, 0.25) is scaled to (0.25, 0.75), turned to (0.75, -0.25): white.
    assert_eq!(seen(turned, [0.25, 0.25]), [1, 1, 1]);
}

#[test]
fn coordinates_and_colours_may_be_whole_numbers() {
    let mut g = Sheet::new(1, |_, _| [0.0; 2]).gltf(base(json!({})));
    paint(&mut g, [2, 1], &[RED, GREEN], REPEAT);
    // 0.75 of 255 and of 65535; each in four bytes.
    let bytes = [191u8, 128, 0, 0].repeat(4);
    let shorts: Vec<u8> =
        [49_151u16, 32_767].repeat(4).iter().flat_map(|v| v.to_le_bytes()).collect();
    for (data, component) in [(bytes, 5121), (shorts, 5123)] {
        let view = g.view(&data);
        g.json["bufferViews"][view]["byteStride"] = json!(4);
        let accessor = g.push(
            "accessors",
            json!({"bufferView": view, "componentType": component,
            "normalized": true, "count": 4, "type": "VEC2"}),
        );
        g.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(accessor);
        assert_eq!(colours(&scene_of(&g).unwrap()), [[0.0, 0.5, 0.0]]);
    }
    let view = g.view(&[51u8, 102, 204, 0].repeat(4));
    let accessor = g.push(
        "accessors",
        json!({"bufferView": view, "componentType": 5121,
        "normalized": true, "count": 4, "type": "VEC4"}),
    );
    g.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(accessor);
    let [[r, g, b]] = colours(&scene_of(&g).unwrap())[..] else { panic!("one colour") };
    assert!(r == 0.0 && b == 0.0 && (g - 0.2).abs() < 1e-12, "{g}");
}

#[test]
fn vertex_colours_multiply_texture_and_factor() {
    // Colours that go from 0 to 1 along x, on a texture of 0 and 1 that does the same.
    let ramp: Vec<f32> = [0.0, 1.0, 0.0, 1.0].iter().flat_map(|&c| [c; 3]).collect();
    for (image, right) in [(None, 0.25), (Some([BLACK, WHITE]), 0.5 * 3.0 / 8.0)] {
        let material = match image {
            Some(_) => base(json!({})),
            None => json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0]}}),
        };
        let mut g = Sheet::new(1, |x, y| [x, y]).gltf(material);
        if let Some(image) = image {
            paint(&mut g, [2, 1], &image, REPEAT);
        }
        let accessor = g.floats("VEC3", &ramp);
        g.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(accessor);
        let scene = scene_of(&g).unwrap();
        let sum = |c: usize| -> f64 {
            scene.patches.iter().map(|p| p.area_m2() * scene.reflectance(p)[c]).sum()
        };
        assert!((sum(0) - right).abs() < 1e-3, "{} not {right}", sum(0));
    }
}

/// The area of what is left of a sheet, and how many patches it is.
fn left(material: Value, image: &[[u8; 4]]) -> (f64, usize, Scene) {
    let mut g = Sheet::new(1, |x, y| [x, y]).gltf(material);
    let n = (image.len() as f64).sqrt() as u32;
    if !image.is_empty() {
        paint(&mut g, [n, n], image, REPEAT);
    }
    // Something that is there in any case.
    let cube = g.cube_mesh();
    g.push("materials", json!({"name": "cube"}));
    g.json["meshes"][cube]["primitives"][0]["material"] = json!(1);
    g.node(json!({"name": "cube", "mesh": cube}));
    let scene = scene_of(&g).unwrap();
    let sheet = || scene.patches.iter().filter(|p| p.material.0 == 0);
    (sheet().map(Patch::area_m2).sum(), sheet().count(), scene.clone())
}

#[test]
fn leaves_block_light_where_their_image_is() {
    // A leaf of 6 x 8 texels, green, on 16 x 16 that are transparent and white.
    let leaf = |k: usize| (3..9).contains(&(k % 16)) && (5..13).contains(&(k / 16));
    let texel = |k: usize| if leaf(k) { GREEN } else { [255, 255, 255, 0] };
    let image: Vec<[u8; 4]> = (0..256).map(texel).collect();
    for mode in ["MASK", "BLEND"] {
        let mut material = base(json!({}));
        material["alphaMode"] = json!(mode);
        let (area, count, scene) = left(material, &image);
        assert!((area - 48.0 / 256.0).abs() < 1e-5, "{mode}: {area}");
        assert_eq!(count, 1);
        assert_eq!(scene.reflectance(&scene.patches[0]), [0.0, 0.5, 0.0]);
        let note = with_code(&scene.notes, "transparency")[0];
        assert!(
            note.message.contains("sheet") && note.message.contains("1 block it"),
            "{}",
            note.message
        );
    }
    // Opaque: alpha does not count.
    assert_eq!(left(base(json!({})), &image).0, 1.0);
}

#[test]
fn a_fine_grid_covers_its_share_in_the_mean() {
    let texel = |k: usize| if (k + k / 16).is_multiple_of(4) { WHITE } else { [0; 4] };
    let image: Vec<[u8; 4]> = (0..256).map(texel).collect();
    let mut material = base(json!({}));
    material["alphaMode"] = json!("MASK");
    // A quarter is there; the sheet of nine cells is one polygon that no cut helps: it is let go as a whole.
    let (area, count, _) = left(material.clone(), &image);
    assert!(count <= 32 && area < 0.5, "{area}, {count}");
    material["alphaCutoff"] = json!(0.0);
    assert_eq!(left(material, &image).0, 1.0);
}

#[test]
fn panes_of_glass_let_light_pass() {
    let alpha = |a: f64, mode: &str| {
        json!({"name": "pane", "alphaMode": mode,
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, a]}})
    };
    let area = |material: Value| left(material, &[]).0;
    assert_eq!(area(alpha(0.2, "OPAQUE")), 1.0);
    assert_eq!(area(alpha(0.2, "BLEND")), 0.0);
    assert_eq!(area(alpha(0.8, "BLEND")), 1.0);
    let mut cut = alpha(0.3, "MASK");
    assert_eq!(area(cut.clone()), 0.0);
    cut["alphaCutoff"] = json!(0.25);
    assert_eq!(area(cut), 1.0);
    let mut glass = alpha(1.0, "OPAQUE");
    glass["extensions"] = json!({"KHR_materials_transmission": {"transmissionFactor": 0.9}});
    assert_eq!(area(glass.clone()), 0.0);
    glass["extensions"] = json!({"KHR_materials_transmission": {}});
    assert_eq!(area(glass), 1.0);
}

/// A glass by itself is to be seen; with anything beside it it lets light pass.
#[test]
fn where_everything_lets_light_pass_it_blocks_it() {
    let mut g = Gltf::cube();
    g.json["materials"][0]["extensions"] =
        json!({"KHR_materials_transmission": {"transmissionFactor": 1.0}});
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.patches.len(), 6);
    let notes = with_code(&scene.notes, "transparency");
    assert!(notes.len() == 1 && notes[0].message.contains("nothing would be left"), "{notes:?}");
    let mesh = g.cube_mesh();
    let stone = g.push("materials", json!({"name": "stone"}));
    g.json["meshes"][mesh]["primitives"][0]["material"] = json!(stone);
    g.node(json!({"name": "stone", "mesh": mesh, "translation": [3.0, 0.0, 0.0]}));
    assert_eq!(scene_of(&g).unwrap().patches.len(), 6);
}

#[test]
fn high_reflectances_are_one_line_for_all_materials() {
    let mut g = Gltf::cube();
    for name in ["white", "bright", "grey"] {
        let value = if name == "grey" { 0.5 } else { 1.0 };
        let material = g.push(
            "materials",
            json!({"name": name,
            "pbrMetallicRoughness": {"baseColorFactor": [value, value, value, 1.0]}}),
        );
        let mesh = g.cube_mesh();
        g.json["meshes"][mesh]["primitives"][0]["material"] = json!(material);
        g.node(json!({"name": format!("{name} cube"), "mesh": mesh}));
    }
    let scene = scene_of(&g).unwrap();
    let notes = with_code(&scene.notes, "reflectance");
    assert_eq!((notes.len(), notes[0].count), (1, 2));
    assert!(notes[0].message.contains("(white, bright)"), "{}", notes[0].message);
    let high: Vec<_> =
        relume_core::scene::check(&scene).into_iter().filter(|n| n.code == "reflectance").collect();
    assert_eq!((high.len(), high[0].count), (1, 12));
    assert!(high[0].message.contains("bright"));
}

#[test]
fn attributes_of_another_length_are_an_error() {
    let mut g = Sheet::new(1, |x, y| [x, y]).gltf(base(json!({})));
    paint(&mut g, [1, 1], &[WHITE], REPEAT);
    let short = g.floats("VEC2", &[0.0; 6]);
    g.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(short);
    let said = scene_of(&g).unwrap_err().to_string();
    assert!(said.contains("TEXCOORD_0 has 3 values for 4 vertices"), "{said}");
}

#[test]
fn emission_that_changes_keeps_its_pattern() {
    let mut g = Sheet::new(1, |x, y| [x, y]).gltf(glowing());
    paint(&mut g, [2, 1], &[BLACK, WHITE], REPEAT);
    let input = g.floats("SCALAR", &[0.0, 1.0]);
    let output = g.floats("VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
    let target = json!({"path": "pointer", "extensions":
        {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}});
    g.push(
        "animations",
        json!({"channels": [{"sampler": 0, "target": target}],
        "samplers": [{"input": input, "output": output}]}),
    );
    let scene = scene_of(&g).unwrap();
    assert_eq!(scene.patches.len(), 2);
    let lit: Vec<[f64; 3]> = scene.patches.iter().map(|p| scene.exitance_at(p, 0.5)).collect();
    let near = |m: [f64; 3], r: f64| (m[0] - r).abs() < 1e-6 && m[1] == 0.0;
    assert!(lit.iter().any(|&m| near(m, PI)) && lit.iter().any(|&m| near(m, 0.0)), "{lit:?}");
    assert_eq!(scene.most_exitance(&scene.patches[0])[1], 0.0);
}

#[test]
fn webp_images_are_read_and_of_ktx2_the_tool_is_named() {
    let mut g = Sheet::new(1, |_, _| [0.75, 0.5]).gltf(base(json!({})));
    let image = image::RgbaImage::from_raw(2, 1, [RED, GREEN].concat()).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::WebP).unwrap();
    paint_as(&mut g, &bytes.into_inner(), "EXT_texture_webp");
    assert_eq!(colours(&scene_of(&g).unwrap()), [[0.0, 0.5, 0.0]]);
    paint_as(&mut g, b"\xABKTX 20\xBB\r\n\x1A\n and more", "KHR_texture_basisu");
    let scene = scene_of(&g).unwrap();
    assert_eq!(colours(&scene), [[0.5; 3]]);
    let said = &with_code(&scene.notes, "texture")[0].message;
    assert!(said.contains("base colour") && said.contains("ktx extract"), "{said}");
}

/// What is asked for counts for every patch of a material, whatever its texture says there.
#[test]
fn edits_of_a_textured_material_hold_for_all_its_patches() {
    let mut g = Sheet::new(2, |x, y| [x, y]).gltf(base(json!({})));
    paint(&mut g, [2, 2], &[RED, GREEN, BLUE, WHITE], CLAMP);
    let edits = Edits {
        emit: vec![("sheet".into(), [3.0; 3])],
        reflect: vec![("sheet".into(), [0.25; 3])],
        ..Edits::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let options = ImportOptions { edits, ..ImportOptions::default() };
    let scene = import(g.write(folder.path(), "scene"), &options).unwrap();
    assert!(scene.patches.len() > 1);
    for patch in &scene.patches {
        assert_eq!(scene.reflectance(patch), [0.25; 3]);
        assert_eq!(scene.exitance_at(patch, 0.0), [3.0 * PI; 3]);
    }
}

/// Exporters write black with an alpha of 0 where vertices are not painted.
#[test]
fn vertex_colours_that_are_mostly_unset_are_a_mask() {
    let scene = |colours: [[f32; 4]; 4], mode: &str| {
        let mut g = Sheet::new(1, |x, y| [x, y]).gltf(json!({"name": "sheet", "alphaMode": mode,
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0}}));
        let accessor = g.floats("VEC4", colours.as_flattened());
        g.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(accessor);
        scene_of(&g)
    };
    let (unset, red) = ([0.0; 4], [1.0, 0.0, 0.0, 1.0]);
    let mask = scene([unset, unset, unset, red], "OPAQUE").unwrap();
    assert_eq!(colours(&mask), [[0.5; 3]]);
    assert_eq!(with_code(&mask.notes, "vertex-colours").len(), 1);
    // Black that is meant, half of it unset, and what lets light pass there.
    let black = [0.0, 0.0, 0.0, 1.0];
    for (painted, mode) in [([black; 4], "OPAQUE"), ([unset, unset, red, red], "OPAQUE")] {
        let scene = scene(painted, mode).unwrap();
        assert!(colours(&scene).iter().all(|c| c[1] == 0.0), "{painted:?}");
        assert!(with_code(&scene.notes, "vertex-colours").is_empty());
    }
    // Nothing would be left of it.
    let whole = scene([unset; 4], "MASK").unwrap();
    assert_eq!(with_code(&whole.notes, "transparency").len(), 1);
    assert_eq!(colours(&whole), [[0.5; 3]]);
}
