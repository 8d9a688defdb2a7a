use glam::DQuat;

use super::super::{Interpolation, MaterialId, Projection, RotationTrack, SceneBuilder, Track};
use super::*;

/// A unit cube of double-sided polygons about the origin on a node of its own, the sun, and more.
fn crate_and(more: impl Fn(&mut SceneBuilder, NodeId, MaterialId)) -> Scene {
    let mut b = SceneBuilder::new("crate");
    let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
    let node = b.node("crate", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(node, "crate", thin, DVec3::splat(-0.5), DVec3::splat(0.5));
    sun(&mut b);
    more(&mut b, node, thin);
    b.build().unwrap()
}

fn sun(b: &mut SceneBuilder) {
    let sun = b.node("sun", None, DVec3::Y * 9.0, DQuat::from_rotation_x(-1.0));
    b.light("sun", sun, LightKind::Directional, [3.0; 3]);
}

fn left_out(scene: &Scene) -> usize {
    scene.patches.len() - scene.without_dark_sides().patches.len()
}

fn with(more: impl Fn(&mut SceneBuilder, NodeId, MaterialId)) -> usize {
    left_out(&crate_and(more))
}

fn at(b: &mut SceneBuilder, x: f64, y: f64, z: f64) -> NodeId {
    b.node("more", None, DVec3::new(x, y, z), DQuat::IDENTITY)
}

/// A square that looks up.
fn square(half: f64) -> [DVec3; 4] {
    [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
        .map(|(x, z)| DVec3::new(x * half, 0.0, z * half))
}

fn plate(b: &mut SceneBuilder, node: NodeId, half: f64) {
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    b.polygon(node, "plate", grey, &square(half));
}

fn lamp(b: &mut SceneBuilder, node: NodeId, half: f64) {
    let bright = b.material("bright", [0.0; 3], [9.0; 3]);
    b.polygon(node, "lamp", bright, &square(half));
}

fn slide(b: &mut SceneBuilder, node: NodeId, from: DVec3, to: DVec3) {
    let (times_s, values) = (vec![0.0, 1.0], vec![from, to]);
    let interpolation = Interpolation::Linear;
    b.animate_translation(node, Track { times_s, values, interpolation });
}

#[test]
fn the_inside_of_a_crate_is_left_out_and_its_outside_stays() {
    let scene = crate_and(|_, _, _| {});
    let left = scene.without_dark_sides();
    assert_eq!((scene.patches.len(), left.patches.len()), (12, 6));
    for patch in &left.patches {
        let middle = patch.corners_in_body().sum::<DVec3>() / 4.0;
        assert!(patch.twin.is_none() && patch.frame.normal.dot(middle) > 0.4, "{patch:?}");
    }
    assert_eq!(left.bodies[0].patches, 0..6);
    assert!(left.notes.iter().any(|n| n.code == "dark-sides" && n.count == 6));
}

#[test]
fn patches_behind_those_left_out_keep_their_twins_and_bodies() {
    let scene = crate_and(|b, _, thin| {
        let node = at(b, 5.0, 0.0, 0.0);
        b.polygon(node, "sheet", thin, &square(1.0));
    });
    let left = scene.without_dark_sides();
    assert_eq!(left.patches.len(), 8);
    assert_eq!((left.patches[6].twin, left.patches[7].twin), (Some(PatchId(7)), Some(PatchId(6))));
    assert_eq!(left.bodies[1].patches, 6..8);
    assert_eq!(left.patches[7].body, BodyId(1));
}

#[test]
fn whichever_way_polygons_are_wound_the_inner_sides_go() {
    let corners = [DVec3::splat(-0.5), DVec3::splat(0.5)];
    for wound in 0..3 {
        let mut b = SceneBuilder::new("wound");
        let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
        let node = b.node("crate", None, DVec3::X, DQuat::from_rotation_y(0.3));
        if wound == 2 {
            b.scale(node, DVec3::new(-1.0, 2.0, 1.0));
        }
        let sides = super::super::builder::cuboid_sides(corners[0], corners[1]);
        for (k, mut side) in sides.into_iter().enumerate() {
            if wound == 0 || k == 2 || k == 5 {
                side.reverse();
            }
            b.polygon(node, "crate", thin, &side);
        }
        sun(&mut b);
        let left = b.build().unwrap().without_dark_sides();
        assert_eq!(left.patches.len(), 6, "{wound}");
        for patch in &left.patches {
            let middle = patch.corners_in_body().sum::<DVec3>() / 4.0 - DVec3::X;
            assert!(patch.frame.normal.dot(middle) > 0.4, "{wound} {patch:?}");
        }
    }
}

#[test]
fn what_is_inside_at_rest_keeps_the_inner_sides() {
    let shines = |b: &mut SceneBuilder, node| b.light("bulb", node, LightKind::Point, [1.0; 3]);
    let looks = |b: &mut SceneBuilder, node| {
        b.camera("eye", node, Projection::Perspective { yfov: 1.0, aspect: None });
    };
    for (y, touching, inside) in [(0.0, false, true), (0.5, true, false), (0.7, false, false)] {
        let place = |f: &dyn Fn(&mut SceneBuilder, NodeId)| {
            with(|b, _, _| {
                let node = at(b, 0.1, y, 0.0);
                f(b, node);
            })
        };
        let kept = |keeps: bool| if keeps { 0 } else { 6 };
        assert_eq!(place(&|b, n| plate(b, n, 0.2)), kept(inside), "a plate at {y}");
        assert_eq!(place(&|b, n| plate(b, n, 3.0)), kept(inside), "a floor at {y}");
        assert_eq!(place(&|b, n| lamp(b, n, 0.2)), kept(inside || touching), "a lamp at {y}");
        assert_eq!(place(&shines), kept(inside || touching), "a light at {y}");
        assert_eq!(place(&looks), kept(inside || touching), "a camera at {y}");
    }
}

#[test]
fn crates_that_glow_or_lack_a_side_keep_all_sides() {
    let mut b = SceneBuilder::new("lantern");
    let glow = b.double_sided_material("glow", [0.5; 3], [1.0; 3]);
    let node = b.node("lantern", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(node, "lantern", glow, DVec3::ZERO, DVec3::ONE);
    assert_eq!(left_out(&b.build().unwrap()), 0);
    let mut b = SceneBuilder::new("open");
    let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
    let node = b.node("open", None, DVec3::ZERO, DQuat::IDENTITY);
    for side in &super::super::builder::cuboid_sides(DVec3::ZERO, DVec3::ONE)[1..] {
        b.polygon(node, "open", thin, side);
    }
    sun(&mut b);
    assert_eq!(left_out(&b.build().unwrap()), 0);
}

#[test]
fn where_nothing_emits_every_side_counts() {
    let mut scene = crate_and(|_, _, _| {});
    scene.lights.clear();
    assert_eq!(left_out(&scene), 0);
}

#[test]
fn a_lit_room_keeps_its_inside_and_a_crate_in_it_does_not() {
    let room = |dark: bool| {
        with(|b, _, thin| {
            let node = at(b, 0.0, 0.0, 0.0);
            b.cuboid(node, "room", thin, DVec3::new(-3.0, -0.5, -3.0), DVec3::splat(3.0));
            let up = if dark { 5.0 } else { 2.0 };
            let node = at(b, 0.0, up, 0.0);
            lamp(b, node, 0.2);
        })
    };
    assert_eq!((room(false), room(true)), (6, 6));
}

#[test]
fn crates_that_touch_are_dark_and_those_that_cross_are_not_settled() {
    let second = |x: f64, y: f64, z: f64| {
        with(|b, _, thin| {
            let node = at(b, x, y, z);
            b.cuboid(node, "second", thin, DVec3::splat(-0.5), DVec3::splat(0.5));
        })
    };
    // Flush, overhanging along both axes, and side by side at half the height.
    for (x, y, z) in [(0.0, 1.0, 0.0), (0.3, 1.0, -0.2), (1.0, 0.5, 0.0)] {
        assert_eq!(second(x, y, z), 12, "{x} {y} {z}");
    }
    assert_eq!(second(0.3, 0.9, -0.2), 0);
    // A face in the other's plane, and inside it.
    assert_eq!(second(0.5, 0.0, 0.0), 0);
}

#[test]
fn parts_that_meet_along_parts_of_sides_close_a_shell() {
    let mut b = SceneBuilder::new("step");
    let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
    let node = b.node("step", None, DVec3::ZERO, DQuat::IDENTITY);
    // An L of two boxes without what is between them: its ends are two rectangles each.
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    for z in [0.0, 1.0] {
        b.polygon(node, "end", thin, &[p(0., 0., z), p(1., 0., z), p(1., 2., z), p(0., 2., z)]);
        b.polygon(node, "end", thin, &[p(1., 0., z), p(2., 0., z), p(2., 1., z), p(1., 1., z)]);
    }
    let outline =
        [p(0., 0., 0.), p(2., 0., 0.), p(2., 1., 0.), p(1., 1., 0.), p(1., 2., 0.), p(0., 2., 0.)];
    for k in 0..6 {
        let (a, c) = (outline[k], outline[(k + 1) % 6]);
        b.polygon(node, "side", thin, &[a, c, c + DVec3::Z, a + DVec3::Z]);
    }
    sun(&mut b);
    // On the step, reaching under it from outside, and from outside into the upright part.
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let add = |b: &mut SceneBuilder, x: [f64; 2], y: f64| {
        let corners = [p(x[0], y, 0.2), p(x[0], y, 0.8), p(x[1], y, 0.8), p(x[1], y, 0.2)];
        b.polygon(node, "plate", grey, &corners);
    };
    add(&mut b, [1.0, 3.0], 1.0);
    add(&mut b, [1.2, 1.8], 1.5);
    let outside = b.build().unwrap();
    assert_eq!(left_out(&outside), 10);
    let mut inside = outside.clone();
    let plate = inside.patches.iter_mut().rev().find(|p| p.twin.is_none()).unwrap();
    plate.frame.origin -= DVec3::new(0.4, 0.0, 0.0);
    assert_eq!(left_out(&inside), 0);
}

#[test]
fn a_surface_that_crosses_itself_keeps_all_sides() {
    let mut b = SceneBuilder::new("bow");
    let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
    let node = b.node("bow", None, DVec3::ZERO, DQuat::IDENTITY);
    // A box whose far end is turned round: its sides cross in the middle.
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let near = [p(-2., -1., 0.), p(1., -1., 0.), p(1., 1., 0.), p(-2., 1., 0.)];
    let far = near.map(|c| p(-c.x, -c.y, 4.0));
    for k in 0..4 {
        let l = (k + 1) % 4;
        b.polygon(node, "side", thin, &[near[k], near[l], far[l]]);
        b.polygon(node, "side", thin, &[near[k], far[l], far[k]]);
    }
    b.polygon(node, "end", thin, &near);
    b.polygon(node, "end", thin, &far);
    sun(&mut b);
    assert_eq!(left_out(&b.build().unwrap()), 0);
}

#[test]
fn what_comes_inside_at_any_time_counts_even_while_it_is_absent() {
    let flies = |from: DVec3, to: DVec3| {
        move |b: &mut SceneBuilder, _: NodeId, _: MaterialId| {
            let node = at(b, 0.0, 0.0, 0.0);
            plate(b, node, 0.1);
            slide(b, node, from, to);
            b.animate_presence(node, vec![(0.0, true), (0.3, false)]);
        }
    };
    let far = DVec3::new(4.0, 0.3, 0.0);
    assert_eq!(with(flies(-far, far)), 0);
    assert_eq!(with(flies(-far + DVec3::Y, far + DVec3::Y)), 6);
    let near = DVec3::new(0.62, 0.0, 0.0);
    assert_eq!(with(flies(near, near + far)), 6);
    // A floor that the crate slides along, and one that it is pressed into.
    let slides = |down: f64| {
        with(move |b, node, _| {
            let floor = at(b, 0.0, -0.5, 0.0);
            plate(b, floor, 9.0);
            slide(b, node, DVec3::ZERO, DVec3::new(3.0, -down, 0.0));
        })
    };
    assert_eq!((slides(0.0), slides(0.1)), (6, 0));
}

#[test]
fn what_rides_inside_a_turning_crate_counts_and_what_it_passes_by_does_not() {
    let turn = |b: &mut SceneBuilder, node| {
        let values = [0.0, 1.0, 2.0].map(DQuat::from_rotation_y).to_vec();
        let (times_s, interpolation) = (vec![0.0, 1.0, 2.0], Interpolation::Linear);
        b.animate_rotation(node, RotationTrack { times_s, values, interpolation });
    };
    let rider = |x: f64| {
        with(move |b, node, _| {
            turn(b, node);
            let rider = b.node("bulb", Some(node), DVec3::X * x, DQuat::IDENTITY);
            b.light("bulb", rider, LightKind::Point, [1.0; 3]);
        })
    };
    assert_eq!((rider(0.0), rider(0.8)), (0, 6));
    let post = |x: f64| {
        with(move |b, node, _| {
            turn(b, node);
            let post = at(b, x, 0.0, 0.0);
            b.light("post", post, LightKind::Point, [1.0; 3]);
        })
    };
    assert_eq!((post(0.4), post(0.9)), (0, 6));
}
