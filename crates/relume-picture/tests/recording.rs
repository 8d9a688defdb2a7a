//! Light at several instants on one triangulation.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use relume_core::session::Snapshot;
use relume_picture::picture::{PatchLight, Recorder, Recording};

use crate::common::*;

/// A snapshot whose irradiance is a function of the place, on leaves as fine as `refine` says.
fn at(time_s: f64, refine: impl Fn(DVec3, f64, u32) -> bool, h: impl Fn(DVec3) -> f32) -> Snapshot {
    let mut snapshot = snapshot(&room(&[]), refine, |_, _, _| [0.0; 3]);
    snapshot.time_s = time_s;
    let scene = Arc::clone(&snapshot.scene);
    for (k, patch) in scene.patches.iter().enumerate() {
        let own = snapshot.leaf_offsets[k] as usize..snapshot.leaf_offsets[k + 1] as usize;
        let slope = |p: DVec2, way: DVec2| {
            let step = |s: f64| h(patch.frame.point(p + s * way));
            step(0.5) - step(-0.5)
        };
        for leaf in &mut snapshot.leaves[own] {
            let middle = leaf.centroid();
            leaf.irradiance = [h(patch.frame.point(middle)); 3];
            leaf.irradiance_gradient = [[slope(middle, DVec2::X); 3], [slope(middle, DVec2::Y); 3]];
        }
    }
    snapshot
}

fn record(snapshots: &[Snapshot]) -> Recording {
    let mut recorder = Recorder::default();
    snapshots.iter().for_each(|snapshot| recorder.add(snapshot));
    recorder.finish().unwrap()
}

/// Area of a patch's triangles, m2.
fn area(of: &PatchLight) -> f64 {
    let twice = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|k| of.points[k as usize]);
        (b - a).cross(c - a).length()
    };
    of.triangles.iter().map(twice).sum::<f64>() / 2.0
}

/// Coarse where the other is fine and the other way round: a straight field is right at every point at both instants, and the
/// triangles are the same.
#[test]
fn leaves_of_all_instants_make_one_mesh() {
    let field = |p: DVec3| (20.0 + p.x + 2.0 * p.y - p.z) as f32;
    let left = |centre: DVec3, _: f64, level: u32| level < 1 || (level < 3 && centre.x < 1.0);
    let right = |centre: DVec3, _: f64, level: u32| level < 1 || (level < 3 && centre.x > 3.0);
    let recording = record(&[at(0.0, left, field), at(0.5, right, |p| 2.0 * field(p))]);
    assert_eq!(recording.times_s, [0.0, 0.5]);
    let (mut whole, mut points) = (0.0, 0);
    for of in &recording.patches {
        whole += area(of);
        points += of.points.len();
        for (k, times) in [(0, 1.0), (1, 2.0)] {
            // The lamp's sides are as thin as leaves are long: there no straight field comes back.
            if area(of) < 1.5 {
                continue;
            }
            for (p, h) in of.points.iter().zip(of.irradiance[k].iter()) {
                let wanted = times * field(*p);
                assert!((h[0] - wanted).abs() < 2e-4 * wanted, "{h:?} at {p} is not {wanted}");
            }
        }
    }
    assert!((whole - recording.scene.area_m2()).abs() < 1e-6 * whole, "{whole}");
    let alone = record(&[at(0.0, left, field)]);
    assert!(points > alone.patches.iter().map(|of| of.points.len()).sum());
}

/// Every edge inside a patch has a triangle on either side that shares its points: no place has two values.
#[test]
fn light_is_continuous_over_each_patch() {
    let recording = record(&[at(0.0, uneven, |p| (3.0 + p.x.sin()) as f32)]);
    for of in &recording.patches {
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for t in &of.triangles {
            edges.extend((0..3).map(|k| [t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3])]));
        }
        edges.sort_unstable();
        let patch = &recording.scene.patches[of.patch.0 as usize];
        let corners: Vec<DVec3> = patch.corners_in_body().collect();
        let on_edge = |p: DVec3| {
            (0..corners.len()).any(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                (p - a).cross(b - a).length() < 1e-9 * a.distance(b)
            })
        };
        for edge in edges.chunk_by(|a, b| a == b) {
            let [a, b] = edge[0].map(|k| of.points[k as usize]);
            let wanted = if on_edge(a.midpoint(b)) { 1 } else { 2 };
            assert_eq!(edge.len(), wanted, "between {a} and {b}");
        }
    }
}

/// No point of a patch lies on an edge of another that does not end there: a crack would open beside it. The walls of the room are of
/// one body, and other leaves meet along their edges.
#[test]
fn patches_that_adjoin_have_the_same_points_there() {
    let recording = record(&[at(0.0, uneven, |_| 1.0)]);
    let points: Vec<DVec3> = recording.patches.iter().flat_map(|of| of.points.clone()).collect();
    // What is as good as one place is one, to the last bit.
    let mut near = points.clone();
    near.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    near.dedup();
    for (k, p) in near.iter().enumerate() {
        let others = near[k + 1..].iter().take_while(|q| q.x - p.x < 1e-9);
        assert!(others.into_iter().all(|q| q.distance(*p) > 1e-9), "{p:?}");
    }
    let mut between = 0;
    for of in &recording.patches {
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for t in &of.triangles {
            edges.extend((0..3).map(|k| [t[k], t[(k + 1) % 3]]));
        }
        for [a, b] in edges.iter().filter(|[a, b]| !edges.contains(&[*b, *a])) {
            let [a, b] = [a, b].map(|k| of.points[*k as usize]);
            let is_on = |p: &&DVec3| {
                let share = (**p - a).dot(b - a) / (b - a).length_squared();
                let off = p.distance(a.lerp(b, share));
                off < 1e-7 && share > 1e-5 && share < 1.0 - 1e-5
            };
            assert_eq!(points.iter().find(is_on), None, "between {a} and {b}");
            between += 1;
        }
    }
    assert!(between > 500, "{between}");
}

/// Where light stays as it is, what is kept is the same, and radiosity is that of the material.
#[test]
fn light_that_does_not_change_is_kept_once() {
    let coarse = |_: DVec3, _: f64, level: u32| level < 2;
    let one = |p: DVec3| if p.x < 0.5 { 7.0 } else { 5.0 + p.y as f32 };
    let other = |p: DVec3| if p.x < 0.5 { 7.0 } else { 6.0 + p.y as f32 };
    let recording = record(&[at(0.0, coarse, one), at(1.0, coarse, other)]);
    let same = |of: &&PatchLight| Arc::ptr_eq(&of.irradiance[0], &of.irradiance[1]);
    let kept: Vec<&PatchLight> = recording.patches.iter().filter(same).collect();
    assert_eq!(kept.len(), 1, "the left wall");
    let red = recording.radiosity(kept[0], 1);
    assert!(red.iter().all(|b| (b[0] - 0.6 * 7.0).abs() < 1e-5 && (b[1] - 0.7).abs() < 1e-6));
}
