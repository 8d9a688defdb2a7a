//! Light in gaps: leaves there are as large as the tolerance of the whole scene allows, and what arrives changes within
//! the width of the gap. Sensors follow light through it.
//!
//! A walk goes from part to part of what is close by. What a part sends is gathered there, from far leaves with exact
//! visibility and from those close by as their lines say; the next step corrects one of these by the difference between what
//! is gathered and what its line says, and so on. The mean over walks is the light that all walks together follow;
//! the better the leaves, the less it scatters (lines as control variates).

use crate::space::{Sensor, Solved};

use super::gather::{Gathered, Look, Part, Purpose};
use super::tuning::{GAP_DARK, GAP_FOLLOWED, GAP_NARROW, GAP_REACH, GAP_WALKS, IN_A_GAP};
use crate::geometry::{at_share, spread};

/// The gap that a sensor is in.
pub(super) struct Gap {
    /// Distance up to which no leaf is taken at its word, metres.
    reach_m: f64,
}

/// Radiosity of a part as a walk finds it, W/m2.
#[derive(Default)]
struct Followed {
    /// By the lines of leaves close by, corrected.
    corrected: [f64; 3],
    /// By what arrives from far along the walk alone, and at its end by lines if it leaves the gap.
    absorbed: [f64; 3],
}

impl Gap {
    /// Of a sensor in no gap.
    pub(super) const NONE: Gap = Gap { reach_m: 0.0 };

    /// The gap around a point, if half of all that it sees is close by.
    pub(super) fn around(solved: &Solved, found: &Gathered) -> Option<Gap> {
        let width_m = found.half_seen_m();
        let near: f64 = found.parts.iter().map(|part| part.factor).sum();
        let length_m = solved.space.reference_area_m2().sqrt();
        match width_m < GAP_NARROW * length_m {
            true => {
                let (least, most) = GAP_REACH;
                let reach_m = (most * width_m).min(length_m).max(least * width_m);
                Some(Gap { reach_m })
            }
            false => (near > IN_A_GAP).then_some(Gap::NONE),
        }
    }

    /// Irradiance at a sensor in the gap, W/m2.
    pub(super) fn irradiance(&self, solved: &Solved, sensor: &Sensor) -> [f64; 3] {
        let look = Look::new(solved, sensor, Purpose::Sensor).reaching(self.reach_m);
        let Gathered { mut sum, parts, .. } = look.gather();
        let far = sum;
        let lines: Vec<[f64; 3]> = parts.iter().map(|part| part.line(solved)).collect();
        for (part, line) in parts.iter().zip(&lines) {
            (0..3).for_each(|c| sum[c] += part.factor * line[c]);
        }
        let factors = || parts.iter().map(|part| part.factor);
        let weight = factors().sum::<f64>() / GAP_WALKS as f64;
        let (by_lines, mut absorbed) = (sum, far);
        for walk in 0..GAP_WALKS {
            let share = (walk as f64 + 0.5) / GAP_WALKS as f64;
            let Some(k) = at_share(factors(), share) else { break };
            let b = self.follow(solved, &parts[k], walk);
            (0..3).for_each(|c| sum[c] += weight * (b.corrected[c] - lines[k][c]));
            (0..3).for_each(|c| absorbed[c] += weight * b.absorbed[c]);
        }
        // Deep inside lines are the means of bright rims: what they correct is all but nothing, and scatters.
        let all = |e: [f64; 3]| e.iter().sum::<f64>();
        match all(absorbed) < GAP_DARK * all(by_lines) {
            true => absorbed,
            false => sum.map(|e| e.max(0.0)),
        }
    }

    /// Radiosity of a part of a leaf, W/m2: by what arrives there, found along walk number `k`.
    pub(super) fn radiosity_of(&self, solved: &Solved, part: &Part, k: usize) -> [f64; 3] {
        self.follow(solved, part, k).corrected
    }

    fn follow(&self, solved: &Solved, part: &Part, k: usize) -> Followed {
        let least_share = GAP_FOLLOWED.0 * solved.space.tuning.tolerance;
        let scene = &solved.space.scene;
        let now = &solved.space.world;
        let (mut b, mut share, mut part) = (Followed::default(), [1.0; 3], *part);
        for step in 0.. {
            let patch = solved.space.forest.patch(part.leaf).expect("an element has a patch");
            let normal = solved.space.view.occluder(patch).plane.normal;
            let patch = &scene.patches[patch.0 as usize];
            let (m, rho) = (now.exitance(scene, patch), now.reflectance(scene, patch));
            let sensor = Sensor { at: part.at, normal };
            let look = Look::new(solved, &sensor, Purpose::Beyond).reaching(self.reach_m);
            let Gathered { sum, near, .. } = look.gather();
            let known = if step == 0 { [0.0; 3] } else { part.line(solved) };
            let seen: f64 = near.iter().map(|n| n.factor).sum();
            let goes_on = self.reach_m > 0.0 || seen > IN_A_GAP;
            for c in 0..3 {
                let by_lines = near.iter().map(|n| n.sent[c]).sum::<f64>();
                let rest = if goes_on { 0.0 } else { by_lines };
                b.corrected[c] += share[c] * (m[c] + rho[c] * (sum[c] + by_lines) - known[c]);
                b.absorbed[c] += share[c] * (m[c] + rho[c] * (sum[c] + rest));
                share[c] *= rho[c] * seen;
            }
            let left = share.iter().fold(0.0, |most: f64, s| most.max(*s));
            if !goes_on || left <= least_share || step == GAP_FOLLOWED.1 {
                return b;
            }
            match look.choose(&near, [spread(k, 2 * step), spread(k, 2 * step + 1)]) {
                Some(next) => part = next,
                None => return b,
            }
        }
        b
    }
}
