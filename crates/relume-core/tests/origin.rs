//! Scenes far from the origin: at map coordinates.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use relume_core::geometry::Aabb;
use relume_core::scene::draft::{Draft, DraftNode, DraftSurface};
use relume_core::scene::{Interpolation, Material, MaterialId, Scene, Track};
use relume_core::session::Session;

use crate::common::{at_tolerance, v};

/// What UTM says of a place, metres.
const AWAY: DVec3 = DVec3::new(500_003.0, 100.0, -5_500_001.5);

/// A closed room of 4 x 2.5 x 3 m that looks inwards, or a box of so many metres that looks outwards.
fn cuboid(low: DVec3, high: DVec3, inward: bool) -> Vec<Vec<DVec3>> {
    let p = |k: usize| {
        let pick = |axis: usize| if k >> axis & 1 == 0 { low[axis] } else { high[axis] };
        v(pick(0), pick(1), pick(2))
    };
    let sides =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let turned = |mut side: Vec<DVec3>| {
        if inward {
            side.reverse();
        }
        side
    };
    sides.iter().map(|side| turned(side.iter().map(|&k| p(k)).collect())).collect()
}

/// A room with a lamp and a box that slides, at a place.
fn draft(at: DVec3, near_origin: bool) -> Draft {
    let material = |name: &str, reflectance: f64, exitance: f64| Material {
        name: name.to_owned(),
        reflectance: [reflectance; 3],
        exitance: [exitance; 3],
        glow: None,
        double_sided: false,
    };
    let node = |name: &str, parent: Option<usize>, material: u32, polygons: Vec<Vec<DVec3>>| {
        let mut node = DraftNode::still(name, parent, DVec3::ZERO, DQuat::IDENTITY);
        let material = MaterialId(material);
        let (tints, prints) = (Vec::new(), Vec::new());
        node.surfaces.push(DraftSurface { name: None, material, polygons, tints, prints });
        node
    };
    let down = [v(1.0, 2.4, 1.0), v(1.5, 2.4, 1.0), v(1.5, 2.4, 1.5), v(1.0, 2.4, 1.5)];
    let mut slider = node("box", None, 0, cuboid(v(2.0, 0.0, 1.0), v(2.5, 0.5, 1.5), false));
    slider.translation_track = Some(Track {
        times_s: vec![0.0, 1.0],
        values: vec![at, at + v(0.5, 0.0, 0.25)],
        interpolation: Interpolation::Linear,
    });
    Draft {
        name: "room".into(),
        nodes: vec![
            DraftNode::still("root", None, at, DQuat::IDENTITY),
            node("room", Some(0), 0, cuboid(DVec3::ZERO, v(4.0, 2.5, 3.0), true)),
            node("lamp", Some(0), 1, vec![down.to_vec()]),
            slider,
        ],
        materials: vec![material("grey", 0.5, 0.0), material("glow", 0.3, 60.0)],
        near_origin,
        ..Draft::default()
    }
}

#[test]
fn at_map_coordinates_links_are_those_about_the_origin() {
    let far = Scene::from_draft(draft(AWAY, true)).unwrap();
    assert!(far.notes.iter().any(|n| n.code == "far-origin"), "{:?}", far.notes);
    let near = Scene::from_draft(draft(AWAY - far.origin, false)).unwrap();
    assert_eq!(near.origin, DVec3::ZERO);
    let Aabb { lo: low, hi: high } = far.bounds(0.0).unwrap();
    assert!((far.origin + low - AWAY).length() < 1e-6 && high.abs().max_element() < 16.0, "{low}");
    let [mut far, mut near] =
        [far, near].map(|scene| Session::new(Arc::new(scene), at_tolerance(0.05)).unwrap());
    for time_s in [0.0, 0.7] {
        let [far, near] = [&mut far, &mut near].map(|s| s.step(0, time_s).unwrap());
        assert_eq!(far.hash, near.hash, "{time_s}");
        let energy = far.energy.unwrap();
        assert!((energy.absorbed_w / energy.emitted_w - 1.0).abs() < 2e-3, "{energy:?}");
    }
}

#[test]
fn what_lies_near_the_origin_stays_and_what_stays_far_is_told() {
    let near = Scene::from_draft(draft(v(30.0, 0.0, -9.0), true)).unwrap();
    assert_eq!(near.origin, DVec3::ZERO);
    assert!(near.notes.iter().all(|n| n.code != "far-origin"));
    let far = Scene::from_draft(draft(AWAY, false)).unwrap();
    assert_eq!(far.origin, DVec3::ZERO);
    assert!(far.notes.iter().any(|n| n.code == "far-origin" && n.message.contains("origin")));
}

#[test]
fn what_lies_further_out_than_any_scene_may_be_is_refused() {
    let refused = Scene::from_draft(draft(v(1e39, 0.0, 0.0), true)).unwrap_err().to_string();
    assert!(refused.contains("1e39") && refused.contains("more than 1e12"), "{refused}");
    assert!(Scene::from_draft(draft(v(1e9, 0.0, 0.0), true)).is_ok());
}

#[test]
fn corners_far_out_in_their_meshes_are_coarse() {
    let mut far = draft(DVec3::ZERO, true);
    for corner in far.nodes.iter_mut().flat_map(|n| &mut n.surfaces).flat_map(|s| &mut s.polygons) {
        corner.iter_mut().for_each(|c| *c = (*c + AWAY).as_vec3().as_dvec3());
    }
    let far = Scene::from_draft(far).unwrap();
    assert!(far.notes.iter().any(|n| n.code == "coarse-corners"), "{:?}", far.notes);
    assert!(far.origin.distance(AWAY) < 16.0);
}
