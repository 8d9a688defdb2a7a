//! Pictures of scenes lit from outside: the sky is seen where no surface is, and is no part of the scene.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use relume_core::scene::outside::{Outside, Sky, Sun, SunPlace};
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::{Options, Session};
use relume_picture::picture::{Exposure, Image, Settings, Tone, View, render};

fn block() -> Scene {
    let mut b = SceneBuilder::new("block");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let node = b.node("block", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(node, "block", grey, DVec3::splat(-0.5), DVec3::splat(0.5));
    b.build().unwrap()
}

/// What is seen of the block from the south, 64 x 48 pixels, at exposure 1 without a tone curve.
fn seen(outside: Outside) -> Image {
    let scene = Arc::new(block().with_outside(outside).unwrap());
    let options = Options { tolerance: 0.2, ..Options::default() };
    let mut session = Session::new(scene, options).unwrap();
    session.step(0, 0.0).unwrap();
    let view = View::look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 1.0);
    let settings = Settings {
        width: 64,
        height: 48,
        exposure: Exposure::Fixed(1.0),
        tone: Tone::Clip,
        ..Settings::default()
    };
    render(&session.frame().unwrap().solution(), &view, &settings)
}

fn at(image: &Image, x: usize, y: usize) -> [u8; 3] {
    image.pixels[y * image.width as usize + x]
}

#[test]
fn the_sky_is_above_the_horizon_and_the_ground_below() {
    let sky = Some(Sky::Uniform([0.1, 0.4, 0.9]));
    let picture = seen(Outside { sky, ground: 0.5, fineness: 0.2, ..Outside::default() });
    let encoded = |radiance: f64| {
        let srgb = 1.055 * radiance.powf(1.0 / 2.4) - 0.055;
        (255.0 * srgb).round() as u8
    };
    assert_eq!(at(&picture, 3, 3), [0.1, 0.4, 0.9].map(encoded));
    assert_eq!(at(&picture, 3, 44), [0.05, 0.2, 0.45].map(encoded));
    // The block hides both, and is lit by both.
    let middle = at(&picture, 32, 24);
    assert!(middle[0] > 20 && middle[2] < at(&picture, 3, 3)[2], "{middle:?}");
}

#[test]
fn the_sun_is_seen_where_it_is() {
    // Ahead and to the right: the camera looks north.
    let place = SunPlace::Direction { azimuth: 20.0, elevation: 15.0 };
    let sun = Some(Sun { place, irradiance: Some([1.0; 3]), diameter_deg: 6.0 });
    let picture = seen(Outside { sun, fineness: 0.2, ..Outside::default() });
    let pixels = (0..64 * 48).filter(|k| at(&picture, k % 64, k / 64) == [255; 3]);
    let (xs, ys): (Vec<usize>, Vec<usize>) = pixels.map(|k| (k % 64, k / 64)).unzip();
    assert!(xs.len() > 10, "{}", xs.len());
    let middle = |v: &[usize]| v.iter().sum::<usize>() as f64 / v.len() as f64 + 0.5;
    // 24 / tan(0.5 rad) pixels a unit of slope.
    let scale = 24.0 / 0.5_f64.tan();
    let (azimuth, elevation) = (20_f64.to_radians(), 15_f64.to_radians());
    let exact = (32.0 + scale * azimuth.tan(), 24.0 - scale * elevation.tan() / azimuth.cos());
    assert!((middle(&xs) - exact.0).abs() < 1.0 && (middle(&ys) - exact.1).abs() < 1.0);
}

#[test]
fn the_overview_is_of_the_scene_and_not_of_the_sky() {
    let sky = Some(Sky::Uniform([1.0; 3]));
    let lit = block().with_outside(Outside { sky, fineness: 0.2, ..Outside::default() }).unwrap();
    assert_eq!(View::automatic(&lit), View::automatic(&block()));
}
