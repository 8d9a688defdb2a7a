//! The last two evaluations of a pair, and the line through them.

use super::tuning::EXTRAPOLATED_SHARE_MAX;

/// What an evaluation of a pair found, as far as a line is drawn through it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Exchange area without occlusion, m2; 0 where the pair carries nothing.
    pub exchange_area_m2: f32,
    /// Visibility in 65,535ths.
    pub visibility: u16,
    /// How far its verdict is from changing, in logarithmic steps; [`Sample::FIRM`] if it is not
    /// known to.
    pub margin: u16,
}

impl Sample {
    /// A margin that no line is drawn through.
    pub const FIRM: u16 = u16::MAX;
}

/// When a pair is evaluated again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lookahead {
    /// Present time, seconds.
    pub now_s: f64,
    /// From frame to frame, seconds; positive.
    pub frame_s: f64,
    /// Frames that are extrapolated at most, the next evaluation included; at least 1.
    pub frames: u32,
    /// Error of X V, relative to X, above which a pair is evaluated again; `None` if only predicted
    /// events count.
    pub error: Option<f64>,
}

/// The last two evaluations of a pair, and when the next one is due. Empty unless the pair is dynamic.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History {
    samples: [Sample; 2],
    at_s: [f32; 2],
    due_s: f32,
    count: u8,
}

impl History {
    /// One evaluation alone, as of a pair whose state has just changed: the next one is due with the
    /// next frame.
    pub fn begun(sample: Sample, ahead: &Lookahead) -> History {
        let now = ahead.now_s as f32;
        let due_s = (ahead.now_s + ahead.frame_s) as f32;
        History { samples: [sample; 2], at_s: [now; 2], due_s, count: 1 }
    }

    /// Whether the pair is dynamic: it is evaluated when due, and extrapolated until then.
    pub fn is_live(&self) -> bool {
        self.count > 0
    }

    /// Whether the pair is to be evaluated now.
    pub fn is_due(&self, ahead: &Lookahead) -> bool {
        // A quarter of a frame early is on time: times are rounded.
        f64::from(self.due_s) <= ahead.now_s + 0.25 * ahead.frame_s
    }

    /// Whether it has not been evaluated at the present time, as far as its times tell.
    pub fn is_older_than(&self, ahead: &Lookahead) -> bool {
        self.at_s[1] < ahead.now_s as f32
    }

    /// X and V on the line through both evaluations.
    pub fn extrapolated(&self, ahead: &Lookahead) -> (f32, u16) {
        let (x, v) = self.line(ahead.now_s);
        (x as f32, v.round() as u16)
    }

    /// X (m2) and V (65,535ths) on the line at a time.
    fn line(&self, at_s: f64) -> (f64, f64) {
        let share = self.share(at_s);
        let along = |from: f64, to: f64| from + (to - from) * share;
        let [p, q] = self.samples;
        let x = along(f64::from(p.exchange_area_m2), f64::from(q.exchange_area_m2));
        let v = along(f64::from(p.visibility), f64::from(q.visibility));
        let last = f64::from(q.exchange_area_m2);
        let x =
            x.clamp((1.0 - EXTRAPOLATED_SHARE_MAX) * last, (1.0 + EXTRAPOLATED_SHARE_MAX) * last);
        (x, v.clamp(0.0, 65_535.0))
    }

    /// How far along the line from the first evaluation to the second, in lengths of it.
    fn share(&self, at_s: f64) -> f64 {
        let [start, end] = self.at_s.map(f64::from);
        if end > start { (at_s - start) / (end - start) } else { 1.0 }
    }

    /// Whether nothing changed in the last two evaluations, nor in this one.
    pub fn is_straight_through(&self, sample: &Sample) -> bool {
        let same = |s: &Sample| {
            s.exchange_area_m2 == sample.exchange_area_m2 && s.visibility == sample.visibility
        };
        self.samples.iter().all(same)
    }

    /// Takes in a new evaluation and lets go of the oldest; sets when the next one is due.
    pub fn evaluated(&self, sample: Sample, ahead: &Lookahead) -> History {
        if self.count == 0 {
            return History::begun(sample, ahead);
        }
        if !self.is_older_than(ahead) {
            // It was evaluated at this time already.
            return *self;
        }
        let mut out = History {
            samples: [self.samples[1], sample],
            at_s: [self.at_s[1], ahead.now_s as f32],
            due_s: 0.0,
            count: 2,
        };
        let most = match ahead.error {
            None => f64::from(ahead.frames),
            Some(error) => self.frames_within(error, &sample, ahead),
        };
        let frames = out.frames_to_event(ahead).min(most).floor().max(1.0);
        out.due_s = (ahead.now_s + frames * ahead.frame_s) as f32;
        out
    }

    /// Frames until the line comes to a change of the verdict, or V to 0 or 1.
    fn frames_to_event(&self, ahead: &Lookahead) -> f64 {
        let [start, end] = self.at_s.map(f64::from);
        let [p, q] = self.samples;
        if end <= start {
            return 1.0;
        }
        let frames = |from: f64, to: f64, goal: f64| {
            let slope = (to - from) / (end - start);
            let left = (goal - to) / slope;
            // Where it is already, or moves away from, it does not arrive.
            if left > 0.0 && left.is_finite() { left / ahead.frame_s } else { f64::INFINITY }
        };
        let mut least = f64::INFINITY;
        if p.margin != Sample::FIRM && q.margin != Sample::FIRM {
            least = least.min(frames(f64::from(p.margin), f64::from(q.margin), 0.0));
        }
        let x = [p, q].map(|s| f64::from(s.exchange_area_m2));
        for share in [1.0 - EXTRAPOLATED_SHARE_MAX, 1.0 + EXTRAPOLATED_SHARE_MAX] {
            least = least.min(frames(x[0], x[1], share * x[1]));
        }
        for goal in [0.0, 65_535.0] {
            least = least.min(frames(f64::from(p.visibility), f64::from(q.visibility), goal));
        }
        // The event itself is to be evaluated.
        least.ceil()
    }

    /// Frames until the line may be off by `error`, if it goes on bending as it did up to `sample`.
    fn frames_within(&self, error: f64, sample: &Sample, ahead: &Lookahead) -> f64 {
        if self.count < 2 {
            return 1.0;
        }
        let carried = |x: f64, v: f64| x * v / 65_535.0;
        let (x, v) = self.line(ahead.now_s);
        let found = f64::from(sample.exchange_area_m2);
        let off = carried(x, v) - carried(found, f64::from(sample.visibility));
        // What bends with c is off by c (t - t0) (t - t1) at t.
        let [start, end] = self.at_s.map(f64::from);
        let (last, now) = (ahead.now_s - end, ahead.now_s);
        let bend = off.abs() / ((now - start) * last).max(f64::MIN_POSITIVE);
        let allowed = error * found.max(f64::from(f32::MIN_POSITIVE)) / bend.max(f64::MIN_POSITIVE);
        // t^2 + last t = allowed.
        let reach = (0.25 * last * last + allowed).sqrt() - 0.5 * last;
        // One good guess may be luck: not more than twice as far as the last time.
        (reach / ahead.frame_s).min(2.0 * last / ahead.frame_s + 1.0).min(f64::from(ahead.frames))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(frame: u32, frames: u32, error: Option<f64>) -> Lookahead {
        Lookahead { now_s: f64::from(frame) * 0.04, frame_s: 0.04, frames, error }
    }

    fn sample(x: f32, v: f64, margin: u16) -> Sample {
        Sample { exchange_area_m2: x, visibility: (v * 65_535.0) as u16, margin }
    }

    /// The frames at which a pair is evaluated that is found to be as `of` says.
    fn evaluated(of: impl Fn(u32) -> Sample, frames: u32, error: Option<f64>) -> Vec<u32> {
        let mut history = History::begun(of(0), &at(0, frames, error));
        let mut out = Vec::new();
        for frame in 1..40 {
            let ahead = at(frame, frames, error);
            if history.is_due(&ahead) {
                history = history.evaluated(of(frame), &ahead);
                out.push(frame);
            }
        }
        out
    }

    #[test]
    fn a_straight_change_is_evaluated_every_seventh_frame() {
        let straight = |f: u32| sample(1.0 + 0.01 * f as f32, 1.0, Sample::FIRM);
        assert_eq!(evaluated(straight, 7, None), [1, 8, 15, 22, 29, 36]);
        let mut history = History::begun(straight(0), &at(0, 7, None));
        history = history.evaluated(straight(1), &at(1, 7, None));
        let (x, v) = history.extrapolated(&at(5, 7, None));
        assert!((x - 1.05).abs() < 1e-5 && v == 65_535, "{x} {v}");
        // By a quarter in two or three frames.
        let steep = |f: u32| sample(1.0 + 0.1 * f as f32, 1.0, Sample::FIRM);
        assert_eq!(evaluated(steep, 7, None)[..3], [1, 4, 8]);
    }

    #[test]
    fn the_predicted_event_is_evaluated() {
        // The margin is used up in frame 11, V reaches 0 in frame 20.
        let nearing = |f: u32| sample(1.0, 1.0, 1_100_u32.saturating_sub(100 * f) as u16);
        assert_eq!(evaluated(nearing, 7, None)[..3], [1, 8, 11]);
        let darkening = |f: u32| sample(1.0, (1.0 - 0.05 * f64::from(f)).max(0.0), Sample::FIRM);
        let frames = evaluated(darkening, 9, None);
        assert!(frames.contains(&19) || frames.contains(&20), "{frames:?}");
    }

    #[test]
    fn with_an_error_stated_straight_changes_wait_and_bent_ones_do_not() {
        let straight = |f: u32| sample(1.0 + 0.01 * f as f32, 1.0, Sample::FIRM);
        let few = evaluated(straight, 32, Some(0.001)).len();
        let bent = |f: u32| sample(1.0 + 0.001 * (f * f) as f32, 1.0, Sample::FIRM);
        let many = evaluated(bent, 32, Some(0.001));
        assert!(few < 8 && many.len() > 10, "{few} {many:?}");
        // The stated error is kept.
        let mut history = History::begun(bent(0), &at(0, 32, Some(0.001)));
        for frame in 1..40 {
            let ahead = at(frame, 32, Some(0.001));
            if history.is_due(&ahead) {
                history = history.evaluated(bent(frame), &ahead);
            } else {
                let (x, found) = (history.extrapolated(&ahead).0, bent(frame).exchange_area_m2);
                assert!((x / found - 1.0).abs() < 0.0011, "{frame}: {x} {found}");
            }
        }
    }

    #[test]
    fn values_stay_in_their_range() {
        let mut history = History::begun(sample(0.5, 0.5, 9), &at(0, 7, None));
        history = history.evaluated(sample(0.1, 0.9, 9), &at(1, 7, None));
        assert_eq!(history.extrapolated(&at(5, 7, None)), (0.075, 65_535));
    }
}
