//! Each finding on a scene that has it, and none on one that is sound.

use glam::{DQuat, DVec3};

use super::*;
use crate::scene::{LightKind, NodeId, SceneBuilder};

const O: DVec3 = DVec3::ZERO;
const I: DVec3 = DVec3::ONE;

/// A room with a lamp below the ceiling and a box on the floor; `change` may spoil it.
fn notes(change: impl FnOnce(&mut SceneBuilder, NodeId, MaterialId)) -> Vec<Note> {
    let mut b = SceneBuilder::new("s");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [10.0; 3]);
    let room = b.node("room", None, O, DQuat::IDENTITY);
    b.cuboid_inward(room, "walls", grey, O, I);
    let lamp = b.node("lamp", None, DVec3::new(0.0, 0.9, 0.0), DQuat::IDENTITY);
    b.polygon(
        lamp,
        "lamp",
        glow,
        &[0.4, 0.6, 0.6, 0.4]
            .into_iter()
            .zip([0.4, 0.4, 0.6, 0.6])
            .map(|(x, z)| DVec3::new(x, 0.0, z))
            .collect::<Vec<_>>(),
    );
    let crate_ = b.node("crate", None, O, DQuat::IDENTITY);
    b.cuboid(crate_, "crate", grey, I * 0.1, I * 0.3);
    change(&mut b, room, grey);
    check(&b.build().unwrap())
}

fn found(notes: &[Note], code: &str) -> Vec<(Severity, String, usize)> {
    notes
        .iter()
        .filter(|n| n.code == code)
        .map(|n| (n.severity, n.subject.clone(), n.count))
        .collect()
}

#[test]
fn a_polygon_that_is_not_quite_flat_is_named() {
    let bent = |lift: f64| {
        notes(|b, _, grey| {
            let node = b.node("sheet", None, DVec3::splat(0.6), DQuat::IDENTITY);
            let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) * 0.2;
            b.polygon(node, "sheet", grey, &[at(0., 0., 0.), at(1., 0., 0.), at(1., 1., lift)]);
            b.polygon(node, "sheet", grey, &[at(0., 0., 0.), at(1., 1., lift), at(0., 1., 0.)]);
        })
    };
    let expected = vec![(Severity::Info, "sheet".to_owned(), 1)];
    assert_eq!(found(&bent(0.003), "non-planar"), expected);
    assert_eq!(found(&bent(0.0), "non-planar"), []);
    assert_eq!(found(&bent(0.2), "non-planar"), []);
}

#[test]
fn a_sound_room_has_no_findings() {
    assert_eq!(notes(|_, _, _| ()), []);
}

#[test]
fn a_wall_of_other_pieces_still_closes_the_room() {
    // Four walls and a floor whose neighbours are cut differently (T-junctions), in two objects
    // with a placement that rounds.
    let mut b = SceneBuilder::new("s");
    let glow = b.material("glow", [0.5; 3], [1.0; 3]);
    let turn = DQuat::from_xyzw(0.1, 0.2, 0.3, 1.0).normalize();
    let low = b.node("low", None, O, turn);
    let high = b.node("high", None, turn * DVec3::new(0.0, 1.0 / 3.0, 0.0), turn);
    let lift = DVec3::new(0.0, 1.0 / 3.0, 0.0);
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    for (a, c) in [(0.0, 0.3), (0.3, 1.0)] {
        b.polygon(low, "floor", glow, &[p(0., 0., a), p(0., 0., c), p(1., 0., c), p(1., 0., a)]);
        b.polygon(
            high,
            "ceiling",
            glow,
            &[p(a, 1., 0.) - lift, p(c, 1., 0.) - lift, p(c, 1., 1.) - lift, p(a, 1., 1.) - lift],
        );
    }
    b.polygon(low, "back", glow, &[p(0., 0., 0.), p(1., 0., 0.), p(1., 1., 0.), p(0., 1., 0.)]);
    b.polygon(
        high,
        "front",
        glow,
        &[p(1., 0., 1.), p(0., 0., 1.), p(0., 1., 1.), p(1., 1., 1.)].map(|q| q - lift),
    );
    b.polygon(low, "left", glow, &[p(0., 0., 1.), p(0., 0., 0.), p(0., 1., 0.), p(0., 1., 1.)]);
    b.polygon(low, "right", glow, &[p(1., 0., 0.), p(1., 0., 1.), p(1., 1., 1.), p(1., 1., 0.)]);
    let scene = b.build().unwrap();
    assert_eq!(check(&scene), []);
}

#[test]
fn nothing_emits() {
    let mut b = SceneBuilder::new("dark");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    b.material("unused glow", [0.5; 3], [1.0; 3]);
    let n = b.node("n", None, O, DQuat::IDENTITY);
    b.cuboid(n, "box", grey, O, I);
    assert_eq!(
        found(&check(&b.build().unwrap()), "nothing-emits"),
        [(Severity::Error, "dark".into(), 0)]
    );
}

#[test]
fn an_open_room_is_named_with_its_free_sides() {
    let mut b = SceneBuilder::new("s");
    let m = b.material("m", [0.5; 3], [1.0; 3]);
    let room = b.node("room", None, O, DQuat::IDENTITY);
    let all = super::super::builder::cuboid_sides(O, I);
    for side in &all[..5] {
        let mut side = *side;
        side.reverse();
        b.polygon(room, "walls", m, &side);
    }
    assert_eq!(
        found(&check(&b.build().unwrap()), "open-enclosure"),
        [(Severity::Warning, "room".into(), 4)]
    );
}

#[test]
fn sheets_that_stand_in_a_closed_room_are_no_gaps() {
    let found_with = |without: usize| {
        let mut b = SceneBuilder::new("s");
        let m = b.material("m", [0.5; 3], [1.0; 3]);
        let sheet = b.double_sided_material("sheet", [0.5; 3], [0.0; 3]);
        let room = b.node("room", None, O, DQuat::IDENTITY);
        for side in super::super::builder::cuboid_sides(O, I).iter().take(6 - without) {
            let mut side = *side;
            side.reverse();
            b.polygon(room, "walls", if without > 0 { sheet } else { m }, &side);
        }
        // From corner to corner of the room, with free sides on floor and ceiling, and another that stands on it.
        let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let diagonal = [at(0., 0., 0.), at(1., 1., 0.), at(1., 1., 1.), at(0., 0., 1.)];
        b.polygon(room, "partition", sheet, &diagonal);
        let shelf = [at(0., 0., 0.), at(0., 0., 1.), at(0.3, 0.6, 1.), at(0.3, 0.6, 0.)];
        b.polygon(room, "partition", sheet, &shelf);
        found(&check(&b.build().unwrap()), "open-enclosure")
    };
    assert_eq!(found_with(0), []);
    assert_eq!(found_with(1).len(), 1);
    assert_eq!(found_with(1)[0].0, Severity::Warning);
}

#[test]
fn objects_in_the_open_and_open_objects_are_worth_knowing() {
    let mut b = SceneBuilder::new("space");
    let m = b.material("m", [0.5; 3], [1.0; 3]);
    let n = b.node("probe", None, O, DQuat::IDENTITY);
    b.cuboid(n, "probe", m, O, I);
    assert_eq!(
        found(&check(&b.build().unwrap()), "open-enclosure"),
        [(Severity::Info, "space".into(), 1)]
    );
    let lidless = notes(|b, _, grey| {
        let n = b.node("bin", None, O, DQuat::IDENTITY);
        for side in &super::super::builder::cuboid_sides(I * 0.5, I * 0.7)[..5] {
            b.polygon(n, "bin", grey, side);
        }
    });
    assert_eq!(lidless.len(), 1);
    assert_eq!(found(&lidless, "open-object"), [(Severity::Info, "bin".into(), 4)]);
}

#[test]
fn flipped_polygons_and_objects_are_found() {
    let one = notes(|b, _, grey| {
        let n = b.node("patched", None, O, DQuat::IDENTITY);
        for (i, mut side) in
            super::super::builder::cuboid_sides(I * 0.5, I * 0.7).into_iter().enumerate()
        {
            if i == 2 {
                side.reverse();
            }
            b.polygon(n, "patched", grey, &side);
        }
    });
    assert_eq!(found(&one, "flipped-normals"), [(Severity::Warning, "patched".into(), 4)]);
    let whole = notes(|b, _, grey| {
        let n = b.node("inverted", None, O, DQuat::IDENTITY);
        b.cuboid_inward(n, "inverted", grey, I * 0.5, I * 0.7);
    });
    assert_eq!(found(&whole, "flipped-normals"), [(Severity::Warning, "inverted".into(), 6)]);
    let outward = notes(|b, _, grey| {
        let n = b.node("shell", None, O, DQuat::IDENTITY);
        b.cuboid(n, "shell", grey, I * -1.0, I * 2.0);
    });
    assert_eq!(found(&outward, "flipped-normals"), [(Severity::Warning, "shell".into(), 6)]);
}

#[test]
fn a_lamp_inside_out_is_named_and_a_glowing_room_is_not() {
    let inverted = notes(|b, _, _| {
        let glow = b.material("bright", [0.5; 3], [10.0; 3]);
        let bulb = b.node("bulb", None, O, DQuat::IDENTITY);
        b.cuboid_inward(bulb, "bulb", glow, I * 0.5, I * 0.6);
    });
    assert_eq!(found(&inverted, "flipped-normals"), [(Severity::Warning, "bulb".into(), 6)]);
    let mut b = SceneBuilder::new("furnace");
    let glow = b.material("bright", [0.5; 3], [10.0; 3]);
    let room = b.node("room", None, O, DQuat::IDENTITY);
    b.cuboid_inward(room, "walls", glow, O, I);
    assert_eq!(found(&check(&b.build().unwrap()), "flipped-normals"), []);
}

/// The room is not empty: the lamp faces the wrong way.
#[test]
fn of_a_lamp_that_faces_out_of_its_ceiling_the_lamp_is_named() {
    let mut b = SceneBuilder::new("s");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [10.0; 3]);
    let room = b.node("room", None, O, DQuat::IDENTITY);
    b.cuboid_inward(room, "walls", grey, O, I);
    let lamp = b.node("lamp", None, DVec3::Y, DQuat::IDENTITY);
    let corners = [(0.4, 0.4), (0.4, 0.6), (0.6, 0.6), (0.6, 0.4)];
    b.polygon(lamp, "lamp", glow, &corners.map(|(x, z)| DVec3::new(x, 0.0, z)));
    let notes = check(&b.build().unwrap());
    assert_eq!(found(&notes, "flipped-normals"), []);
    assert_eq!(found(&notes, "light-lost"), [(Severity::Warning, "lamp".into(), 1)]);
}

#[test]
fn coincident_polygons_are_counted_but_not_back_to_back_ones() {
    let twice = notes(|b, _, grey| {
        let n = b.node("again", None, O, DQuat::IDENTITY);
        b.cuboid(n, "again", grey, I * 0.1, I * 0.3);
    });
    assert_eq!(found(&twice, "duplicate"), [(Severity::Warning, "again".into(), 6)]);
    let resting = notes(|b, _, grey| {
        let n = b.node("neighbour", None, O, DQuat::IDENTITY);
        b.cuboid(n, "neighbour", grey, DVec3::new(0.3, 0.1, 0.1), DVec3::new(0.5, 0.3, 0.3));
    });
    assert_eq!(found(&resting, "duplicate"), []);
}

#[test]
fn numbers_out_of_the_usual_are_reported() {
    let odd = notes(|b, room, _| {
        let white = b.material("white", [0.97, 0.2, 0.2], [0.0; 3]);
        let laser = b.material("laser", [0.0; 3], [1e7, 0.0, 0.0]);
        let n = b.node("far", None, DVec3::splat(1e4), DQuat::IDENTITY);
        b.cuboid(n, "a", white, O, I);
        b.cuboid(n, "b", laser, I * 2.0, I * 3.0);
        b.light("sun", room, LightKind::Directional, [1e5; 3]);
    });
    assert_eq!(found(&odd, "reflectance"), [(Severity::Warning, "white".into(), 6)]);
    let subjects: Vec<String> = found(&odd, "units").into_iter().map(|f| f.1).collect();
    assert_eq!(subjects, ["s", "laser", "sun"]);
}

#[test]
fn a_wall_that_faces_outwards_in_a_room_of_separate_objects_is_named() {
    let room = |flipped: &str| {
        let mut b = SceneBuilder::new("s");
        let grey = b.material("grey", [0.5; 3], [1.0; 3]);
        let at = |k: [u8; 3]| DVec3::from_array(k.map(f64::from));
        let walls: [(&str, [[u8; 3]; 4]); 6] = [
            ("floor", [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]]),
            ("ceiling", [[0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]]),
            ("west", [[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]]),
            ("east", [[1, 0, 0], [1, 0, 1], [1, 1, 1], [1, 1, 0]]),
            ("north", [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
            ("south", [[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1]]),
        ];
        for (name, corners) in walls {
            let node = b.node(name, None, O, DQuat::IDENTITY);
            let mut corners = corners.map(at);
            if flipped == name {
                corners.reverse();
            }
            b.polygon(node, name, grey, &corners);
        }
        check(&b.build().unwrap())
    };
    let named = |notes: &[Note]| {
        found(notes, "flipped-normals").into_iter().map(|n| n.1).collect::<Vec<_>>()
    };
    assert_eq!(named(&room("floor")), ["floor"]);
    assert_eq!(named(&room("")), [""; 0]);
}

#[test]
fn a_rug_in_the_plane_of_the_floor_overlaps_it_and_one_above_does_not() {
    let rug = |height: f64| {
        notes(|b, _, grey| {
            let node = b.node("rug", None, DVec3::new(0.5, height, 0.5), DQuat::IDENTITY);
            let at = |x: f64, z: f64| DVec3::new(x * 0.3, 0.0, z * 0.3);
            b.polygon(node, "rug", grey, &[at(0., 0.), at(0., 1.), at(1., 1.), at(1., 0.)]);
        })
    };
    assert_eq!(found(&rug(0.0), "overlap").len(), 1);
    assert_eq!(found(&rug(0.001), "overlap"), []);
}

/// A shade of 0.1 m around a light below the ceiling of the room; one side may be left out.
fn shaded(double_sided: bool, sides: usize) -> Vec<(Severity, String, usize)> {
    found(
        &notes(|b, _, grey| {
            let paper = b.double_sided_material("paper", [0.5; 3], [0.0; 3]);
            let shade = b.node("shade", None, O, DQuat::IDENTITY);
            let (low, high) = (DVec3::new(0.7, 0.6, 0.7), DVec3::new(0.8, 0.7, 0.8));
            for side in &super::super::builder::cuboid_sides(low, high)[..sides] {
                b.polygon(shade, "shade", if double_sided { paper } else { grey }, side);
            }
            let bulb = b.node("bulb", None, (low + high) / 2.0, DQuat::IDENTITY);
            b.light("bulb", bulb, LightKind::Point, [1.0; 3]);
        }),
        "light-lost",
    )
}

#[test]
fn a_bulb_in_its_closed_shade_is_named_and_in_an_open_one_is_not() {
    let bulb = |severity| vec![(severity, "bulb".to_owned(), 1)];
    assert_eq!(shaded(false, 6), bulb(Severity::Warning));
    // That may be a room.
    assert_eq!(shaded(true, 6), bulb(Severity::Info));
    assert_eq!(shaded(false, 5), []);
    assert_eq!(shaded(true, 5), []);
}

#[test]
fn a_sun_outside_a_closed_room_is_named_and_one_through_a_roof_light_is_not() {
    let sun = |double_sided: bool, window: f64| {
        let mut b = SceneBuilder::new("s");
        let grey = match double_sided {
            true => b.double_sided_material("grey", [0.5; 3], [0.0; 3]),
            false => b.material("grey", [0.5; 3], [0.0; 3]),
        };
        let room = b.node("room", None, O, DQuat::IDENTITY);
        let all = super::super::builder::cuboid_sides(O, I);
        for side in all.iter().filter(|side| side.iter().any(|c| c.y == 0.0)) {
            let mut side = *side;
            side.reverse();
            b.polygon(room, "room", grey, &side);
        }
        let at = |x: f64, z: f64| DVec3::new(x, 1.0, z);
        for (from, to) in [(0.0, 0.5 - window / 2.0), (0.5 + window / 2.0, 1.0)] {
            b.polygon(room, "room", grey, &[at(from, 0.), at(to, 0.), at(to, 1.), at(from, 1.)]);
        }
        let crate_ = b.node("crate", None, O, DQuat::IDENTITY);
        b.cuboid(crate_, "crate", grey, I * 0.1, I * 0.3);
        let tilt = DQuat::from_xyzw(-1.0, 0.1, 0.05, 1.0).normalize();
        let node = b.node("sun", None, O, tilt);
        b.light("sun", node, LightKind::Directional, [1.0; 3]);
        found(&check(&b.build().unwrap()), "light-lost")
    };
    let named = vec![(Severity::Warning, "sun".to_owned(), 1)];
    assert_eq!(sun(true, 0.0), named);
    assert_eq!(sun(false, 0.0), named);
    assert_eq!(sun(true, 0.1), []);
    assert_eq!(sun(false, 0.1), []);
}

#[test]
fn a_lamp_just_above_the_ceiling_is_named_and_one_below_or_beside_is_not() {
    // The lamp faces down; the ceiling is seen from both sides.
    let lamp = |height: f64, x: f64, rises: bool| {
        let mut b = SceneBuilder::new("s");
        let grey = b.double_sided_material("grey", [0.5; 3], [0.0; 3]);
        let glow = b.material("glow", [0.0; 3], [10.0; 3]);
        let room = b.node("room", None, O, DQuat::IDENTITY);
        b.cuboid(room, "walls", grey, O, I);
        let lamp = b.node("lamp", None, DVec3::new(x, height, 0.5), DQuat::IDENTITY);
        let at = |x: f64, z: f64| DVec3::new(x * 0.1, 0.0, z * 0.1);
        b.polygon(lamp, "lamp", glow, &[at(0., 0.), at(1., 0.), at(1., 1.), at(0., 1.)]);
        let floor = b.node("ground", None, O, DQuat::IDENTITY);
        let at = |x: f64, z: f64| DVec3::new(x, -1.0, z) * 9.0;
        b.polygon(floor, "ground", grey, &[at(-1., -1.), at(-1., 1.), at(1., 1.), at(1., -1.)]);
        if rises {
            let place = |y: f64| DVec3::new(x, y, 0.5);
            b.animate_translation(
                lamp,
                crate::scene::Track {
                    times_s: vec![0.0, 1.0],
                    values: vec![place(height), place(height + 1.0)],
                    interpolation: crate::scene::Interpolation::Linear,
                },
            );
        }
        let mut lost = found(&check(&b.build().unwrap()), "light-lost");
        lost.retain(|note| note.0 > Severity::Info);
        lost
    };
    let named = vec![(Severity::Warning, "lamp".to_owned(), 1)];
    assert_eq!(lamp(1.001, 0.5, false), named);
    assert_eq!(lamp(0.999, 0.5, false), []);
    assert_eq!(lamp(1.0, 0.5, false), []);
    assert_eq!(lamp(1.001, 1.5, false), []);
    // It is lifted off later.
    assert_eq!(lamp(1.001, 0.5, true), []);
}
