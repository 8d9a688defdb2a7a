//! Whether a session that follows a motion agrees with one that begins where it ends.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use relume_core::scene::Scene;
use relume_core::session::{Difference, FrameReport, Session, Snapshot, compare};

use crate::common::audit::{Audit, audit};
use crate::common::leaf_area;
use crate::common::pairs::first_differences;
use crate::random_motion::recipe::Recipe;

/// What was seen, so that a run which checks nothing is noticed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    pub(crate) motions: u64,
    pub(crate) promoted: u64,
    pub(crate) demoted: u64,
    pub(crate) occluded: u64,
    pub(crate) reaped: u64,
    pub(crate) still: u64,
    pub(crate) certified: u64,
    pub(crate) followed: u64,
    /// Largest difference of radiosities, as a share of what is allowed.
    pub(crate) drift: f64,
}

impl std::ops::AddAssign for Seen {
    fn add_assign(&mut self, other: Seen) {
        self.motions += other.motions;
        self.promoted += other.promoted;
        self.demoted += other.demoted;
        self.occluded += other.occluded;
        self.reaped += other.reaped;
        self.still += other.still;
        self.certified += other.certified;
        self.followed += other.followed;
        self.drift = self.drift.max(other.drift);
    }
}

/// Follows a recipe, comparing with a fresh session after every step.
pub(crate) fn follow(recipe: &Recipe) -> Result<Seen, String> {
    let run = || follow_unguarded(recipe);
    catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or(panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
        Err(format!("panic: {}", text.unwrap_or_default()))
    })
}

fn follow_unguarded(recipe: &Recipe) -> Result<Seen, String> {
    let scene = recipe.scene();
    let mut warm = Session::new(Arc::clone(&scene), recipe.options()).unwrap();
    let mut seen = Seen::default();
    for (k, &time_s) in recipe.times_s.iter().enumerate() {
        let one = warm.step(k as u32, time_s).map_err(|e| e.to_string())?;
        let mut cold = Session::new(Arc::clone(&scene), recipe.options()).unwrap();
        let two = cold.step(k as u32, time_s).map_err(|e| e.to_string())?;
        let drift = agree(
            &scene,
            (&one, &warm.frame().unwrap().solution()),
            (&two, &cold.frame().unwrap().solution()),
        )
        .map_err(|e| format!("step {k} to {time_s} s: {e}{}", first_differences(&warm, &cold)))?;
        match compare(warm.solved().unwrap(), cold.solved().unwrap()) {
            // Of which the bound is another one here.
            None | Some(Difference::Radiosity { .. }) => {}
            Some(found) => return Err(format!("step {k} to {time_s} s: {found}")),
        }
        if k % 5 == 4 {
            // Rows of random scenes may be far off where things coincide or cut each other.
            Audit { row_sum: [0.0; 2], row_excess: 0.0, ..audit(&warm) }.check(0.0);
        }
        if k > 0 {
            seen += Seen {
                motions: 1,
                promoted: one.work.promoted,
                demoted: one.work.demoted,
                occluded: one.work.occlusion_changed,
                reaped: one.elements_reaped,
                still: u64::from(one.work.visited == 0),
                certified: one.work.certified,
                followed: one.work.followed,
                drift,
            };
        }
    }
    Ok(seen)
}

/// Compares a solution with that of a cold build: links bit for bit, radiosities within the bound of
/// both residuals. Returns how much of that bound is used.
pub(crate) fn agree(
    scene: &Scene,
    (one, warm): (&FrameReport, &Snapshot),
    (two, cold): (&FrameReport, &Snapshot),
) -> Result<f64, String> {
    let same = |what: &str, a: &dyn std::fmt::Debug, b: &dyn std::fmt::Debug| {
        let (a, b) = (format!("{a:?}"), format!("{b:?}"));
        if a == b { Ok(()) } else { Err(format!("{what}: {a}, but {b} from scratch")) }
    };
    same("pairs", &one.pairs, &two.pairs)?;
    same("hash", &one.hash, &two.hash)?;
    same("links", &one.links, &two.links)?;
    same("elements", &(one.elements, one.leaves), &(two.elements, two.leaves))?;
    if warm.leaf_offsets != cold.leaf_offsets {
        return Err("other leaves".into());
    }
    let rho_max = scene.materials.iter().flat_map(|m| m.reflectance).fold(0.0, f64::max);
    let (mut flux, mut area) = (0.0, 0.0);
    for leaf in &cold.leaves {
        let a = leaf_area(leaf);
        flux += a * leaf.radiosity.iter().map(|&b| f64::from(b)).sum::<f64>() / 3.0;
        area += a;
    }
    let mean = if area > 0.0 { flux / area } else { 0.0 };
    // The bound rests on row sums of at most 1; they keep to that up to the links' errors.
    let passed_on = (rho_max * (1.0 + two.row_sum_error.unwrap().rms)).min(0.9);
    // Read with bends, which may add as much as they are of what arrives.
    let bound = 2.0 * (one.residual + two.residual) / (1.0 - passed_on) * mean;
    let mut used = 0.0_f64;
    for (l, m) in warm.leaves.iter().zip(&cold.leaves) {
        if l.corners != m.corners {
            return Err("a leaf lies elsewhere".into());
        }
        for (&b, &c) in l.radiosity.iter().zip(&m.radiosity) {
            let (b, c) = (f64::from(b), f64::from(c));
            // Sums of many single-precision numbers in another order.
            let rounding = 1e-5 * (b.abs() + c.abs() + mean) + 1e-30;
            let off = (b - c).abs();
            if off > bound + rounding {
                return Err(format!(
                    "radiosity {b:e}, but {c:e} from scratch; apart {off:e}, allowed {bound:e} (residuals {:e} and {:e}, mean {mean:e})",
                    one.residual, two.residual
                ));
            }
            used = used.max(off / (bound + rounding));
        }
    }
    Ok(used)
}

/// The smallest recipe that still fails, found by leaving out steps and things one by one.
pub(crate) fn reduced(recipe: &Recipe) -> Recipe {
    let mut best = recipe.clone();
    loop {
        let Some(smaller) = smaller(&best).into_iter().find(|r| follow(r).is_err()) else {
            return best;
        };
        best = smaller;
    }
}

fn smaller(recipe: &Recipe) -> Vec<Recipe> {
    let mut out = Vec::new();
    for k in (0..recipe.times_s.len()).rev() {
        let mut r = recipe.clone();
        r.times_s.remove(k);
        out.push(r);
    }
    for k in (0..recipe.things.len()).rev() {
        let mut r = recipe.clone();
        r.things.remove(k);
        out.push(r);
    }
    for k in 0..recipe.things.len() {
        let thing = &recipe.things[k];
        let mut simpler = vec![thing.clone(); 4];
        simpler[0].presence.clear();
        simpler[1].slides = false;
        simpler[2].turns = false;
        simpler[3].rides = false;
        let known = format!("{thing:?}");
        for s in simpler.into_iter().filter(|s| format!("{s:?}") != known) {
            let mut r = recipe.clone();
            r.things[k] = s;
            out.push(r);
        }
    }
    out
}
