//! Numbers, elements and bodies as a view sees them.

use glam::DMat3;
use relume_core::geometry::Pose;
use relume_core::scene::Projection;
use relume_picture::picture::{
    Settings, Shading, View, bodies, colour_of_body, layers, mesh, numbers_of, numbers_of_leaves,
};

use crate::common::*;

/// Straight at the back wall of the room, which fills the picture.
fn view() -> View {
    View {
        world_from_camera: Pose { rotation: DMat3::IDENTITY, translation: v(2.0, 1.5, 4.0) },
        projection: Projection::Orthographic { xmag: 1.0, ymag: 0.75 },
    }
}

fn settings() -> Settings {
    Settings { width: 40, height: 30, shading: Shading::Flat, ..Settings::default() }
}

#[test]
fn each_pixel_has_the_number_of_the_leaf_that_it_sees() {
    let snapshot = snapshot(&room(&[]), |_, _, level| level < 3, |_, _, _| [0.0; 3]);
    let numbers: Vec<f32> = (0..snapshot.leaves.len()).map(|k| k as f32).collect();
    let seen = numbers_of_leaves(&snapshot, &view(), &settings(), &numbers);
    for (k, value) in seen.values.iter().enumerate() {
        let (x, y) = ((k % 40) as f64 + 0.5, (k / 40) as f64 + 0.5);
        let at = v(2.0 + (x - 20.0) / 20.0, 1.5 - (y - 15.0) / 20.0, 0.0);
        let index = value.unwrap() as usize;
        let patch = snapshot.leaf_offsets.partition_point(|&first| first as usize <= index) - 1;
        let frame = &snapshot.scene.patches[patch].frame;
        let corners = snapshot.leaves[index].corners.map(|c| frame.point(c));
        let low = corners.iter().fold(corners[0], |l, &c| l.min(c)) - 1e-9;
        let high = corners.iter().fold(corners[0], |h, &c| h.max(c)) + 1e-9;
        assert!(low.cmple(at).all() && at.cmple(high).all(), "{at}: {low} {high}");
    }
}

#[test]
fn outlines_are_dark_and_bodies_have_their_colours() {
    let snapshot = snapshot(&room(&[]), |_, _, level| level < 3, |_, _, _| [0.0; 3]);
    let outlines = mesh(&snapshot, &view(), &settings());
    let dark = outlines.pixels.iter().filter(|p| p[0] < 200).count();
    assert!(dark > 100 && dark < 900, "{dark}");
    let layers = layers(&snapshot, &view(), &settings());
    let depth = numbers_of(&layers, |seen| seen.depth_m);
    assert!(depth.values.iter().all(|d| (d.unwrap() - 4.0).abs() < 1e-5));
    // The wall faces the view, so that its colour is the body's own.
    let body = layers.pixels[0].body;
    assert!(
        bodies(&snapshot, &view(), &settings()).pixels.iter().all(|&p| p == colour_of_body(body))
    );
    let differ = |a: u32, b: u32| {
        let pairs = colour_of_body(a).into_iter().zip(colour_of_body(b));
        pairs.map(|(a, b)| u32::from(a.abs_diff(b))).sum::<u32>()
    };
    assert!((1..20).all(|k| differ(k, k + 1) > 60));
}
