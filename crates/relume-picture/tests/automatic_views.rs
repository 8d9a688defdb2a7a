//! What automatic views show of rooms and objects.

use crate::common::*;
use glam::DVec3;
use relume_core::scene::{BodyId, Scene};
use relume_picture::picture::{Exposure, Overview, Settings, Shading, Tone, View, render};

/// Shares of the picture that show fronts, backs and nothing, the nearest counting: found by
/// drawing every patch twice, in red from the front and in green from behind.
fn fronts_and_backs(scene: &Scene, view: &View) -> (f64, f64) {
    let mut both = empty();
    let red = material(&mut both, [0.9, 0.0, 0.0], 0.0);
    let green = material(&mut both, [0.0, 0.9, 0.0], 0.0);
    for (index, b) in scene.bodies.iter().enumerate() {
        let pose = scene.pose(BodyId(index as u32), 0.0).unwrap();
        for patch in &scene.patches[b.patches.start as usize..b.patches.end as usize] {
            let front: Vec<DVec3> = patch.corners_in_body().map(|p| pose.point(p)).collect();
            let back = front.iter().rev().copied().collect();
            body(&mut both, &[(front, red), (back, green)]);
        }
    }
    let snapshot = snapshot(&both, |_, _, _| false, |_, _, m| m.reflectance.map(|r| r as f32));
    let settings = Settings {
        shading: Shading::Flat,
        exposure: Exposure::Fixed(3.0),
        tone: Tone::Clip,
        samples: 1,
        ..Settings::default()
    };
    let image = render(&snapshot, view, &settings);
    let share = |c: usize| {
        image.pixels.iter().filter(|p| p[c] > 0).count() as f64 / image.pixels.len() as f64
    };
    (share(0), share(1))
}

#[test]
fn a_closed_room_is_seen_from_inside() {
    let scene = room(&[]);
    let view = View::automatic(&scene);
    let eye = view.world_from_camera.translation;
    assert!(eye.cmpgt(DVec3::ZERO).all() && eye.cmplt(v(4.0, 3.0, 5.0)).all(), "{eye}");
    // A sample on an edge may meet either of the two patches there.
    let (front, back) = fronts_and_backs(&scene, &view);
    assert!(front + back == 1.0 && back < 1e-4, "{front} {back}");
}

#[test]
fn a_room_without_a_wall_is_seen_through_the_opening() {
    for without in [Side::Front, Side::Back, Side::Left, Side::Right] {
        let scene = room(&[without]);
        let view = View::automatic(&scene);
        let (front, back) = fronts_and_backs(&scene, &view);
        assert!(front > 0.6 && back < 0.02, "{without:?}: {front} {back} {view:?}");
        let eye = view.world_from_camera.translation;
        let through = match without {
            Side::Front => eye.z > 4.0,
            Side::Back => eye.z < 1.0,
            Side::Left => eye.x < 1.0,
            _ => eye.x > 3.0,
        };
        assert!(through, "{without:?}: {eye}");
        let scene = double_sided(&scene);
        let (front, _) = fronts_and_backs(&scene, &View::automatic(&scene));
        assert!(front > 0.6, "{without:?}, double-sided: {front}");
    }
}

#[test]
fn a_room_with_a_window_is_seen_from_inside_although_its_walls_have_outsides() {
    let mut scene = room(&[Side::Front]);
    let white = scene.patches[1].material;
    let [mut left, mut right] =
        [(0.0, 1.5), (2.5, 4.0)].map(|(a, b)| side(v(a, 0.0, 0.0), v(b, 3.0, 5.0), Side::Front));
    left.reverse();
    right.reverse();
    body(&mut scene, &[(left, white), (right, white)]);
    for scene in [scene.clone(), double_sided(&scene)] {
        let eye = View::automatic(&scene).world_from_camera.translation;
        assert!(eye.cmpgt(DVec3::ZERO).all() && eye.cmplt(v(4.0, 3.0, 5.0)).all(), "{eye}");
    }
}

#[test]
fn a_room_of_three_walls_without_a_ceiling_is_seen_from_its_open_side() {
    let scene = room(&[Side::Front, Side::Ceiling]);
    let view = View::automatic(&scene);
    let (front, back) = fronts_and_backs(&scene, &view);
    assert!(front > 0.45 && back < 0.05, "{front} {back} {view:?}");
    assert!(view.world_from_camera.translation.z > 4.0);
}

#[test]
fn a_double_sided_object_is_no_room() {
    let mut scene = empty();
    let grey = material(&mut scene, [0.5; 3], 0.0);
    solid(&mut scene, v(-1.0, -1.0, -1.0), v(1.0, 1.0, 1.0), grey);
    solid(&mut scene, v(-6.0, -0.5, -0.01), v(-1.0, 0.5, 0.01), grey);
    solid(&mut scene, v(1.0, -0.5, -0.01), v(6.0, 0.5, 0.01), grey);
    let scene = double_sided(&scene);
    let eye = View::automatic(&scene).world_from_camera.translation;
    assert!(eye.length() > 6.0, "{eye}");
}

/// A box without a lid, of both sides, as wide as it is high, without light of its own.
#[test]
fn what_is_open_at_the_top_is_looked_into_from_outside() {
    let mut scene = empty();
    let white = material(&mut scene, [0.9; 3], 0.0);
    let (low, high) = (v(-1.0, 0.0, -1.0), v(1.0, 1.6, 1.0));
    let sides = SIDES.iter().filter(|&&s| s != Side::Ceiling);
    let sides: Vec<_> = sides.map(|&s| (side(low, high, s), white)).collect();
    body(&mut scene, &sides);
    let scene = double_sided(&scene);
    let eye = View::automatic(&scene).world_from_camera.translation;
    assert!(eye.cmplt(low).any() || eye.cmpgt(high).any(), "{eye}");
}

#[test]
fn a_floating_object_is_seen_from_outside_and_whole() {
    let mut scene = empty();
    let grey = material(&mut scene, [0.5; 3], 0.0);
    solid(&mut scene, v(10.0, 20.0, 30.0), v(11.0, 20.5, 30.7), grey);
    solid(&mut scene, v(11.0, 20.2, 30.3), v(13.0, 20.25, 30.4), grey);
    let view = View::automatic(&scene);
    let (front, back) = fronts_and_backs(&scene, &view);
    assert!(front > 0.1 && back < 1e-4, "{front} {back} {view:?}");
    for patch in &scene.patches {
        for corner in patch.corners_in_body() {
            let pixel = view.project(corner, 640, 480).expect("in front of the camera");
            assert!(pixel.cmpgt(glam::DVec2::ZERO).all() && pixel.x < 640.0 && pixel.y < 480.0);
        }
    }
}

/// A lamp of one side, half a metre across, that shines down from above (or up from below) a place.
fn lamp(scene: &mut Scene, at: DVec3, shines_up: bool) {
    let bright = material(scene, [0.5; 3], 50.0);
    let (low, high) = (at - v(0.25, 0.0, 0.25), at + v(0.25, 0.0, 0.25));
    let side_up = if shines_up { Side::Ceiling } else { Side::Floor };
    let corners = side(low, high, side_up);
    body(scene, &[(corners, bright)]);
}

#[test]
fn a_plate_is_seen_from_the_side_that_is_lit() {
    for above in [true, false] {
        let mut scene = empty();
        let grey = material(&mut scene, [0.5; 3], 0.0);
        solid(&mut scene, v(-2.0, 0.0, -2.0), v(2.0, 0.1, 2.0), grey);
        lamp(&mut scene, v(0.0, if above { 2.0 } else { -1.9 }, 0.0), !above);
        let overview = Overview::of(&scene);
        let eye = overview.view.world_from_camera.translation;
        assert_eq!(eye.y > 0.0, above, "{eye}");
        assert!(overview.lit.unwrap() > 0.05, "{overview:?}");
    }
}

#[test]
fn a_room_of_two_sides_is_seen_from_where_its_lamp_is() {
    let inside = double_sided(&room(&[]));
    // The same walls, and all light outside.
    let mut outside = empty();
    let white = material(&mut outside, [0.7; 3], 0.0);
    solid(&mut outside, v(0.0, 0.0, 0.0), v(4.0, 3.0, 5.0), white);
    lamp(&mut outside, v(2.0, 9.0, 2.5), false);
    let within = |scene: &Scene| {
        let overview = Overview::of(scene);
        assert!(overview.lit.unwrap() > 0.03, "{overview:?}");
        let eye = overview.view.world_from_camera.translation;
        eye.cmpgt(DVec3::ZERO).all() && eye.cmplt(v(4.0, 3.0, 5.0)).all()
    };
    assert!(within(&inside));
    assert!(!within(&double_sided(&outside)));
}

#[test]
fn a_house_without_a_floor_is_seen_from_where_its_light_falls() {
    let mut scene = room(&[Side::Floor]);
    // Below the house, so that its ceiling and walls are lit, but for its own lamp.
    scene.materials.iter_mut().for_each(|m| m.exitance = [0.0; 3]);
    lamp(&mut scene, v(2.0, -2.0, 2.5), true);
    let scene = double_sided(&scene);
    let overview = Overview::of(&scene);
    assert!(overview.lit.unwrap() > 0.2, "{overview:?}");
}

#[test]
fn what_nothing_lights_is_said_to_be_dark() {
    let mut scene = room(&[]);
    assert!(Overview::of(&scene).lit.unwrap() > 0.9);
    scene.materials.iter_mut().for_each(|m| m.exitance = [0.0; 3]);
    assert_eq!(Overview::of(&scene).lit, None);
    assert_eq!(Overview::of(&empty()).lit, None);
}

#[test]
fn still_bodies_are_where_their_patches_are() {
    // The node of a body that does not move is placed already.
    let mut scene = room(&[]);
    scene.motion.nodes[0].translation = v(100.0, 0.0, 0.0);
    let eye = View::automatic(&scene).world_from_camera.translation;
    assert!(eye.cmpgt(DVec3::ZERO).all() && eye.cmplt(v(4.0, 3.0, 5.0)).all(), "{eye}");
}

/// A figure: a slab of two colours whose back is somewhat larger than its front.
#[test]
fn a_figure_is_seen_from_the_front() {
    let mut scene = empty();
    let [red, grey] = [[0.6, 0.1, 0.1], [0.6; 3]].map(|r| material(&mut scene, r, 0.0));
    solid(&mut scene, v(-0.99, 0.0, 0.0), v(0.99, 1.98, 0.1), red);
    solid(&mut scene, v(-1.0, 0.0, -0.1), v(1.0, 2.0, 0.0), grey);
    let eye = View::automatic(&scene).world_from_camera.translation;
    assert!(eye.z > 0.5, "{eye}");
    // As much of it from the other side, where the front is empty.
    let mut scene = empty();
    let grey = material(&mut scene, [0.6; 3], 0.0);
    body(&mut scene, &[(side(v(-1.0, 0.0, 0.0), v(1.0, 2.0, 0.0), Side::Back), grey)]);
    let eye = View::automatic(&scene).world_from_camera.translation;
    assert!(eye.z < -0.5, "{eye}");
}

/// Two boxes on grounds of a hundred metres: a polygon among those of the boxes, one of its own body, and a slab.
#[test]
fn what_stands_on_a_large_ground_is_no_speck() {
    for ground in 0..3 {
        let mut scene = empty();
        let grey = material(&mut scene, [0.5; 3], 0.0);
        let plane = side(v(-50.0, -1.0, -50.0), v(50.0, 0.0, 50.0), Side::Ceiling);
        let mut polygons: Vec<_> =
            SIDES.map(|s| (side(v(-0.5, 0.0, -0.5), v(0.5, 1.0, 0.5), s), grey)).to_vec();
        match ground {
            0 => polygons.push((plane, grey)),
            1 => drop(body(&mut scene, &[(plane, grey)])),
            _ => drop(solid(&mut scene, v(-50.0, -1.0, -50.0), v(50.0, 0.0, 50.0), grey)),
        }
        body(&mut scene, &polygons);
        solid(&mut scene, v(1.0, 0.0, 0.0), v(1.5, 0.5, 0.5), grey);
        let eye = View::automatic(&scene).world_from_camera.translation;
        assert!(eye.length() < 8.0 && eye.y > 0.0, "{ground}: {eye}");
    }
}

/// A closed body of two sides, of which a part of the skin glows to both: not a room with a lamp.
#[test]
fn a_figure_whose_eyes_glow_is_seen_from_outside() {
    let mut scene = empty();
    let grey = material(&mut scene, [0.5; 3], 0.0);
    let glow = material(&mut scene, [0.5; 3], 4.0);
    let (low, high) = (v(-1.0, 0.0, -0.6), v(1.0, 2.0, 0.6));
    let mut skin: Vec<_> =
        SIDES.iter().filter(|&&s| s != Side::Front).map(|&s| (side(low, high, s), grey)).collect();
    let front = |a: (f64, f64), b: (f64, f64), m| {
        (side(v(a.0, a.1, -0.6), v(b.0, b.1, 0.6), Side::Front), m)
    };
    skin.extend([
        front((-1.0, 0.0), (1.0, 1.4), grey),
        front((-1.0, 1.4), (-0.6, 1.6), grey),
        front((-0.6, 1.4), (-0.4, 1.6), glow),
        front((-0.4, 1.4), (0.4, 1.6), grey),
        front((0.4, 1.4), (0.6, 1.6), glow),
        front((0.6, 1.4), (1.0, 1.6), grey),
        front((-1.0, 1.6), (1.0, 2.0), grey),
    ]);
    body(&mut scene, &skin);
    let scene = double_sided(&scene);
    let eye = View::automatic(&scene).world_from_camera.translation;
    assert!(eye.cmplt(low).any() || eye.cmpgt(high).any(), "{eye}");
}
