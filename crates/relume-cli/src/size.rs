//! How much there is to solve, said before it begins where it is much.

use std::time::Duration;

use indicatif::{HumanBytes, HumanDuration};
use relume::scene::Scene;
use relume::session::{Estimate, Options};

use crate::clip::Clip;
use crate::memory;
use crate::output::{self, count};

/// Seconds for the first frame, as estimated, from which on it is said.
const LONG_S: f64 = 60.0;

/// What the first frame of a clip is estimated to take.
pub(crate) struct Size(Estimate);

impl Size {
    /// Of a clip solved with these options.
    pub(crate) fn of(clip: &Clip, options: &Options) -> Size {
        Size::of_scene(&clip.scene, clip, options)
    }

    /// The same of another form of the clip's scene.
    pub(crate) fn of_scene(scene: &Scene, clip: &Clip, options: &Options) -> Size {
        let first = clip.frames.first().map_or(0.0, |&frame| clip.time_of(frame));
        Size(Estimate::of(scene, first, options))
    }

    /// Pairs that are likely.
    pub(crate) fn pairs(&self) -> f64 {
        middle(self.0.pairs.map(|pairs| pairs as f64))
    }

    /// Says on stderr what it will take, where that is minutes or more than there may be; `frames` are those
    /// that are left to do, and `or` is what else may be done.
    pub(crate) fn warn(&self, clip: &Clip, frames: usize, or: &str) {
        let line =
            if frames > 0 { self.warning(clip.threads, memory::limit_bytes()) } else { None };
        if let Some(line) = line {
            output::complain(&(line + or));
        }
    }

    fn warning(&self, threads: usize, limit_bytes: Option<u64>) -> Option<String> {
        let Estimate { patches, pairs, bytes, core_seconds, by_refinement, .. } = self.0;
        let seconds = core_seconds.map(|s| s / threads.max(1) as f64);
        let fits = match limit_bytes {
            Some(limit) if bytes[0] > limit => ", more than --max-memory allows",
            Some(limit) if middle(bytes.map(|b| b as f64)) > limit as f64 => {
                ", likely more than --max-memory allows"
            }
            _ => "",
        };
        if middle(seconds) < LONG_S && fits.is_empty() {
            return None;
        }
        let remedy = match by_refinement {
            true => "a coarser --tolerance takes less",
            false => "fewer polygons take less: --hide NODE, or simplify the meshes",
        };
        let [few, many] = likely(pairs.map(|p| p as f64)).map(|p| round(p as u64));
        let [short, long] = likely(seconds)
            .map(|s| HumanDuration(Duration::from_secs_f64(s.clamp(1.0, 1e9))).to_string());
        let [little, much] = likely(bytes.map(|b| b as f64)).map(|b| HumanBytes(b as u64));
        Some(format!(
            "warning: {} patches make {few} to {many} pairs to look at: the first frame takes an estimated {short} to \
             {long} and {little} to {much} of memory{fits}; {remedy}",
            count(patches)
        ))
    }
}

/// Geometric mean.
fn middle([low, high]: [f64; 2]) -> f64 {
    (low * high).sqrt()
}

/// By what factor measured numbers of pairs are off the middle of what is estimated, at most (docs/performance.md).
const OFF: f64 = 3.0;

/// The part of a range that is likely.
fn likely([low, high]: [f64; 2]) -> [f64; 2] {
    let middle = middle([low, high]);
    [low.max(middle / OFF), high.min(middle * OFF)]
}

/// Two digits, in words where there are many.
fn round(pairs: u64) -> String {
    let short = |unit: f64, name: &str| {
        let number = pairs as f64 / unit;
        let digits = if number < 9.95 { 1 } else { 0 };
        format!("{number:.digits$} {name}")
    };
    match pairs {
        0..1_000_000 => count(pairs),
        1_000_000..1_000_000_000 => short(1e6, "million"),
        _ => short(1e9, "billion"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(pairs: [u64; 2], seconds: [f64; 2], bytes: [u64; 2], by_refinement: bool) -> Size {
        Size(Estimate {
            patches: 33_000,
            facing: 1,
            pairs,
            bytes,
            core_seconds: seconds,
            by_refinement,
        })
    }

    #[test]
    fn little_is_not_worth_a_word() {
        let little = size([1_000, 9_000], [0.1, 9.0], [1 << 20, 4 << 20], true);
        assert_eq!(little.warning(2, None), None);
        assert_eq!(little.warning(2, Some(1 << 30)), None);
        let text = little.warning(2, Some(1 << 19)).unwrap();
        assert!(
            text.contains("of memory, more than --max-memory allows; a coarser --tolerance"),
            "{text}"
        );
        assert!(little.warning(2, Some(3 << 19)).unwrap().contains("likely more than"));
    }

    #[test]
    fn much_is_said_with_what_helps() {
        let much =
            size([430_000_000, 1_200_000_000], [3_600.0, 72_000.0], [20 << 30, 200 << 30], false);
        assert_eq!(
            much.warning(2, None).unwrap(),
            "warning: 33,000 patches make 430 million to 1.2 billion pairs to look at: the first frame takes an estimated \
             45 minutes to 7 hours and 21.08 GiB to 189.74 GiB of memory; fewer polygons take less: --hide NODE, or \
             simplify the meshes"
        );
        // More threads, less time.
        assert_eq!(size([1; 2], [100.0; 2], [1; 2], false).warning(8, None), None);
    }
}
