//! What comes out of a builder: bodies, surfaces, poses and mistakes.

use glam::{DMat4, DQuat, DVec3};
use proptest::prelude::*;

use super::*;
use crate::geometry::{Aabb, Pose};
use crate::scene::{BodyId, Interpolation, PatchId};

fn slide(to: DVec3) -> Track {
    Track {
        times_s: vec![0.0, 1.0],
        values: vec![DVec3::ZERO, to],
        interpolation: Interpolation::Linear,
    }
}

fn quarter_about_y() -> DQuat {
    DQuat::from_xyzw(0.0, 0.5f64.sqrt(), 0.0, 0.5f64.sqrt())
}

fn turn(to: DQuat) -> RotationTrack {
    RotationTrack {
        times_s: vec![0.0, 1.0],
        values: vec![DQuat::IDENTITY, to],
        interpolation: Interpolation::Linear,
    }
}

/// World centre of a patch.
fn centre(scene: &Scene, patch: u32, time_s: f64) -> DVec3 {
    let p = &scene.patches[patch as usize];
    let local: DVec3 = p.corners_in_body().sum::<DVec3>() / p.corners.len() as f64;
    scene.pose(p.body, time_s).unwrap().point(local)
}

#[test]
fn a_box_faces_outward_and_a_room_inward() {
    let mut b = SceneBuilder::new("s");
    let m = b.material("m", [0.5; 3], [0.0; 3]);
    let n = b.node("n", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(n, "out", m, DVec3::new(1., 2., 3.), DVec3::new(2., 4., 6.));
    b.cuboid_inward(n, "in", m, DVec3::ZERO, DVec3::splat(9.0));
    let scene = b.build().unwrap();
    assert_eq!((scene.bodies.len(), scene.surfaces.len(), scene.patches.len()), (1, 2, 12));
    let middle = [DVec3::new(1.5, 3., 4.5), DVec3::splat(4.5)];
    for (i, p) in scene.patches.iter().enumerate() {
        let out = (centre(&scene, i as u32, 0.0) - middle[p.surface.0 as usize]).normalize();
        let wanted = if p.surface.0 == 0 { out } else { -out };
        assert!(p.frame.normal.distance(wanted) < 1e-15);
        assert!(p.frame.u.cross(p.frame.v).distance(p.frame.normal) < 1e-15);
    }
    let boxes: f64 = scene.patches[..6].iter().map(|p| p.area_m2()).sum();
    assert!((boxes - 22.0).abs() < 1e-12);
}

#[test]
fn an_animated_node_carries_what_hangs_below_until_the_next_animated_one() {
    let mut b = SceneBuilder::new("s");
    let m = b.material("m", [0.5; 3], [0.0; 3]);
    let floor = b.node("floor", None, DVec3::ZERO, DQuat::IDENTITY);
    let arm = b.node("arm", None, DVec3::ZERO, DQuat::IDENTITY);
    let mount = b.node("mount", Some(arm), DVec3::Y, quarter_about_y());
    let hand = b.node("hand", Some(mount), DVec3::X, DQuat::IDENTITY);
    let finger = b.node("finger", Some(hand), DVec3::X, DQuat::IDENTITY);
    for (node, name) in [(floor, "a"), (arm, "b"), (mount, "c"), (hand, "d"), (finger, "e")] {
        b.polygon(node, name, m, &[DVec3::ZERO, DVec3::X, DVec3::Y]);
    }
    b.animate_translation(arm, slide(DVec3::Z));
    b.animate_rotation(hand, turn(quarter_about_y()));
    let scene = b.build().unwrap();
    let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["floor", "arm", "hand"]);
    let objects: Vec<&str> = scene.surfaces.iter().map(|s| s.object.as_str()).collect();
    assert_eq!(objects, ["floor", "arm", "mount", "hand", "finger"]);
    assert_eq!(scene.bodies[1].patches, 1..3);
    assert_eq!(scene.pose(BodyId(0), 0.5), Some(Pose::IDENTITY));
    assert!(!scene.moves(BodyId(0)) && scene.moves(BodyId(1)) && scene.moves(BodyId(2)));
    // The finger's origin: arm z = t, up 1; then x of a frame turned by 90 degrees (towards -z),
    // and x of the hand's, turned 90 more at t = 1.
    let corner = |t: f64| {
        let p = &scene.patches[4];
        let nearest = p.corners_in_body().find(|c| c.distance(DVec3::X) < 1e-12).unwrap();
        scene.pose(p.body, t).unwrap().point(nearest)
    };
    assert!(corner(0.0).distance(DVec3::new(0.0, 1.0, -2.0)) < 1e-14);
    assert!(corner(1.0).distance(DVec3::new(-1.0, 1.0, 0.0)) < 1e-14);
    assert_eq!(scene.motion.duration_s, 1.0);
}

#[test]
fn scales_are_baked_and_mirrors_keep_the_front() {
    let mut b = SceneBuilder::new("s");
    let m = b.material("m", [0.5; 3], [0.0; 3]);
    let top = b.node("top", None, DVec3::X, DQuat::IDENTITY);
    b.scale(top, DVec3::new(-1.0, 2.0, 3.0));
    let below = b.node("below", Some(top), DVec3::new(1.0, 1.0, 1.0), quarter_about_y());
    b.cuboid(below, "box", m, DVec3::ZERO, DVec3::ONE);
    let scene = b.build().unwrap();
    // The box spans x 1..2 and z 0..1 below (after the turn), y 1..2; scaled: x 0..-1, y 2..4, z 0..3.
    let Aabb { lo: min, hi: max } = scene.bounds(0.0).unwrap();
    assert!(min.distance(DVec3::new(-1.0, 2.0, 0.0)) < 1e-14, "{min}");
    assert!(max.distance(DVec3::new(0.0, 4.0, 3.0)) < 1e-14, "{max}");
    for i in 0..6 {
        let outward = centre(&scene, i, 0.0) - (min + max) / 2.0;
        assert!(scene.patches[i as usize].frame.normal.dot(outward) > 0.0);
    }
}

#[test]
fn a_turn_below_an_uneven_scale_is_named_unless_about_its_axis() {
    let build = |scale: DVec3| {
        let mut b = SceneBuilder::new("s");
        let m = b.material("m", [0.5; 3], [0.0; 3]);
        let top = b.node("top", None, DVec3::ZERO, DQuat::IDENTITY);
        b.scale(top, scale);
        let rotor = b.node("rotor", Some(top), DVec3::ZERO, DQuat::IDENTITY);
        b.animate_rotation(rotor, turn(quarter_about_y()));
        b.cuboid(rotor, "box", m, DVec3::ZERO, DVec3::ONE);
        b.build().unwrap().notes
    };
    let notes = build(DVec3::new(2.0, 1.0, 1.0));
    assert_eq!((notes.len(), notes[0].subject.as_str(), notes[0].code), (1, "rotor", "held-shape"));
    assert!(build(DVec3::new(2.0, 1.0, 2.0)).is_empty());
    assert!(build(DVec3::splat(-3.0)).is_empty());
}

#[test]
fn a_track_that_never_changes_is_no_motion() {
    let mut b = SceneBuilder::new("s");
    let m = b.material("m", [0.5; 3], [0.0; 3]);
    let n = b.node("n", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(n, "box", m, DVec3::ZERO, DVec3::ONE);
    let still = Track {
        times_s: vec![0.0, 1.0],
        values: vec![DVec3::Y, DVec3::Y],
        interpolation: Interpolation::Linear,
    };
    b.animate_translation(n, still);
    b.animate_presence(n, vec![(0.0, true)]);
    let scene = b.build().unwrap();
    assert!(!scene.moves(BodyId(0)));
    assert_eq!(scene.bounds(0.0), Some(Aabb { lo: DVec3::Y, hi: DVec3::new(1.0, 2.0, 1.0) }));
}

#[test]
fn absent_bodies_have_no_pose() {
    let mut b = SceneBuilder::new("s");
    let m = b.material("m", [0.5; 3], [0.0; 3]);
    let n = b.node("n", None, DVec3::ZERO, DQuat::IDENTITY);
    b.cuboid(n, "box", m, DVec3::ZERO, DVec3::ONE);
    b.animate_presence(n, vec![(0.0, true), (1.0, false)]);
    let scene = b.build().unwrap();
    assert_eq!(scene.pose(BodyId(0), 0.5), Some(Pose::IDENTITY));
    assert_eq!(scene.pose(BodyId(0), 1.0), None);
    assert_eq!(scene.bounds(1.5), None);
}

#[test]
fn double_sided_polygons_are_twins() {
    let mut b = SceneBuilder::new("s");
    let m = b.double_sided_material("m", [0.5; 3], [0.0; 3]);
    let n = b.node("n", None, DVec3::ZERO, DQuat::IDENTITY);
    b.polygon(n, "leaf", m, &[DVec3::ZERO, DVec3::X, DVec3::Y]);
    let scene = b.build().unwrap();
    assert_eq!(scene.patches.len(), 2);
    assert_eq!(
        (scene.patches[0].twin, scene.patches[1].twin),
        (Some(PatchId(1)), Some(PatchId(0)))
    );
    assert_eq!(scene.patches[0].frame.normal, -scene.patches[1].frame.normal);
}

#[test]
fn names_are_unique() {
    let mut b = SceneBuilder::new("s");
    let m = b.material("m", [0.5; 3], [0.0; 3]);
    for _ in 0..3 {
        let n = b.node("crate", None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid(n, "side", m, DVec3::ZERO, DVec3::ONE);
    }
    let scene = b.build().unwrap();
    let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["crate", "crate 2", "crate 3"]);
    assert_eq!(scene.surfaces[2].name, "side 3");
    assert_eq!(scene.notes.iter().filter(|n| n.code == "renamed").count(), 2);
}

#[test]
fn mistakes_are_named() {
    let message = |wrong: &dyn Fn(&mut SceneBuilder, NodeId, MaterialId)| {
        let mut b = SceneBuilder::new("s");
        let m = b.material("chalk", [0.5; 3], [0.0; 3]);
        let n = b.node("n", None, DVec3::ZERO, DQuat::IDENTITY);
        b.polygon(n, "good", m, &[DVec3::ZERO, DVec3::X, DVec3::Y]);
        wrong(&mut b, n, m);
        b.build().unwrap_err().to_string()
    };
    let bent = [DVec3::ZERO, DVec3::X, DVec3::ONE, DVec3::Y];
    assert!(
        message(&|b, n, m| b.polygon(n, "roof", m, &bent))
            .contains("`roof`: its corners are not in one plane")
    );
    let nan = [DVec3::ZERO, DVec3::X, DVec3::NAN];
    assert!(message(&|b, n, m| b.polygon(n, "roof", m, &nan)).contains("not finite"));
    assert!(
        message(&|b, n, _| b.polygon(n, "roof", MaterialId(7), &bent[..3])).contains("material 7")
    );
    assert!(message(&|b, _, m| b.polygon(NodeId(9), "roof", m, &bent[..3])).contains("node `9`"));
    assert!(
        message(&|b, _, _| {
            b.material("snow", [1.0; 3], [0.0; 3]);
        })
        .contains("`snow`: its reflectance is 1")
    );
    let backwards = Track {
        times_s: vec![1.0, 0.0],
        values: vec![DVec3::ZERO, DVec3::X],
        interpolation: Interpolation::Linear,
    };
    assert!(
        message(&|b, n, _| b.animate_translation(n, backwards.clone())).contains("do not ascend")
    );
    let nothing = SceneBuilder::new("void").build().unwrap_err().to_string();
    assert!(nothing.contains("`void` has no polygon"), "{nothing}");
}

/// A node of a random chain.
#[derive(Clone, Debug)]
struct Link {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
    /// Where it goes and turns to, if it is animated.
    to: Option<(DVec3, DQuat)>,
}

fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
    (range.clone(), range.clone(), range).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn rotation() -> impl Strategy<Value = DQuat> {
    vector(-1.0..1.0).prop_map(|v| DQuat::from_xyzw(v.x, v.y, v.z, 0.7).normalize())
}

/// Scales of either sign: even ones for links that may have animated ones below.
fn scale(even: bool) -> impl Strategy<Value = DVec3> {
    (vector(0.5..2.0), any::<bool>()).prop_map(move |(v, mirror)| {
        let v = if even { DVec3::splat(v.x) } else { v };
        if mirror {
            DVec3::new(-v.x, v.y, v.z)
                * DVec3::new(1.0, if even { -1.0 } else { 1.0 }, if even { -1.0 } else { 1.0 })
        } else {
            v
        }
    })
}

fn link(even: bool) -> impl Strategy<Value = Link> {
    let to = proptest::option::of((vector(-2.0..2.0), rotation()));
    (vector(-2.0..2.0), rotation(), scale(even), to).prop_map(
        move |(translation, rotation, scale, to)| Link {
            translation,
            rotation,
            scale,
            to: to.filter(|_| even),
        },
    )
}

impl Link {
    /// The matrix at time 0 or 1, straight from the definition.
    fn matrix(&self, time: usize) -> DMat4 {
        let (t, r) = match self.to {
            Some(to) if time == 1 => to,
            _ => (self.translation, self.rotation),
        };
        DMat4::from_scale_rotation_translation(self.scale, r, t)
    }
}

proptest! {
    /// Bodies, baked scales and rigid poses together put every corner where the plain product of
    /// the nodes' matrices puts it, and fronts where mirrors leave them.
    #[test]
    fn corners_are_where_the_matrices_put_them(
        upper in proptest::collection::vec(link(true), 1..4),
        lower in proptest::collection::vec(link(false), 0..3),
    ) {
        let mut b = SceneBuilder::new("s");
        let m = b.material("m", [0.5; 3], [0.0; 3]);
        let links: Vec<Link> = upper.into_iter().chain(lower).collect();
        let mut parent = None;
        for link in &links {
            let node = b.node("n", parent, link.translation, link.rotation);
            b.scale(node, link.scale);
            if let Some((translation, rotation)) = link.to {
                let times_s = vec![0.0, 1.0];
                let interpolation = Interpolation::Linear;
                let values = vec![link.translation, translation];
                b.animate_translation(node, Track { times_s: times_s.clone(), values, interpolation });
                let values = vec![link.rotation, rotation];
                b.animate_rotation(node, RotationTrack { times_s, values, interpolation });
            }
            parent = Some(node);
        }
        b.cuboid(parent.unwrap(), "box", m, DVec3::ZERO, DVec3::ONE);
        let scene = b.build().unwrap();
        prop_assert_eq!(scene.bodies.len(), 1);
        prop_assert_eq!(scene.moves(BodyId(0)), links.iter().any(|l| l.to.is_some()));
        for time in [0, 1] {
            let world = links.iter().fold(DMat4::IDENTITY, |w, l| w * l.matrix(time));
            let pose = scene.pose(BodyId(0), time as f64).unwrap();
            let mut wanted: Vec<DVec3> =
                (0..8).map(|i| world.transform_point3(DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64))).collect();
            let middle = world.transform_point3(DVec3::splat(0.5));
            for p in &scene.patches {
                prop_assert_eq!(p.corners.len(), 4);
                let centre = pose.point(p.corners_in_body().sum::<DVec3>() / 4.0);
                prop_assert!(pose.direction(p.frame.normal).dot(centre - middle) > 0.0);
                for corner in p.corners_in_body().map(|c| pose.point(c)) {
                    prop_assert!(wanted.iter().any(|w| w.distance(corner) < 1e-11), "{corner} is not in {wanted:?}");
                }
            }
            wanted.retain(|w| !scene.patches.iter().flat_map(|p| p.corners_in_body()).any(|c| pose.point(c).distance(*w) < 1e-11));
            prop_assert!(wanted.is_empty());
        }
    }
}
