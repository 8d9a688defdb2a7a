//! Means over equal cells of every patch: asked of the judge, and found in a solution.

use relume_core::scene::{PatchId, Scene};
use relume_core::session::Session;
use relume_judge::path::{Estimate, Site};

use crate::common::{judged, rms};
use crate::validation::cells::Cells;

/// How many cells there are along each side of a patch of a named surface.
pub(crate) type Sides = fn(&str) -> usize;

fn side_of(scene: &Scene, patch: usize, sides: Sides) -> usize {
    sides(&scene.surfaces[scene.patches[patch].surface.0 as usize].name)
}

/// The cells of all patches at a time, row by row; rectangular patches only.
pub(crate) fn sites(scene: &Scene, time_s: f64, sides: Sides) -> Vec<Site> {
    let mut out = Vec::new();
    for (k, polygon) in judged::polygons(scene, time_s).iter().enumerate() {
        let side = side_of(scene, k, sides);
        let (o, c) = (polygon.corners[0], &polygon.corners);
        let (u, v) = ((c[1] - o) / side as f64, (c[3] - o) / side as f64);
        let at = |k: usize| o + u * (k % side) as f64 + v * (k / side) as f64;
        out.extend((0..side * side).map(|k| Site::mean(at(k), u, v)));
    }
    out
}

/// Mean irradiance over the same cells in a solution and over the channels, W/m2.
pub(crate) fn found(session: &Session, sides: Sides) -> Vec<f64> {
    let snapshot = session.frame().unwrap().solution();
    let scene = &snapshot.scene;
    let mut grids: Vec<(usize, Cells)> = Vec::new();
    let mut out = Vec::new();
    for k in 0..scene.patches.len() {
        let side = side_of(scene, k, sides);
        if !grids.iter().any(|g| g.0 == side) {
            grids.push((side, Cells::of(&snapshot, side)));
        }
        let grid = grids.iter().find(|g| g.0 == side).expect("just put there");
        out.extend_from_slice(grid.1.of_patch(PatchId(k as u32)));
    }
    out
}

/// Mean over the channels.
pub(crate) fn grey(rgb: [f64; 3]) -> f64 {
    rgb.iter().sum::<f64>() / 3.0
}

/// Root mean square of relative errors, with the reference's own variance taken out; of means over the
/// channels, as [`found`] gives them.
pub(crate) fn error(found: &[f64], reference: &[Estimate]) -> f64 {
    assert_eq!(found.len(), reference.len());
    let pairs = found.iter().zip(reference);
    let off: Vec<f64> = pairs.map(|(h, r)| h / grey(r.irradiance) - 1.0).collect();
    (rms(&off).powi(2) - own_error(reference).powi(2)).max(0.0).sqrt()
}

/// Root mean square of the relative standard errors of a reference; as if the channels erred alike, which
/// they do where one path carries all three.
pub(crate) fn own_error(reference: &[Estimate]) -> f64 {
    let own = reference.iter().map(|r| grey(r.standard_error) / grey(r.irradiance));
    rms(&own.collect::<Vec<f64>>())
}

/// Runs on a pool of one thread.
pub(crate) fn on_one_thread<T: Send>(f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(f)
}
