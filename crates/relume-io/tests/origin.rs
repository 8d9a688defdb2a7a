//! Scenes that were read near the origin and lie far from it are written where their files have them.

use std::sync::Arc;

use glam::DVec3;
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::{Options, Session};
use relume_io::export::{Lit, LitPart, PageView, page, usda, vtp};

const ORIGIN: DVec3 = DVec3::new(431_000.25, 12.0, -5_412_000.5);

/// A lit square metre, a metre below another.
fn scene() -> Scene {
    let mut b = SceneBuilder::new("far");
    let (grey, glow) =
        (b.material("grey", [0.5; 3], [0.0; 3]), b.material("glow", [0.0; 3], [1.0; 3]));
    let body = b.body("both");
    let at = |y: f64| [[0.0, y, 0.0], [0.0, y, 1.0], [1.0, y, 1.0], [1.0, y, 0.0]];
    b.mesh(body, "floor", grey, &at(0.0), &[[0, 1, 2], [0, 2, 3]]);
    b.mesh(body, "lamp", glow, &at(1.0), &[[2, 1, 0], [3, 2, 0]]);
    Scene { origin: ORIGIN, ..b.build().unwrap() }
}

#[test]
fn points_for_vtk_are_where_the_file_has_them() {
    let mut session = Session::new(scene(), Options::default()).unwrap();
    let bytes = vtp(&session.solve().unwrap().solution());
    let xml = String::from_utf8_lossy(&bytes);
    assert!(xml.contains("type=\"Float64\" NumberOfComponents=\"3\" Name=\"points\""), "{xml}");
    // A corner of the floor, to the last digit.
    let corner: Vec<u8> = [0, 1, 2].iter().flat_map(|&c| ORIGIN[c].to_le_bytes()).collect();
    assert!(bytes.windows(24).any(|w| w == corner));
}

#[test]
fn light_that_plays_is_where_the_file_has_it() {
    let scene = Arc::new(scene());
    let part = LitPart {
        surface: scene.patches[0].surface,
        points: vec![[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]],
        triangles: vec![[0, 1, 2]],
        irradiance: vec![vec![[1.0; 3]; 3]],
        exitance: vec![[0.0; 3]],
        reflectance: [0.5; 3],
    };
    let lit = Lit { scene, times_s: vec![0.0], parts: vec![part], exposure: 1.0 };
    let text = usda(&lit, 24.0);
    assert!(
        text.contains("    double3 xformOp:translate = (431000.25, 12, -5412000.5)\n"),
        "{text}"
    );
    let view = PageView { eye: DVec3::ONE, target: DVec3::ZERO, up: DVec3::Y, yfov: 1.0 };
    assert!(page(&lit, view, 0.0).unwrap().contains("\"origin\":[431000.25,12.0,-5412000.5]"));
}
