//! `relume flicker`: two closed rooms beside each other, in one of which a lamp moves.

use glam::{DQuat, DVec3};
use relume::export::write_glb;
use relume::scene::{Interpolation, Projection, SceneBuilder, Track};

use crate::common::{relume, text};

#[test]
fn what_light_leaves_alone_does_not_change_and_the_rest_flickers_least_when_cleaned() {
    let mut b = SceneBuilder::new("two rooms");
    let white = b.material("white", [0.6; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [40.0; 3]);
    let at = DVec3::new;
    // The smaller one is left: where most of a scene changes, the solver goes on over all of it.
    for (name, x, size) in [("left", 1.0, 0.5), ("right", 2.1, 1.0)] {
        let room = b.node(name, None, at(x, 0.0, 0.0), DQuat::IDENTITY);
        b.scale(room, DVec3::splat(size));
        b.cuboid_inward(room, "walls", white, at(0.0, 0.0, -2.0), at(2.0, 2.0, 0.0));
        b.cuboid(room, "block", white, at(0.7, 0.001, -1.5), at(1.2, 0.6, -1.0));
        let place = at(x + 0.6 * size, 1.7 * size, -0.8 * size);
        let lamp = b.node(&format!("{name} lamp"), None, place, DQuat::IDENTITY);
        let (far, wide) = (-0.3 * size, 0.3 * size);
        let corners = [at(0.0, 0.0, far), at(wide, 0.0, far), at(wide, 0.0, 0.0), DVec3::ZERO];
        b.polygon(lamp, "lamp", glow, &corners);
        if name == "left" {
            let values = vec![place, place + at(0.15, 0.0, 0.0)];
            let track =
                Track { times_s: vec![0.0, 0.125], values, interpolation: Interpolation::Linear };
            b.animate_translation(lamp, track);
        }
    }
    let eye = b.node("camera", None, at(2.05, 1.0, 3.0), DQuat::IDENTITY);
    b.camera("camera", eye, Projection::Perspective { yfov: 0.7, aspect: None });
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("two rooms.glb");
    write_glb(&b.build().unwrap(), &scene).unwrap();
    let run = relume(&[
        "flicker",
        text(&scene),
        "--tolerance",
        "0.2",
        "--reference",
        "0.08",
        "--size",
        "80x40",
    ]);
    run.says(&["two rooms, frames 0-3: 3 changes"]);
    let number = |before: &str, after: &str| -> f64 {
        let rest = run.out.split(before).nth(1).expect(before);
        rest.split(after).next().unwrap().trim().parse().expect(before)
    };
    let kept = number("light is kept: ", " %");
    assert!(kept > 30.0 && kept < 70.0, "{}", run.out);
    let off = ["gouraud", "smooth", "cleaned"].map(|way| {
        assert_eq!(number(&format!("\n{way}"), " W/m2/sr"), 0.0, "{}", run.out);
        let line = run.out.split(&format!("\n{way}")).nth(1).unwrap();
        let rest = line.split("W/m2/sr").nth(1).unwrap();
        rest.split('%').next().unwrap().trim().parse::<f64>().unwrap()
    });
    assert!(off[0] > 0.5 && off[2] < 0.6 * off[0] && off[2] <= off[1], "{}", run.out);
    relume(&["flicker", text(&scene), "--frames", "1"]).fails(2, &["one frame does not flicker"]);
}
