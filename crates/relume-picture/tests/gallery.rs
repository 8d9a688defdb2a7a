//! Pictures to be looked at: `cargo test -p relume-picture --test tests gallery:: -- --ignored --nocapture`.

use std::time::Instant;

use crate::common::*;
use relume_picture::picture::{Exposure, Settings, Shading, View, render};

#[test]
#[ignore = "makes pictures for a person to look at"]
fn gallery() {
    let directory = std::env::temp_dir().join("relume-gallery");
    std::fs::create_dir_all(&directory).unwrap();
    let block = (v(1.0, 0.0, 1.2), v(2.0, 1.2, 2.2));
    let rooms = [
        ("closed", vec![]),
        ("no-front", vec![Side::Front]),
        ("corridor", vec![Side::Front, Side::Ceiling]),
        ("no-ceiling", vec![Side::Ceiling]),
        ("object", SIDES.to_vec()),
    ];
    for (name, without) in rooms {
        let mut scene = room(&without);
        let white = scene.patches.last().map(|_| relume_core::scene::MaterialId(0)).unwrap();
        solid(&mut scene, block.0, block.1, white);
        let snapshot =
            snapshot(&scene, |_, size, level| level < 4 || (level < 6 && size > 0.16), lit(block));
        let start = Instant::now();
        let view = View::automatic(&scene);
        let choose = start.elapsed();
        let exposure = Exposure::automatic(&snapshot, &view);
        let expose = start.elapsed() - choose;
        for (suffix, shading, mesh) in [
            ("flat", Shading::Flat, false),
            ("gouraud", Shading::Gouraud, false),
            ("mesh", Shading::Flat, true),
        ] {
            let settings = Settings { shading, mesh, exposure, ..Settings::default() };
            let start = Instant::now();
            let image = render(&snapshot, &view, &settings);
            let drawn = start.elapsed();
            let path = directory.join(format!("{name}-{suffix}.png"));
            image.write_png(&path).unwrap();
            println!(
                "{}: {} leaves, view {choose:.1?}, exposure {expose:.1?}, drawn {drawn:.1?}, written {:.1?}",
                path.display(),
                snapshot.leaves.len(),
                start.elapsed() - drawn
            );
        }
    }
}
