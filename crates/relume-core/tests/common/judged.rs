//! What the judge is told of a scene: its polygons in the world, and nothing that the engine made.

use relume_core::scene::{PatchId, Scene};
use relume_judge::Polygon;

/// The patches of a scene at a time, in their order; those of absent bodies must not be there.
pub(crate) fn polygons(scene: &Scene, time_s: f64) -> Vec<Polygon> {
    let polygon = |patch: &relume_core::scene::Patch| {
        let pose = scene.pose(patch.body, time_s).expect("every body is present");
        Polygon {
            corners: patch.corners_in_body().map(|c| pose.point(c)).collect(),
            reflectance: scene.reflectance(patch),
            exitance: scene.exitance_at(patch, 0.0),
            twin: patch.twin.map(|PatchId(k)| k as usize),
        }
    };
    scene.patches.iter().map(polygon).collect()
}
