//! What can be said of a pair until coming ticks, whatever space it is in.

use crate::element::ElementId;
use crate::geometry::Aabb;
use crate::predict::{MotionBounds, Tick};
use crate::scene::Drift;

/// What was found of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// Nothing that moved concerns it: it stays as it is, with all pairs below it, while its ends
    /// rest against each other and no body that moves comes between them.
    Unaffected,
    /// Nothing stands between its ends: V is 1, of all pairs below it too.
    Clear,
    /// It is culled.
    Culled,
}

/// What can be said of pairs of a space until each of the coming ticks.
pub(crate) trait CertificateTests {
    /// How far bodies can get until then.
    fn motion_bounds(&self) -> &MotionBounds;
    /// Whether two ends rest against each other up to a horizon.
    fn rest(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;
    /// Whether a body that moves against the ends, which rest against each other, may enter their shaft.
    fn is_entered(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;
    /// Whether nothing at all may get between the ends.
    fn stays_clear(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;
    /// Whether one end stays behind the other, as it is now, or absent.
    fn stays_away(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;

    /// The last of the coming ticks until which a finding stands; 0 if that is none.
    fn until(&self, a: ElementId, b: ElementId, finding: Finding) -> Tick {
        let stands = |&h: &usize| match finding {
            Finding::Unaffected => self.rest(h, a, b) && !self.is_entered(h, a, b),
            Finding::Clear => self.stays_clear(h, a, b),
            Finding::Culled => self.rest(h, a, b) || self.stays_away(h, a, b),
        };
        let last = self.motion_bounds().horizons().take_while(stands).last();
        last.map_or(0, |h| self.motion_bounds().until(h))
    }
}

/// Displacements of both ends of a pair and of what may come between within one horizon, all seen from
/// something that does not turn.
pub(crate) struct Moves {
    pub(crate) a: Aabb,
    pub(crate) b: Aabb,
    pub(crate) c: Aabb,
    pub(crate) turning: (bool, bool, bool),
}

impl Moves {
    /// From where both ends can get, and whether they ride on what may come between, and from where that
    /// can get.
    pub(crate) fn new(a: (Drift, bool), b: (Drift, bool), c: Drift) -> Moves {
        let turns = |d: Drift| matches!(d, Drift::Turns(_));
        let turning = (turns(a.0), turns(b.0), turns(c));
        let none = Drift::Rests.reach();
        match c {
            // Seen from what may come between.
            Drift::Slides(by) => {
                let seen = |(drift, rides): (Drift, bool)| match rides {
                    true => none,
                    false => drift.reach().difference(&by),
                };
                Moves { a: seen(a), b: seen(b), c: none, turning }
            }
            _ => Moves { a: a.0.reach(), b: b.0.reach(), c: c.reach(), turning },
        }
    }
}
