//! How much brighter or darker the ends of a pair may get before its verdict can change.
//!
//! A cache, not part of the state: a pair that withstands a change of brightness is not judged
//! again. All numbers are logarithms in steps of 1/256 of an octave, rounded to the safe side.

use super::brightness::Light;

/// Steps in an octave.
const STEPS: f64 = 256.0;

/// What a verdict withstands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Margin {
    /// By how much the estimate of the error is away from the threshold; 15 bits.
    pub error: u16,
    /// By how much the better side to refine is ahead of the other; 15 bits.
    pub side: u16,
    /// Whether `error` counts both ways: it is also how far the pair is from being looked at in
    /// another way, which a change in either sense may bring about.
    pub both_ways: bool,
}

impl Margin {
    /// Whatever the brightness, the verdict is the same.
    pub const ENDLESS: u16 = u16::MAX >> 1;

    /// A verdict that does not depend on brightness.
    pub const FIRM: Margin =
        Margin { error: Margin::ENDLESS, side: Margin::ENDLESS, both_ways: false };

    /// `error` and `both_ways` in 16 bits.
    pub(super) fn packed(self) -> u16 {
        self.error | u16::from(self.both_ways) << 15
    }

    /// The inverse of [`Margin::packed`].
    pub(super) fn unpacked(packed: u16, side: u16) -> Margin {
        Margin { error: packed & Margin::ENDLESS, side, both_ways: packed >> 15 == 1 }
    }

    /// What is left after the errors of the pair grew by at least and at most so many steps, if its
    /// verdict withstands that.
    pub(super) fn after(self, is_link: bool, (least, most): (i32, i32)) -> Option<Margin> {
        // Of a link the error must not grow; of a refined pair it must not shrink, and its sides must
        // keep their order.
        let growth = match (self.both_ways, is_link) {
            (true, _) => most.max(-least),
            (false, true) => most,
            (false, false) => -least,
        };
        let error = Margin::less(self.error, growth)?;
        Some(Margin { error, side: Margin::less(self.side, most - least)?, ..self })
    }

    /// The margin between two numbers of which the first is the larger.
    pub fn between(large: f64, small: f64) -> u16 {
        let octaves = libm::log2(large / small);
        // One step is given away to rounding; NaN becomes 0.
        (octaves * STEPS - 1.0).clamp(0.0, f64::from(Margin::ENDLESS - 1)) as u16
    }

    /// What is left after the logarithm changed to the worse by `steps`; `None` if that is nothing.
    fn less(margin: u16, steps: i32) -> Option<u16> {
        if margin == Margin::ENDLESS {
            return Some(margin);
        }
        let left = i32::from(margin).saturating_sub(steps);
        (left >= 1).then(|| left.min(i32::from(Margin::ENDLESS) - 1) as u16)
    }
}

/// How the light of a coarse element changed, in steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shift {
    /// The least that its radiosity, or the reflected part of it, grew by.
    pub(super) least: i32,
    /// The most.
    pub(super) most: i32,
    /// How its irradiance grew: at least and at most.
    pub(super) irradiance: (i32, i32),
}

/// A change without bounds: from nothing to something, or back.
const ENDLESS: i32 = 1 << 24;

impl Shift {
    /// From one light to another; `None` if they are the same.
    pub(super) fn between(before: &Light, after: &Light) -> Option<Shift> {
        if before == after {
            return None;
        }
        let grown = |before: f64, after: f64| {
            if before == after {
                (0, 0)
            } else if before <= 0.0 || after <= 0.0 {
                (-ENDLESS, ENDLESS)
            } else {
                let steps = libm::log2(after / before) * STEPS;
                (steps.floor() as i32, steps.ceil() as i32)
            }
        };
        let all = grown(before.radiosity, after.radiosity);
        let part = grown(before.reflected, after.reflected);
        let irradiance = grown(before.irradiance, after.irradiance);
        Some(Shift { least: all.0.min(part.0), most: all.1.max(part.1), irradiance })
    }

    /// What both ends' shifts do to the errors of a pair: the least and the most that the error of
    /// either direction grows by.
    pub(super) fn of_pair(a: &Shift, b: &Shift) -> (i32, i32) {
        let one_way = |receiver: &Shift, source: &Shift| {
            (source.least - receiver.irradiance.1, source.most - receiver.irradiance.0)
        };
        let (one, two) = (one_way(a, b), one_way(b, a));
        (one.0.min(two.0), one.1.max(two.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(radiosity: f64, irradiance: f64) -> Light {
        Light { radiosity, reflected: radiosity, irradiance }
    }

    #[test]
    fn margins_are_rounded_to_the_safe_side() {
        assert_eq!(Margin::between(2.0, 1.0), 255);
        assert_eq!(Margin::between(1.001, 1.0), 0);
        assert_eq!(Margin::between(1.0, 0.0), Margin::ENDLESS - 1);
        assert_eq!(Margin::between(0.0, 0.0), 0);
        assert_eq!(Margin::less(255, 150), Some(105));
        assert_eq!(Margin::less(255, 255), None);
        assert_eq!(Margin::less(0, 0), None);
        assert_eq!(Margin::less(Margin::ENDLESS, ENDLESS), Some(Margin::ENDLESS));
        assert_eq!(Margin::less(Margin::ENDLESS - 1, ENDLESS), None);
    }

    #[test]
    fn links_mind_growth_and_refined_pairs_shrinking() {
        let margin = |both_ways| Margin { error: 100, side: Margin::ENDLESS, both_ways };
        let left = |m: Margin, link, growth| m.after(link, growth).map(|m| m.error);
        assert_eq!(left(margin(false), true, (-500, 30)), Some(70));
        assert_eq!(left(margin(false), false, (-30, 500)), Some(70));
        assert_eq!(left(margin(true), true, (-500, 30)), None);
        assert_eq!(left(margin(true), false, (-30, 40)), Some(60));
        for margin in [margin(true), margin(false), Margin::FIRM] {
            assert_eq!(Margin::unpacked(margin.packed(), margin.side), margin);
        }
    }

    #[test]
    fn a_brighter_source_and_a_darker_receiver_make_errors_larger() {
        let up = Shift::between(&light(1.0, 1.0), &light(2.0, 1.0)).unwrap();
        let down = Shift::between(&light(1.0, 2.0), &light(1.0, 1.0)).unwrap();
        assert_eq!(Shift::of_pair(&down, &up), (0, 512));
        let woken = Shift::between(&light(0.0, 1.0), &light(1.0, 1.0)).unwrap();
        assert_eq!(Shift::of_pair(&woken, &Shift::default()), (-ENDLESS, ENDLESS));
        assert_eq!(Shift::between(&light(1.0, 1.0), &light(1.0, 1.0)), None);
    }
}
