//! Environments from files: what their pixels become, and what is said of bad ones.

// Tests may use whatever the platform offers.
#![allow(clippy::disallowed_methods)]

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use relume_io::read_environment;

#[test]
fn pictures_are_read_from_both_formats_and_bad_ones_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let mut image = image::Rgb32FImage::from_pixel(64, 32, image::Rgb([0.5, 1.0, 2.0]));
    image.put_pixel(3, 4, image::Rgb([64.0; 3]));
    for name in ["a.hdr", "a.exr"] {
        let path = dir.path().join(name);
        image::DynamicImage::ImageRgb32F(image.clone()).save(&path).unwrap();
        let read = read_environment(&path, None).unwrap();
        assert_eq!(read.size(), (64, 32));
        // The middle of the picture is north, -Z; its right half is east, +X.
        let (across, down) = (TAU * (3.5 / 64.0 - 0.5), PI * 4.5 / 32.0);
        let towards = DVec3::new(down.sin() * across.sin(), down.cos(), -down.sin() * across.cos());
        assert_eq!(read.radiance(towards), [64.0; 3], "{name}");
        assert_eq!(read.radiance(DVec3::Y), [0.5, 1.0, 2.0], "{name}");
        let too_large = read_environment(&path, Some(20_000)).unwrap_err().to_string();
        assert!(too_large.contains(name) && too_large.contains("bytes"), "{too_large}");
        // Cut short.
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 3]).unwrap();
        let damaged = read_environment(&path, None).unwrap_err().to_string();
        assert!(damaged.contains(name), "{damaged}");
    }
    let other = dir.path().join("b.hdr");
    std::fs::write(&other, "no picture").unwrap();
    let error = read_environment(&other, None).unwrap_err().to_string();
    assert!(error.contains("b.hdr") && error.contains(".exr"), "{error}");
    assert!(read_environment(&dir.path().join("none.hdr"), None).is_err());
}
