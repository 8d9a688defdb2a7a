//! An overview of a scene without a camera: the view that shows most of what is lit.
//!
//! A pure function of the scene, fixed over its animation, and found before anything is solved, so that
//! it depends on no tolerance and on no frame that was asked for. The steps, each in a file of its own:
//!
//! | file | one sentence |
//! |---|---|
//! | `caster` | what a ray meets first, at one instant |
//! | `preview` | a rough solution on some thousand points: direct light and a few bounces |
//! | `candidates` | views from around the scene and from free space within |
//! | `score` | how much of what is lit a view shows |
//!
//! Cost: bounded but for a hierarchy of boxes over all patches: some million rays for each of up to three
//! instants.

pub(super) mod bounds;
mod candidates;
pub(super) mod caster;
pub(super) mod preview;
mod score;

use glam::DVec3;
use rayon::prelude::*;
use relume_core::scene::Scene;

use super::camera::View;
use super::tuning::{FINALISTS, GLOW, INSTANTS, SKIN};
use bounds::Bounds;
use candidates::Candidate;
use score::{Size, Stage};

/// A view chosen for a scene, and whether there is light in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overview {
    /// The view.
    pub view: View,
    /// Share of the picture that shows surfaces on which light is to be expected, at the start of the
    /// animation; `None` where nothing emits. An estimate.
    pub lit: Option<f64>,
}

/// Differences of scores that are none: nearly equal candidates, as in a symmetric room, are not told
/// apart by rounding, and the first one wins.
const SAME: f64 = 1e-4;

impl Overview {
    /// Chooses a view for a scene, fixed over its whole animation; deterministic.
    ///
    /// Views from outside hold the bounds of everything over the whole animation; those from inside
    /// are taken from points with much in sight all around. Of all of them the one is taken that shows
    /// most of the lit surface and fewest black pixels and backs of faces, judged by a rough solution at
    /// up to three instants. Light from outside counts, what stands for it does not. Where nothing emits every surface counts the same.
    /// Of a large plane with small things on it the things are shown, and what glows on its outside is no room.
    pub fn of(scene: &Scene) -> Overview {
        let outside = scene.outside.as_deref();
        let near = outside.map(|_| scene.without_outside());
        let scene = near.as_ref().unwrap_or(scene);
        let Some(bounds) = Bounds::swept(scene).map(|whole| whole.focused(scene)) else {
            let view = View::look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 0.7);
            return Overview { view, lit: None };
        };
        let duration_s = scene.motion.duration_s;
        let instants = if duration_s > 0.0 { INSTANTS } else { 1 };
        let time_s = |k: u32| duration_s * f64::from(k) / f64::from(instants);
        let stages: Vec<Stage> =
            (0..instants).map(|k| Stage::new((scene, outside), time_s(k), &bounds)).collect();
        let mut views = bounds.outside();
        let glows_outwards = stages[0].lamps_seen(views.iter().map(|of| &of.view)) > GLOW;
        views.extend(bounds.inside(&stages[0]));
        let scores = |views: &[Candidate], size| scores(&stages, views, size, glows_outwards);
        let rough = scores(&views, Size::ROUGH);
        let mut order: Vec<usize> = (0..views.len()).collect();
        // Stable: of equals the first.
        order.sort_by(|&a, &b| rough[b].total_cmp(&rough[a]));
        order.truncate(FINALISTS);
        order.sort_unstable();
        let finalists: Vec<Candidate> = order.iter().map(|&k| views[k]).collect();
        let view = finalists[first_best(&scores(&finalists, Size::FINE))].view;
        Overview { view, lit: stages[0].lit_share(&view) }
    }
}

/// The score of each view, over all instants; of what glows outwards the inner side is nothing to show.
fn scores(stages: &[Stage<'_>], views: &[Candidate], size: Size, glows_outwards: bool) -> Vec<f64> {
    let score = |of: &Candidate, stage: &Stage<'_>| {
        let score = stage.score(&of.view, size) - of.oddness;
        match of.within && glows_outwards {
            true => score - SKIN * stage.reverse_share(&of.view),
            false => score,
        }
    };
    let sum = |of: &Candidate| stages.iter().map(|stage| score(of, stage)).sum();
    views.par_iter().map(sum).collect()
}

/// The first of the best.
fn first_best(scores: &[f64]) -> usize {
    (0..scores.len()).fold(0, |best, k| if scores[k] > scores[best] + SAME { k } else { best })
}
