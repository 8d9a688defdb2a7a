//! Tests behind certificates: until which tick a finding on a pair stands, in space or in the plane.

use crate::element::ElementId;
use crate::geometry::Aabb;
use crate::predict::{MotionBounds, Tick};
use crate::scene::Drift;

/// Finding on a pair that a certificate may extend into the future.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// No motion affects the pair: it and all pairs below it stay unchanged while the ends rest against each other and no
    /// moving body comes between them.
    Unaffected,
    /// Nothing stands between the ends: V is 1, for all pairs below it too.
    Clear,
    /// The pair is culled.
    Culled,
}

/// Conservative tests of a pair up to each of the coming ticks (horizons).
pub(crate) trait CertificateTests {
    /// Bounds of the bodies' motion.
    fn motion_bounds(&self) -> &MotionBounds;
    /// Whether two ends rest against each other up to a horizon.
    fn rest(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;
    /// Whether a body that moves against the ends, which rest against each other, may enter their shaft.
    fn is_entered(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;
    /// Whether nothing at all may get between the ends.
    fn stays_clear(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;
    /// Whether one end stays behind the other, as it is now, or absent.
    fn stays_away(&self, horizon: usize, a: ElementId, b: ElementId) -> bool;

    /// Last of the coming ticks until which a finding stands; 0 if none.
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
