//! Margins of verdicts: the change of brightness of a pair's ends up to which its verdict cannot change.
//!
//! Margins are a cache, not part of the state: a pair whose margin covers a change of brightness is not judged again. All numbers
//! are logarithms in steps of 1/240 of an octave, rounded to the safe side when a pair is judged. Changes of brightness are
//! added exactly: an end that brightens and darkens again has the margin that it had.

use super::brightness::Brightness;
use crate::transport::Side;

/// Steps in an octave.
const STEPS: f64 = 240.0;

/// Half an octave up from a power of two, brightness has a value 1.5 times that: log2(1.5) is 140.4 steps. All changes are
/// multiples of [`COARSE`].
const HALF_OCTAVE: i32 = 140;

/// Steps in one that is stored.
const COARSE: i32 = 10;

/// Steps given away to rounding: one, and what [`HALF_OCTAVE`] is off by for source and receiver.
const ROUNDING_STEPS: f64 = 2.0;

/// Margin of a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Margin {
    /// The verdict does not depend on brightness.
    Firm,
    /// Margin of a link.
    Link {
        /// Distance of the errors on both receivers below the threshold, in steps.
        on: [u16; 2],
        /// The margin also bounds the choice of the visibility method, so a change of either sign consumes it.
        both_ways: bool,
    },
    /// Margin of a refined pair.
    Refined {
        /// Distance of the larger error above the threshold, in steps.
        error: u16,
        /// Receiver of the larger error.
        on: Side,
        /// As for links.
        both_ways: bool,
        /// Margin of the choice of the side to refine.
        side: SideMargin,
    },
}

/// Margin of the choice of the side to refine: lead of the refined side over the other when it was judged, and the drift of
/// the two directions of the pair against each other since; in steps of [`COARSE`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SideMargin {
    ahead: u8,
    drift: i8,
}

impl SideMargin {
    /// Margin where there is no choice of a side.
    pub const ENDLESS: SideMargin = SideMargin { ahead: u8::MAX, drift: 0 };

    /// From a margin in steps.
    pub(super) fn new(ahead: u16) -> SideMargin {
        let ahead = (ahead / COARSE as u16).min(u16::from(u8::MAX) - 1);
        SideMargin { ahead: ahead as u8, drift: 0 }
    }

    fn after(self, apart: i32) -> Option<SideMargin> {
        if self == SideMargin::ENDLESS {
            return Some(self);
        }
        let drift = i8::try_from(i32::from(self.drift) + apart / COARSE).ok()?;
        (apart % COARSE == 0 && drift.unsigned_abs() < self.ahead)
            .then_some(SideMargin { drift, ..self })
    }

    fn packed(self) -> u16 {
        u16::from(self.ahead) << 8 | u16::from(self.drift as u8)
    }

    fn unpacked(packed: u16) -> SideMargin {
        SideMargin { ahead: (packed >> 8) as u8, drift: packed as u8 as i8 }
    }
}

impl Margin {
    /// A margin that no change consumes.
    pub const ENDLESS: u16 = u16::MAX >> 2;

    /// Margin of a verdict that does not depend on brightness: distance of the error, of any kind, from the threshold.
    pub fn of_error(is_link: bool, error: u16) -> Margin {
        let side = SideMargin::ENDLESS;
        match is_link {
            true => Margin::Link { on: [error; 2], both_ways: false },
            false => Margin::Refined { error, on: Side::A, both_ways: false, side },
        }
    }

    /// Distance of the error from the threshold, in steps.
    pub fn error(&self) -> u16 {
        match *self {
            Margin::Firm => Margin::ENDLESS,
            Margin::Link { on: [one, two], .. } => one.min(two),
            Margin::Refined { error, .. } => error,
        }
    }

    /// This margin without a choice of the side to refine.
    pub(super) fn on_this_side(self) -> Margin {
        match self {
            Margin::Refined { error, on, both_ways, .. } => {
                Margin::Refined { error, on, both_ways, side: SideMargin::ENDLESS }
            }
            other => other,
        }
    }

    /// Margin between two numbers of which the first is the larger.
    pub fn between(large: f64, small: f64) -> u16 {
        let octaves = libm::log2(large / small);
        // NaN becomes 0.
        (octaves * STEPS - ROUNDING_STEPS).clamp(0.0, f64::from(Margin::ENDLESS - 1)) as u16
    }

    /// In 16 bits for a link, and in 32 for a refined pair.
    pub(super) fn packed(self) -> u32 {
        match self {
            Margin::Firm => u32::MAX,
            Margin::Link { on, both_ways } => {
                let [one, two] = on.map(|on| match on {
                    Margin::ENDLESS => LINK_ENDLESS,
                    on => u32::from(on / COARSE as u16).min(LINK_ENDLESS - 1),
                });
                one | two << 7 | u32::from(both_ways) << 14
            }
            Margin::Refined { error, on, both_ways, side } => {
                let flags = u32::from(on == Side::B) << 14 | u32::from(both_ways) << 15;
                u32::from(side.packed()) << 16 | flags | u32::from(error)
            }
        }
    }

    /// Margin of a link from [`Margin::packed`]; never more than was packed.
    pub(super) fn of_link(packed: u16) -> Margin {
        if packed == u16::MAX {
            return Margin::Firm;
        }
        let on = [packed, packed >> 7].map(|on| match u32::from(on) & LINK_ENDLESS {
            LINK_ENDLESS => Margin::ENDLESS,
            on => on as u16 * COARSE as u16,
        });
        Margin::Link { on, both_ways: packed >> 14 & 1 == 1 }
    }

    /// Margin of a refined pair from [`Margin::packed`]; never more than was packed.
    pub(super) fn of_refined(packed: u32) -> Margin {
        if packed == u32::MAX {
            return Margin::Firm;
        }
        Margin::Refined {
            error: packed as u16 & Margin::ENDLESS,
            on: if packed >> 14 & 1 == 1 { Side::B } else { Side::A },
            both_ways: packed >> 15 & 1 == 1,
            side: SideMargin::unpacked((packed >> 16) as u16),
        }
    }

    /// Rest of the margin after the errors of the pair grew; `None` if the verdict may have changed.
    pub(super) fn after(self, growth: &Growth) -> Option<Margin> {
        match self {
            Margin::Firm => Some(self),
            Margin::Link { on, both_ways } => {
                let left = |k: usize| {
                    let steps = if both_ways { growth.either() } else { growth.on[k].1 };
                    Margin::less(on[k], steps)
                };
                Some(Margin::Link { on: [left(0)?, left(1)?], both_ways })
            }
            Margin::Refined { error, on, both_ways, side } => {
                let shrinks = -growth.on[usize::from(on == Side::B)].0;
                let steps = if both_ways { growth.either() } else { shrinks };
                let error = Margin::less(error, steps)?;
                let side = match growth.apart() {
                    Some(apart) => side.after(apart)?,
                    None if side == SideMargin::ENDLESS => side,
                    None => return None,
                };
                Some(Margin::Refined { error, on, both_ways, side })
            }
        }
    }

    /// Rest of a margin after `steps` of it were consumed; `None` if nothing is left.
    fn less(margin: u16, steps: i32) -> Option<u16> {
        if margin == Margin::ENDLESS {
            return Some(margin);
        }
        let left = i32::from(margin).saturating_sub(steps);
        (left >= 1).then(|| left.min(i32::from(Margin::ENDLESS) - 1) as u16)
    }
}

/// [`Margin::ENDLESS`] in seven bits.
const LINK_ENDLESS: u32 = 127;

/// Change of brightness of a coarse element, in steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shift {
    /// Growth of its radiosity and of the reflected part of it: least and most.
    radiosity: (i32, i32),
    /// Growth of its irradiance: least and most.
    irradiance: (i32, i32),
}

/// Growth of the errors of a pair on either receiver: least and most, in steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Growth {
    on: [(i32, i32); 2],
}

/// A change without bounds: from nothing to something, or back.
const ENDLESS: i32 = 1 << 24;

impl Shift {
    /// Change from one brightness to another; `None` if they are equal.
    pub(super) fn between(before: &Brightness, after: &Brightness) -> Option<Shift> {
        if before == after {
            return None;
        }
        let all = grown(before.radiosity, after.radiosity);
        let part = grown(before.reflected, after.reflected);
        let irradiance = grown(before.irradiance, after.irradiance);
        Some(Shift { radiosity: (all.0.min(part.0), all.1.max(part.1)), irradiance })
    }

    /// Change from one intensity of a punctual light to another; `None` if they are equal.
    pub(super) fn of_light(before: f64, after: f64) -> Option<Shift> {
        let radiosity = grown(before, after);
        (before != after).then_some(Shift { radiosity, irradiance: (0, 0) })
    }
}

/// Growth of a brightness, in steps: least and most.
fn grown(before: f64, after: f64) -> (i32, i32) {
    if before == after {
        (0, 0)
    } else if before <= 0.0 || after <= 0.0 {
        (-ENDLESS, ENDLESS)
    } else {
        let steps = steps(after) - steps(before);
        (steps, steps)
    }
}

/// The logarithm of a brightness, which is a power of two, or 1.5 times one.
fn steps(value: f64) -> i32 {
    let bits = value.to_bits();
    let exponent = (bits >> 52) as i32;
    exponent * STEPS as i32 + (bits >> 51 & 1) as i32 * HALF_OCTAVE
}

impl Growth {
    /// Growth of a pair's errors by the changes of both ends.
    pub(super) fn of_pair(a: &Shift, b: &Shift) -> Growth {
        let one_way = |receiver: &Shift, source: &Shift| {
            let (least, most) = (source.radiosity.0, source.radiosity.1);
            (least - receiver.irradiance.1, most - receiver.irradiance.0)
        };
        Growth { on: [one_way(a, b), one_way(b, a)] }
    }

    /// The largest change in either sense.
    fn either(&self) -> i32 {
        let [one, two] = self.on.map(|(least, most)| most.max(-least));
        one.max(two)
    }

    /// Growth of the first error beyond that of the second; `None` if unknown.
    fn apart(&self) -> Option<i32> {
        let [one, two] = self.on;
        (one.0 == one.1 && two.0 == two.1).then_some(one.0 - two.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(radiosity: f64, irradiance: f64) -> Brightness {
        Brightness { radiosity, reflected: radiosity, irradiance }
    }

    fn growth(on: [(i32, i32); 2]) -> Growth {
        Growth { on }
    }

    #[test]
    fn margins_are_rounded_to_the_safe_side() {
        assert_eq!(Margin::between(2.0, 1.0), 238);
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
        let link = |both_ways| Margin::Link { on: [100, 40], both_ways };
        let left = |margin: Margin, on| margin.after(&growth(on)).map(|m| m.error());
        assert_eq!(left(link(false), [(-500, 30), (-9, -9)]), Some(49));
        assert_eq!(left(link(false), [(0, 0), (40, 40)]), None);
        assert_eq!(left(link(true), [(-30, 20), (0, 0)]), Some(10));
        assert_eq!(left(link(true), [(-40, 20), (0, 0)]), None);
        let refined = |on, both_ways| {
            let side = SideMargin::ENDLESS;
            Margin::Refined { error: 100, on, both_ways, side }
        };
        assert_eq!(left(refined(Side::A, false), [(-30, 500), (-200, 0)]), Some(70));
        assert_eq!(left(refined(Side::B, false), [(-30, 500), (-200, 0)]), None);
        assert_eq!(left(refined(Side::A, true), [(-30, 40), (0, 0)]), Some(60));
    }

    #[test]
    fn what_brightens_and_darkens_again_leaves_margins_as_they_were() {
        let side = SideMargin::new(300);
        let refined = Margin::Refined { error: 300, on: Side::B, both_ways: false, side };
        let link = Margin::Link { on: [320, 710], both_ways: false };
        let lights = [3.0, 4.0, 2.0, 1.5, 3.0].map(|b| light(b, 1.0));
        for margin in [refined, link] {
            let mut now = margin;
            for k in 1..lights.len() {
                let shift = Shift::between(&lights[k - 1], &lights[k]).unwrap();
                now = now.after(&Growth::of_pair(&shift, &Shift::default())).unwrap();
                let packed = now.packed();
                now = if margin == link {
                    Margin::of_link(packed as u16)
                } else {
                    Margin::of_refined(packed)
                };
                assert_eq!(now == margin, k == 4, "{now:?}");
            }
        }
        // Two octaves are more than the side is ahead.
        let far = Shift::between(&light(1.0, 1.0), &light(4.0, 1.0)).unwrap();
        assert_eq!(refined.after(&Growth::of_pair(&Shift::default(), &far)), None);
    }

    #[test]
    fn packing_never_adds_to_a_margin() {
        let ahead = [0, 9, 10, 3000].map(SideMargin::new);
        for error in [0, 7, 10, 1234, 1265, Margin::ENDLESS - 1, Margin::ENDLESS] {
            for both_ways in [false, true] {
                let link = Margin::Link { on: [error, 20], both_ways };
                let Margin::Link { on, both_ways: kept } = Margin::of_link(link.packed() as u16)
                else {
                    panic!("{link:?}")
                };
                let endless = error == Margin::ENDLESS;
                assert!(
                    on[0] <= error && (on[0] + 10 > error.min(1260) || error > 1260),
                    "{error} {on:?}"
                );
                assert_eq!(
                    (on[0] == error && on[1] == 20, kept),
                    (endless || error == 0 || error == 10, both_ways)
                );
                for side in ahead {
                    let refined = Margin::Refined { error, on: Side::B, both_ways, side };
                    assert_eq!(Margin::of_refined(refined.packed()), refined);
                }
            }
        }
        assert_eq!(Margin::of_link(Margin::Firm.packed() as u16), Margin::Firm);
        assert_eq!(Margin::of_refined(Margin::Firm.packed()), Margin::Firm);
    }

    #[test]
    fn a_brighter_source_and_a_darker_receiver_make_errors_larger() {
        let up = Shift::between(&light(1.0, 1.0), &light(2.0, 1.0)).unwrap();
        let down = Shift::between(&light(1.0, 2.0), &light(1.0, 1.0)).unwrap();
        let grown = Growth::of_pair(&down, &up);
        assert_eq!((grown.on, grown.apart()), ([(480, 480), (0, 0)], Some(480)));
        let woken = Shift::between(&light(0.0, 1.0), &light(1.0, 1.0)).unwrap();
        let grown = Growth::of_pair(&woken, &Shift::default());
        assert_eq!((grown.on, grown.apart()), ([(0, 0), (-ENDLESS, ENDLESS)], None));
        assert_eq!(Shift::between(&light(1.0, 1.0), &light(1.0, 1.0)), None);
    }
}
