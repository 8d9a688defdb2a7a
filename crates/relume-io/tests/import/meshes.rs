//! Meshes of OBJ, STL and PLY files: the same cube in each, and what is wrong with some.

use std::path::Path;

use glam::DVec3;

use super::gltf::{cube_indices, cube_positions};
use super::{read, with_code};
use relume_core::geometry::Aabb;
use relume_core::scene::{Scene, SceneError, Severity};
use relume_io::{ImportOptions, import};

/// A scene of a file of this content.
fn scene_of(name: &str, content: &[u8]) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    read(&path)
}

/// The unit cube, its fronts outside.
fn is_the_cube(scene: &Scene) {
    assert_eq!((scene.bodies.len(), scene.patches.len()), (1, 12), "double-sided");
    let bounds = scene.bounds(0.0).unwrap();
    assert_eq!(bounds, Aabb { lo: DVec3::ZERO, hi: DVec3::ONE });
    let outward =
        |p: &relume_core::scene::Patch| p.frame.normal.dot(p.frame.origin - bounds.centre()) > 0.0;
    assert_eq!(scene.patches.iter().filter(|p| outward(p)).count(), 6);
    assert_eq!(scene.materials[0].reflectance, [0.5; 3]);
    assert_eq!(with_code(&scene.notes, "units").len(), 1);
}

/// Corners and triangles of the cube.
fn cube() -> (Vec<[f32; 3]>, Vec<[u16; 3]>) {
    let corners = cube_positions().chunks(3).map(|p| [p[0], p[1], p[2]]).collect();
    (corners, cube_indices().chunks(3).map(|t| [t[0], t[1], t[2]]).collect())
}

fn stl_text() -> String {
    let (corners, triangles) = cube();
    let vertex = |c: &u16| {
        let [x, y, z] = corners[usize::from(*c)];
        format!("vertex {x} {y} {z}\n")
    };
    let facet = |t: &[u16; 3]| {
        format!(
            "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n",
            t.iter().map(vertex).collect::<String>()
        )
    };
    format!("solid cube\n{}endsolid cube\n", triangles.iter().map(facet).collect::<String>())
}

fn stl_binary(header: &[u8]) -> Vec<u8> {
    let (corners, triangles) = cube();
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for t in &triangles {
        bytes.extend([0; 12]);
        bytes.extend(t.iter().flat_map(|&c| corners[usize::from(c)]).flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn stl_in_text_and_in_both_guises_of_binary() {
    is_the_cube(&scene_of("cube.stl", stl_text().as_bytes()).unwrap());
    for start in ["solid\tcube\n", "solid\r\n", "solid\n"] {
        let text = stl_text().replacen("solid cube\n", start, 1);
        is_the_cube(&scene_of("cube.stl", text.as_bytes()).unwrap());
    }
    is_the_cube(&scene_of("cube.STL", &stl_binary(b"made by hand")).unwrap());
    is_the_cube(
        &scene_of("cube.stl", &stl_binary(b"solid cube\nmade by a program that does not care"))
            .unwrap(),
    );
}

fn ply(format: &str) -> Vec<u8> {
    let (corners, _) = cube();
    let mut text = format!(
        "ply\nformat {format} 1.0\ncomment by hand\nelement vertex 24\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nelement face 6\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int a\nend_header\n"
    )
    .into_bytes();
    let is_text = format == "ascii";
    let is_big = format == "binary_big_endian";
    let word =
        |v: [u8; 4]| if is_big { v.into_iter().rev().collect::<Vec<u8>>() } else { v.to_vec() };
    for c in &corners {
        match is_text {
            true => text.extend(format!("{} {} {} 7\n", c[0], c[1], c[2]).into_bytes()),
            false => {
                text.extend(c.iter().flat_map(|v| word(v.to_le_bytes())));
                text.push(7);
            }
        }
    }
    for side in 0..6 {
        let loop_of = [0, 1, 2, 3].map(|k| 4 * side + k);
        match is_text {
            true => text.extend(
                format!("4 {} {} {} {}\n", loop_of[0], loop_of[1], loop_of[2], loop_of[3])
                    .into_bytes(),
            ),
            false => {
                text.push(4);
                text.extend(loop_of.iter().flat_map(|v: &i32| word(v.to_le_bytes())));
            }
        }
    }
    text.extend(if is_text { b"5\n".to_vec() } else { vec![0; 4] });
    text
}

#[test]
fn ply_in_text_and_both_orders_of_binary() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let scene = scene_of("cube.ply", &ply(format)).unwrap();
        is_the_cube(&scene);
        assert!(with_code(&scene.notes, "ply")[0].message.contains("edge"));
    }
}

const OBJ: &str = "mtllib room.mtl\no floor\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\nusemtl red\nf 1 2 3 4 5\n\
                   o lamp\nv 0 0 3\nv 1 0 3\nv 1 1 3\nv 0 1 3\nusemtl light\nf -1 -2 -3 -4\nusemtl nothing\nf 6 7 8\n\
                   g group\nf 6/1/1 7/1/1 8/1/1\nl 1 2\n";
const MTL: &str =
    "newmtl red\nKd 0.8 0.1 1.0\nmap_Kd wood.png\nd 0.5\nnewmtl light\nKe 4 2 0\nKd 0.2 0.2 0.2\n";

/// What only black materials are known of is drawn grey; one that is black among others is black.
#[test]
fn obj_files_that_are_black_all_over_are_grey() {
    let reflectances = |materials: &str| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("room.mtl"), materials).unwrap();
        let path = folder.path().join("room.obj");
        std::fs::write(&path, OBJ).unwrap();
        let scene = import(&path, &Default::default()).unwrap();
        let of = |name: &str| {
            scene.materials.iter().find(|m| m.name == name).map(|m| m.reflectance[0]).unwrap()
        };
        (of("red"), of("light"), with_code(&scene.notes, "black").len())
    };
    let black = "newmtl red\nKd 0 0 0\nnewmtl light\nKd 0 0 0\n";
    assert_eq!(reflectances(black), (0.5, 0.5, 1));
    let one = "newmtl red\nKd 0 0 0\nnewmtl light\nKd 0.2 0.2 0.2\n";
    assert_eq!(reflectances(one), (0.0, 0.2, 0));
    let textured = "newmtl red\nKd 0 0 0\nmap_Kd wood.png\nnewmtl light\nKd 0.2 0.2 0.2\n";
    assert_eq!(reflectances(textured), (0.5, 0.2, 0), "its image is not there");
}

#[test]
fn strips_of_triangles_in_ply_are_surfaces() {
    let strips = |list: &str| {
        let count = list.split_whitespace().count();
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
             element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
             0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 1\n1 2 1\n{count} {list}\n"
        );
        scene_of("strip.ply", text.as_bytes()).unwrap()
    };
    let fronts = |scene: &Scene| {
        let firsts = scene
            .patches
            .iter()
            .enumerate()
            .filter(|(k, p)| p.twin.is_none_or(|t| t.0 as usize > *k));
        firsts.map(|(_, p)| (p.area_m2(), p.frame.normal.z > 0.0)).collect::<Vec<_>>()
    };
    // A square, and a slope behind it, all counter-clockwise from above.
    let whole = fronts(&strips("0 1 2 3 4 5"));
    assert!(whole.len() == 2 && whole.iter().all(|f| f.1), "{whole:?}");
    assert!((whole[0].0 - 1.0).abs() < 1e-12 && (whole[1].0 - 2f64.sqrt()).abs() < 1e-12);
    // In two strips with a gap between.
    assert_eq!(fronts(&strips("0 1 2 3 -1 2 3 4 5")), whole);
    assert_eq!(fronts(&strips("0 1 2 -1 4 2 3")).len(), 2);
}

#[test]
fn ply_with_other_ends_of_lines_and_more_space() {
    for format in ["ascii", "binary_little_endian"] {
        let plain = ply(format);
        let body = plain.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        for end in ["\r", "\r\n"] {
            let again = |bytes: &[u8]| {
                String::from_utf8(bytes.to_vec()).unwrap().replace('\n', end).into_bytes()
            };
            let text = again(&plain[..body]);
            let rest =
                if format == "ascii" { again(&plain[body..]) } else { plain[body..].to_vec() };
            is_the_cube(&scene_of("cube.ply", &[text, rest].concat()).unwrap());
        }
        let text = String::from_utf8(plain[..body].to_vec()).unwrap();
        let text = text
            .replace("element face", "\t element  \tface")
            .replace("property float", "property   float");
        is_the_cube(&scene_of("cube.ply", &[text.as_bytes(), &plain[body..]].concat()).unwrap());
    }
}

#[test]
fn obj_with_objects_groups_and_materials() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.obj");
    std::fs::write(&path, OBJ).unwrap();
    std::fs::write(folder.path().join("room.mtl"), MTL).unwrap();
    let scene = read(&path).unwrap();
    let bodies: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(bodies, ["floor", "lamp", "group"]);
    let material = |name: &str| scene.materials.iter().find(|m| m.name == name).unwrap();
    assert_eq!(material("red").reflectance, [0.8, 0.1, 0.98]);
    assert!(material("red").double_sided && !material("light").double_sided);
    let pi = std::f64::consts::PI;
    assert_eq!(material("light").exitance, [4.0 * pi, 2.0 * pi, 0.0]);
    // The floor is not convex: its area is that of its outline, on both sides, and not of its hull.
    let of = |body: &str| {
        let body = scene.bodies.iter().position(|b| b.name == body).unwrap();
        scene
            .patches_of(relume_core::scene::BodyId(body as u32))
            .map(|(_, p)| p.area_m2())
            .sum::<f64>()
    };
    assert!((of("floor") - 2.0 * 2.5).abs() < 1e-9, "{}", of("floor"));
    for code in ["texture", "material-undefined", "units"] {
        assert_eq!(with_code(&scene.notes, code).len(), 1, "{code}");
    }
    std::fs::remove_file(folder.path().join("room.mtl")).unwrap();
    let scene = read(&path).unwrap();
    let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["light", "nothing", "red"], "names without a file");
    assert!(scene.materials.iter().all(|m| m.reflectance == [0.5; 3]));
    assert_eq!(with_code(&scene.notes, "material-file")[0].subject, "room.mtl");
}

/// A square of 2 m whose texture coordinates show the image once, and its material.
const SQUARE: &str =
    "mtllib a.mtl\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\n";

/// A file of the square's faces and its material, beside an image of 2 x 2 texels.
fn painted(faces: &str, material: &str, texels: &[[u8; 4]; 4]) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    let image = image::RgbaImage::from_raw(2, 2, texels.concat()).unwrap();
    for (name, format) in [
        ("maps/wood.png", image::ImageFormat::Png),
        ("wood.tga", image::ImageFormat::Tga),
        ("wood.bmp", image::ImageFormat::Bmp),
    ] {
        image.save_with_format(folder.path().join(name), format).unwrap();
    }
    std::fs::write(folder.path().join("a.mtl"), format!("newmtl m\n{material}\n")).unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, format!("{SQUARE}{faces}\n")).unwrap();
    import(&path, &ImportOptions { pictures: true, ..ImportOptions::default() }).unwrap()
}

/// As relative to the file that names them, and by their names alone.
#[test]
fn images_are_found_from_files_of_materials_in_other_folders() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("m/maps")).unwrap();
    let image = image::RgbaImage::from_pixel(2, 2, image::Rgba([255, 0, 0, 255]));
    image.save(folder.path().join("m/maps/red.png")).unwrap();
    image.save(folder.path().join("m/plain.png")).unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, format!("{SQUARE}f 1/1 2/2 3/3 4/4\n").replace("a.mtl", "m/a.mtl"))
        .unwrap();
    for name in ["maps/red.png", "C:\\work\\plain.png"] {
        let material = format!("newmtl m\nKd 0.5 0.5 0.5\nmap_Kd {name}\n");
        std::fs::write(folder.path().join("m/a.mtl"), material).unwrap();
        let scene = read(&path).unwrap();
        assert!(
            with_code(&scene.notes, "texture").iter().all(|n| n.severity == Severity::Info),
            "{name}: {:?}",
            scene.notes
        );
        assert_eq!(scene.reflectance(&scene.patches[0]), [0.5, 0.0, 0.0], "{name}");
    }
}

/// What the side of a patch reflects and emits that looks at a place above it.
fn seen_at(scene: &Scene, x: f64, y: f64) -> Option<([f64; 3], [f64; 3])> {
    let is_at = |p: &&relume_core::scene::Patch| {
        let corners: Vec<_> = p.corners_in_body().collect();
        let within = |a: f64, of: &dyn Fn(&glam::DVec3) -> f64| {
            let all = corners.iter().map(of);
            all.clone().fold(f64::MAX, f64::min) <= a && a <= all.fold(f64::MIN, f64::max)
        };
        p.frame.normal.z > 0.0 && within(x, &|p| p.x) && within(y, &|p| p.y)
    };
    let patch = scene.patches.iter().find(is_at)?;
    Some((scene.reflectance(patch), scene.exitance_at(patch, 0.0)))
}

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];
const FACE: &str = "f 1/1 2/2 3/3 4/4";
/// Two halves of it, left and right, that look up the texels at the lower left and the upper right.
const HALVES: &str =
    "v 1 0 0\nv 1 2 0\nvt 0.25 0.25\nvt 0.75 0.75\nf 1/5 5/5 6/5 4/5\nf 5/6 2/6 3/6 6/6";

#[test]
fn images_of_obj_count_part_by_part_from_the_lower_left() {
    // Rows from the top: the lower left texel is red, the upper right one green.
    let texels = [BLACK, [0, 255, 0, 255], [255, 0, 0, 255], BLACK];
    for name in ["maps/wood.png", "-blendu on maps\\\\wood.png", "wood.tga", "wood.bmp"] {
        let name = name.replace("\\\\", "\\");
        let scene = painted(HALVES, &format!("Kd 0.5 0.5 0.5\nmap_Kd {name}"), &texels);
        let colour = |x: f64| seen_at(&scene, x, 1.0).unwrap().0;
        assert_eq!((colour(0.5), colour(1.5)), ([0.5, 0.0, 0.0], [0.0, 0.5, 0.0]), "{name}");
    }
    // Where the path is another machine's, the file of that name beside the scene counts.
    let scene = painted(HALVES, "map_Kd C:\\project\\wood.tga", &texels);
    assert_eq!(seen_at(&scene, 0.5, 1.0).unwrap().0, [0.98, 0.0, 0.0]);
    // The mean over the whole, and the image in pictures.
    let scene = painted(FACE, "Kd 1 1 1\nmap_Kd maps/wood.png", &texels);
    let [r, g, b] = seen_at(&scene, 1.0, 1.0).unwrap().0;
    assert!((r - 0.25).abs() < 1e-6 && (g - 0.25).abs() < 1e-6 && b == 0.0, "{r} {g} {b}");
    assert!(scene.patches.iter().all(|p| p.print.is_some()));
    let scene = painted(FACE, "Kd 0.3 0.3 0.3\nmap_Kd ../wood.png", &texels);
    assert_eq!(seen_at(&scene, 1.0, 1.0).unwrap().0, [0.3; 3]);
    assert!(with_code(&scene.notes, "texture")[0].message.contains("cannot be read"));
}

#[test]
fn what_an_image_of_obj_emits_is_its_integral() {
    let scene = painted(FACE, "Ke 3 3 3\nmap_Ke maps/wood.png", &[WHITE, BLACK, BLACK, BLACK]);
    let flux: f64 = scene.patches.iter().map(|p| scene.exitance_at(p, 0.0)[0] * p.area_m2()).sum();
    assert!(
        (flux / (3.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3,
        "{flux} of a quarter of 4 m2"
    );
    assert!(scene.patches.iter().all(|p| p.twin.is_none()));
}

#[test]
fn where_the_dissolve_of_obj_is_low_light_passes() {
    // The right half of the image is not there; of the file of its own the brightness counts.
    let clear = [255, 255, 255, 0];
    let scene =
        painted(FACE, "Kd 1 1 1\nmap_Kd wood.tga\nmap_d wood.tga", &[WHITE, clear, WHITE, clear]);
    assert!(seen_at(&scene, 0.5, 1.0).is_some() && seen_at(&scene, 1.5, 1.0).is_none());
    let scene = painted(FACE, "Kd 0.4 0.4 0.4\nmap_d maps/wood.png", &[BLACK, WHITE, BLACK, WHITE]);
    assert!(seen_at(&scene, 0.5, 1.0).is_none() && seen_at(&scene, 1.5, 1.0).is_some());
}

#[test]
fn what_exporters_leave_out_of_obj_does_not_refuse_it() {
    // A keyword without a value, and a material without a name.
    let scene = painted(&format!("usemtl\n{FACE}"), "map_Kd\nillum\nKd 0.3 0.3 0.3", &[WHITE; 4]);
    assert_eq!(scene.materials[1].name, "(unnamed)");
    assert_eq!(seen_at(&scene, 1.0, 1.0).unwrap().0, [0.5; 3]);
    let text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nusemtl brick\nf 1 2 3\n";
    let scene = scene_of("a.obj", text.as_bytes()).unwrap();
    assert_eq!(scene.materials[0].name, "brick");
    assert!(with_code(&scene.notes, "material-undefined")[0].message.contains("brick"));
}

#[test]
fn colours_of_vertices_in_obj_and_ply_are_reflectances() {
    let grey = ((188.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    let obj = "v 0 0 0 1 0 0\nv 2 0 0 1 0 0\nv 2 2 0 1 0 0\nf 1 2 3\n";
    let scene = scene_of("a.obj", obj.as_bytes()).unwrap();
    assert_eq!(scene.reflectance(&scene.patches[0]), [0.98, 0.0, 0.0]);
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0 188 0 0\n2 0 0 188 0 0\n2 2 0 188 0 0\n3 0 1 2\n";
    let scene = scene_of("a.ply", ply.as_bytes()).unwrap();
    let found = scene.reflectance(&scene.patches[0]);
    assert!((found[0] - grey).abs() < 1e-9 && found[1] == 0.0, "{found:?}");
    assert!(with_code(&scene.notes, "no-material").is_empty());
}

#[test]
fn names_of_material_files_are_read_as_other_systems_write_them() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("a b")).unwrap();
    let path = folder.path().join("room.obj");
    std::fs::write(folder.path().join("a b/room.mtl"), MTL).unwrap();
    std::fs::write(folder.path().join("more.mtl"), "newmtl nothing\nKd 0.2 0.2 0.2\n").unwrap();
    let of = |line: &str| {
        std::fs::write(&path, OBJ.replace("mtllib room.mtl", line)).unwrap();
        let scene = read(&path).unwrap();
        let reflects =
            |name: &str| scene.materials.iter().find(|m| m.name == name).map(|m| m.reflectance[0]);
        (reflects("red"), reflects("nothing"), with_code(&scene.notes, "material-file").len())
    };
    // Backslashes, a name with a space, two names, one of them with a space, and one of them missing.
    assert_eq!(of("mtllib a b\\room.mtl"), (Some(0.8), Some(0.5), 0));
    assert_eq!(of("mtllib a b/room.mtl"), (Some(0.8), Some(0.5), 0));
    assert_eq!(of("mtllib a\\ b/room.mtl more.mtl"), (Some(0.8), Some(0.2), 0));
    assert_eq!(of("mtllib none.mtl more.mtl"), (Some(0.5), Some(0.2), 1));
}

#[test]
fn text_of_two_bytes_a_character_is_read() {
    let wide = |text: &str, of: fn(u16) -> [u8; 2]| {
        let units = std::iter::once(0xFEFF).chain(text.encode_utf16());
        units.flat_map(of).collect::<Vec<u8>>()
    };
    for of in [u16::to_be_bytes, u16::to_le_bytes] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.obj");
        std::fs::write(&path, wide(OBJ, of)).unwrap();
        std::fs::write(folder.path().join("room.mtl"), wide(MTL, of)).unwrap();
        let scene = read(&path).unwrap();
        assert_eq!(scene.bodies.len(), 3);
        let red = scene.materials.iter().find(|m| m.name == "red").unwrap();
        assert_eq!(red.reflectance, [0.8, 0.1, 0.98]);
    }
}

#[test]
fn files_of_materials_elsewhere_are_opened_only_if_asked_for() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("scene");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(parent.path().join("room.mtl"), MTL).unwrap();
    let path = folder.join("room.obj");
    std::fs::write(&path, OBJ.replace("room.mtl", "../room.mtl")).unwrap();
    let error = read(&path).unwrap_err();
    assert!(matches!(error, SceneError::Outside { .. }), "{error}");
    let options = ImportOptions { allow_outside: true, ..ImportOptions::default() };
    assert_eq!(import(&path, &options).unwrap().materials[0].reflectance[0], 0.8);
}

#[test]
fn what_is_wrong_with_them_is_said() {
    let said = |name: &str, content: &[u8]| scene_of(name, content).unwrap_err().to_string();
    let cut = |bytes: &[u8]| bytes[..bytes.len() - 30].to_vec();
    let many = String::from_utf8(ply("ascii")).unwrap();
    let points_alone =
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nend_header\n0 0 0\n"
            .to_vec();
    for (name, content, words) in [
        ("a.obj", b"v 1 2 x\n".to_vec(), "is not a valid OBJ file"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n".to_vec(), "is not a valid OBJ file"),
        (
            "a.obj",
            b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n".to_vec(),
            "line 3: the coordinate `nan`",
        ),
        ("a.obj", b"v 0 0 0\n".to_vec(), "points or lines alone"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\n".to_vec(), "points or lines alone"),
        ("a.ply", points_alone, "points or lines alone"),
        ("a.obj", Vec::new(), "no polygon"),
        ("a.stl", Vec::new(), "is not a valid STL file"),
        ("a.stl", cut(&stl_binary(b"")), "is not a valid STL file"),
        ("a.stl", cut(stl_text().as_bytes()), "is not a valid STL file"),
        ("a.ply", Vec::new(), "is not a valid PLY file"),
        ("a.ply", cut(&ply("binary_little_endian")), "is not a valid PLY file"),
        (
            "a.ply",
            many.replace("vertex 24", "vertex 99999999999").into_bytes(),
            "more than it has bytes",
        ),
        ("a.ply", many.replace("4 0 1 2 3", "4 0 1 2 24").into_bytes(), "face 0 has a corner"),
        ("a.ply", many.replace("4 0 1 2 3", "4 0 1 2 -1").into_bytes(), "face 0 has a corner"),
    ] {
        let message = said(name, &content);
        assert!(message.contains(words), "{name}: {message}");
    }
    let animation = ImportOptions { animation: Some("walk".into()), ..ImportOptions::default() };
    let message = import(Path::new("a.ply"), &animation).unwrap_err().to_string();
    assert!(message.contains("files of PLY have no animation"), "{message}");
    let limited = ImportOptions { max_memory_bytes: Some(100), ..ImportOptions::default() };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.stl"), stl_text()).unwrap();
    let error = import(folder.path().join("a.stl"), &limited).unwrap_err();
    assert!(matches!(error, SceneError::TooLarge { .. }), "{error}");
}

#[test]
fn damage_anywhere_never_panics() {
    for (name, whole) in [
        ("a.obj", OBJ.as_bytes().to_vec()),
        ("a.stl", stl_binary(b"")),
        ("a.stl", stl_text().into_bytes()),
        ("a.ply", ply("ascii")),
        ("a.ply", ply("binary_big_endian")),
    ] {
        for place in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[place] ^= [1, 0x10, 0x80, 0xff][place % 4];
            // Whatever it says.
            let _ = scene_of(name, &damaged);
        }
    }
}

#[test]
fn damage_to_materials_and_images_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let texels = image::RgbaImage::from_raw(2, 2, [WHITE, BLACK, BLACK, WHITE].concat()).unwrap();
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for name in ["wood.png", "wood.tga", "wood.bmp"] {
        let path = folder.path().join(name);
        texels.save(&path).unwrap();
        files.push((name.to_owned(), std::fs::read(path).unwrap()));
        let text = format!(
            "newmtl m\nKd 0.5 0.5 0.5\nKe 1 1 1\nd 0.9\nmap_Kd -s 2 2 -o 0.5 {name}\nmap_Ke {name}\nmap_d {name}\n"
        );
        std::fs::write(folder.path().join("a.mtl"), &text).unwrap();
        files.push(("a.mtl".to_owned(), text.into_bytes()));
        let path = folder.path().join("a.obj");
        std::fs::write(&path, format!("{SQUARE}{FACE}\n")).unwrap();
        for (name, whole) in files.drain(..) {
            for place in 0..whole.len() {
                let mut damaged = whole.clone();
                damaged[place] ^= [1, 0x10, 0x80, 0xff][place % 4];
                std::fs::write(folder.path().join(&name), &damaged).unwrap();
                // Whatever it says, within bounds.
                let limit = Some(1 << 26);
                let _ =
                    import(&path, &ImportOptions { max_memory_bytes: limit, ..Default::default() });
            }
            std::fs::write(folder.path().join(&name), &whole).unwrap();
        }
    }
}

/// A face that goes round several times, and one that is there twice.
#[test]
fn triangles_that_repeat_others_count_once() {
    let places = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n";
    let round = "f 1 2 3 4 1 2 3 4 1 2 3 4\nf 3 4 1 2\n";
    let scene = scene_of("a.obj", format!("{places}{round}").as_bytes()).unwrap();
    assert_eq!(scene.patches.len(), 2, "a square, from both sides");
    // One that faces the other way is another surface.
    let back = scene_of("a.obj", format!("{places}f 1 2 3 4\nf 4 3 2 1\n").as_bytes()).unwrap();
    assert_eq!(back.patches.len(), 4);
}
