use super::*;

/// A unit cube seen from inside, by vertices.
const CUBE: &str = "T a cube
C encl=1 list=3 eps = 1.e-4
F 3
! vertices
V 1 0. 0. 0.
V 2 1. 0. 0.
V 3 1. 1. 0.
V 4 0. 1. 0.
V 5 0. 0. 1.
V 6 1. 0. 1.
V 7 1. 1. 1.
V 8 0. 1. 1. ! the last
S 1 1 2 3 4 0 0 0.50 floor
S 2 1 4 8 5 0 0 0.90 wall
S 3 1 5 6 2 0 0 0.90 wall
S 4 7 6 5 8 0 0 0.50
S 5 7 3 2 6 0 2 0.50 ignored
S 6 7 8 4 3 0 0 1.00 black
";

fn read(text: &str) -> Scene {
    scene("case", text, &ImportOptions::default()).unwrap()
}

fn names(scene: &Scene) -> Vec<&str> {
    scene.surfaces.iter().map(|s| s.name.as_str()).collect()
}

fn area(scene: &Scene, surface: usize) -> f64 {
    let own = scene.patches.iter().filter(|p| p.surface.0 as usize == surface);
    own.map(|p| p.area_m2()).sum()
}

#[test]
fn surfaces_keep_order_and_names_and_reflect_what_they_do_not_emit() {
    let scene = read(CUBE);
    assert_eq!(names(&scene), ["floor", "wall", "wall 2", "surface 4", "black"]);
    assert_eq!((scene.bodies.len(), scene.patches.len()), (1, 6));
    let rho = |k: usize| scene.materials[scene.surfaces[k].material.0 as usize].reflectance[0];
    assert!((rho(0) - 0.5).abs() < 1e-12 && (rho(1) - 0.1).abs() < 1e-12);
    assert!((rho(4) - 0.001).abs() < 1e-12, "1 becomes 0.999");
    // The fifth is part of the second.
    assert!((area(&scene, 1) - 2.0).abs() < 1e-12);
    let codes: Vec<&str> = scene.notes.iter().map(|n| n.code).collect();
    for code in ["emittance", "view3d-enclosure", "view3d-control", "title", "renamed"] {
        assert!(codes.contains(&code), "{code} is missing in {codes:?}");
    }
    // Fronts face inwards.
    let inward = |p: &relume_core::scene::Patch| {
        (DVec3::splat(0.5) - p.frame.origin).dot(p.frame.normal) > 0.0
    };
    assert!(scene.patches.iter().all(inward));
}

#[test]
fn the_end_ends_it_and_obstructions_are_no_surfaces_of_tables() {
    let more = "V 9 .2 .2 .5\nV 10 .8 .2 .5\nV 11 .5 .8 .5\nO 7 9 10 11 0\nEnd of data\nS what\n";
    let scene = read(&format!("{CUBE}{more}"));
    assert_eq!(scene.surfaces[5].name, "obstruction 7");
    assert_eq!(scene.obstructions.iter().map(|s| s.0).collect::<Vec<_>>(), [5]);
    assert_eq!(scene.patches[6].corners.len(), 3);
}

#[test]
fn planes_are_the_same_as_vertices() {
    // A floor from above, a wall at x = 0 that faces +x (azimuth 90), a triangle in the ceiling.
    let scene = read(
        "F 3a\nS 1 R 0 0 0.5 floor\n 1. 0. 0.  0. 0. 2. 3.\nS 2 R 0 0 0.5 wall\n0 0 0 90 90\n3 1\n\
         S 3 t 0 0 0.5 top\n0 0 1 0 180\n0 0 1 0 0 1\n",
    );
    let normal = |k: usize| scene.patches[k].frame.normal;
    assert!(normal(0).abs_diff_eq(DVec3::Z, 1e-12), "{}", normal(0));
    assert!(normal(1).abs_diff_eq(DVec3::X, 1e-12), "{}", normal(1));
    assert!(normal(2).abs_diff_eq(DVec3::NEG_Z, 1e-12), "{}", normal(2));
    assert!((area(&scene, 0) - 6.0).abs() < 1e-12 && (area(&scene, 1) - 3.0).abs() < 1e-12);
    assert!((area(&scene, 2) - 0.5).abs() < 1e-12);
    let low = scene.patches[0].corners_in_body().fold(DVec3::INFINITY, DVec3::min);
    assert!(low.abs_diff_eq(DVec3::new(-1.0, -3.0, 0.0), 1e-12), "{low}");
}

#[test]
fn parts_are_cut_out_of_their_base() {
    // A window, and a hole that faces the other way, in the floor.
    let window = "V 9 .2 .2 0\nV 10 .5 .2 0\nV 11 .5 .6 0\nV 12 .2 .6 0\nV 13 .7 .7 0\nV 14 .9 .7 0\nV 15 .9 .9 0\n";
    let more = "S 7 9 10 11 12 1 0 0.8 window\nN 8 13 15 14 0 1 0 0.5 hole\n";
    let scene = read(&format!("{CUBE}{window}{more}"));
    assert!((area(&scene, 0) - (1.0 - 0.12 - 0.02)).abs() < 1e-9, "{}", area(&scene, 0));
    assert_eq!(names(&scene)[5..], ["window"]);
    assert!((area(&scene, 5) - 0.12).abs() < 1e-12);
    // No two pieces overlap: a point in the window is in none of the floor's.
    let holds = |p: &relume_core::scene::Patch, at: DVec3| {
        let c: Vec<DVec3> = p.corners_in_body().collect();
        (0..c.len()).all(|k| (c[(k + 1) % c.len()] - c[k]).cross(at - c[k]).z > 0.0)
    };
    let floor =
        |at: DVec3| scene.patches.iter().filter(|p| p.surface.0 == 0 && holds(p, at)).count();
    for (at, count) in [((0.3, 0.4), 0), ((0.1, 0.45), 1), ((0.61, 0.31), 1), ((0.85, 0.75), 0)] {
        assert_eq!(floor(DVec3::new(at.0, at.1, 0.0)), count, "{at:?}");
    }
}

#[test]
fn what_is_wrong_is_said_with_its_line() {
    let replaced = |from: &str, to: &str| CUBE.replace(from, to);
    for (text, line, what) in [
        (String::new(), 0, "no surface"),
        (replaced("F 3\n", "F 2\n"), 3, "geometry `2`"),
        (replaced("V 2 1.", "V 3 1."), 6, "vertex 3 comes after vertex 1"),
        (replaced("V 2 1. 0. 0.", "V 2 1. 0."), 6, "three coordinates"),
        (replaced("V 2 1.", "V 2 one"), 6, "`one` is not a number"),
        (replaced("V 2 1.", "V 2 nan"), 6, "`nan` is not a number"),
        (replaced("S 1 1 2 3 4", "S 1 1 2 3 9"), 13, "refers to vertex 9"),
        (replaced("S 1 1 2 3 4", "S 1 1 2 3"), 13, "the combined surface is `0.50`"),
        (replaced("S 1 1 2 3 4", "S 1 1 2 1 2"), 13, "no area"),
        (replaced("S 1 1 2 3 4", "S 1 1 2 3 8"), 13, "not in one plane"),
        (replaced("V 3 1. 1. 0.", "V 3 .2 .2 0."), 13, "not convex"),
        (replaced("S 1 1 2 3 4", "M 1 1 2 3 4"), 13, "masking surface"),
        (replaced("0 0 0.90 wall", "7 0 0.90 wall"), 14, "refers to surface 7"),
        (replaced("0 0 0.90 wall", "1 0 0.90 wall"), 14, "not in the plane of its base"),
        (replaced("0 2 0.50 ignored", "0 6 0.50 ignored"), 17, "combined with surface 6"),
        (replaced("0 0 0.90 wall", "0 0 1.5 wall"), 14, "the emittance is 1.5"),
        (replaced("S 2 1 4 8 5", "S 7 1 4 8 5"), 14, "surface 7 comes after surface 1"),
        ("F 3a\nS 1 R 0 0 0.5 a\n0 0 0 0 0 1\n".into(), 2, "1 numbers are missing"),
        ("F 3a\nS 1 C 0 0 0.5 a\n0 0 0 0 0 1 1\n".into(), 2, "the shape is `C`"),
    ] {
        match scene("case", &text, &ImportOptions::default()) {
            Err(Refused::Text(wrong)) => {
                let said = format!("{}: {}", wrong.line, wrong.what);
                assert!(
                    wrong.line == line && wrong.what.contains(what),
                    "{said} instead of {what}"
                );
                assert!(!wrong.remedy.is_empty(), "{said}");
            }
            other => panic!("{what}: {:?}", other.map(|s| s.name)),
        }
    }
}
