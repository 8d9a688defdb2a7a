//! Intervals, axis-aligned boxes and the shafts between them.

use std::ops::Add;

use glam::DVec3;

/// Closed interval of numbers of one unit. Empty where `lo` exceeds `hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Smallest number.
    pub lo: f64,
    /// Largest number.
    pub hi: f64,
}

impl Interval {
    /// The interval that holds nothing.
    pub const EMPTY: Interval = Interval { lo: f64::INFINITY, hi: f64::NEG_INFINITY };

    /// The interval of 0 alone.
    pub const ZERO: Interval = Interval { lo: 0.0, hi: 0.0 };

    /// The smallest interval around some numbers.
    #[inline]
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Interval {
        numbers.into_iter().fold(Interval::EMPTY, Interval::with)
    }

    /// This interval grown to hold a number.
    #[inline]
    pub fn with(self, x: f64) -> Interval {
        Interval { lo: self.lo.min(x), hi: self.hi.max(x) }
    }

    /// The smallest interval around both.
    #[inline]
    pub fn union(self, other: Interval) -> Interval {
        Interval { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }
}

impl Add for Interval {
    type Output = Interval;

    /// The interval of all sums of a number of this one and one of the other.
    #[inline]
    fn add(self, other: Interval) -> Interval {
        Interval { lo: self.lo + other.lo, hi: self.hi + other.hi }
    }
}

/// An axis-aligned box, metres. Empty where a `lo` exceeds its `hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub lo: DVec3,
    /// Largest coordinates.
    pub hi: DVec3,
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Aabb =
        Aabb { lo: DVec3::splat(f64::INFINITY), hi: DVec3::splat(f64::NEG_INFINITY) };

    /// The smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Aabb {
        points.into_iter().fold(Aabb::EMPTY, |b, p| b.with(p))
    }

    /// This box grown to hold `p`.
    #[inline]
    pub fn with(self, p: DVec3) -> Aabb {
        Aabb { lo: self.lo.min(p), hi: self.hi.max(p) }
    }

    /// The smallest box around both.
    #[inline]
    pub fn union(self, other: Aabb) -> Aabb {
        Aabb { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// This box grown by a margin on all sides; an empty one stays empty.
    #[inline]
    pub fn grown(self, margin_m: f64) -> Aabb {
        Aabb { lo: self.lo - margin_m, hi: self.hi + margin_m }
    }

    /// Whether nothing is inside.
    #[inline]
    pub fn is_empty(&self) -> bool {
        !self.lo.cmple(self.hi).all()
    }

    /// Whether two boxes have a point in common.
    pub fn meets(&self, other: &Aabb) -> bool {
        self.lo.cmple(other.hi).all() && other.lo.cmple(self.hi).all()
    }

    /// Middle of the box.
    #[inline]
    pub fn centre(&self) -> DVec3 {
        (self.lo + self.hi) * 0.5
    }

    /// Distance to another box, metres; 0 where they meet.
    pub fn distance(&self, other: &Aabb) -> f64 {
        (self.lo - other.hi).max(other.lo - self.hi).max(DVec3::ZERO).length()
    }

    /// Edge lengths, metres.
    #[inline]
    pub fn extent(&self) -> DVec3 {
        self.hi - self.lo
    }

    /// Minkowski sum: the box of all sums of a point of this box and a point of the other.
    #[inline]
    pub fn sum(&self, other: &Aabb) -> Aabb {
        Aabb { lo: self.lo + other.lo, hi: self.hi + other.hi }
    }

    /// Minkowski difference: the box of all differences of a point of this box and a point of the other.
    #[inline]
    pub fn difference(&self, other: &Aabb) -> Aabb {
        Aabb { lo: self.lo - other.hi, hi: self.hi - other.lo }
    }

    /// Interval of the dot products of the box's points with a direction.
    #[inline]
    pub fn along(&self, direction: DVec3) -> Interval {
        let forwards = direction.cmpge(DVec3::ZERO);
        let lo = DVec3::select(forwards, self.lo, self.hi);
        let hi = DVec3::select(forwards, self.hi, self.lo);
        Interval { lo: direction.dot(lo), hi: direction.dot(hi) }
    }

    /// Length of the space diagonal, metres; 0 for an empty box.
    pub fn diagonal(&self) -> f64 {
        if self.is_empty() { 0.0 } else { self.extent().length() }
    }
}

/// Whether box `o` meets the shaft of `a` and `b`: the convex hull of the two boxes.
///
/// The hull is the union over t in [0, 1] of the boxes (1 - t) a + t b, so this asks for one t at
/// which six linear inequalities hold; exact up to rounding, boundaries included. Some 10 ns.
/// Source: Haines & Wallace 1991 for shafts; the parametrisation is derived above.
#[inline]
pub fn shaft_meets_box(a: &Aabb, b: &Aabb, o: &Aabb) -> bool {
    let mut t0 = 0.0_f64;
    let mut t1 = 1.0_f64;
    for axis in 0..3 {
        // lo(t) <= o.hi and hi(t) >= o.lo, as slope * t <= room.
        for (slope, room) in [
            (b.lo[axis] - a.lo[axis], o.hi[axis] - a.lo[axis]),
            (a.hi[axis] - b.hi[axis], a.hi[axis] - o.lo[axis]),
        ] {
            if slope > 0.0 {
                t1 = t1.min(room / slope);
            } else if slope < 0.0 {
                t0 = t0.max(room / slope);
            } else if room < 0.0 {
                return false;
            }
        }
    }
    t0 <= t1
}

/// The shaft of two boxes made ready for many questions: [`shaft_meets_box`] without divisions.
#[derive(Clone, Copy, Debug)]
pub struct ShaftOfBoxes {
    lo: DVec3,
    hi: DVec3,
    /// One over how fast the lower faces go from the first box to the second; 0 where they rest.
    lo_pace: DVec3,
    /// The same of the upper faces, backwards.
    hi_pace: DVec3,
}

impl ShaftOfBoxes {
    /// From one box to the other.
    pub fn new(a: &Aabb, b: &Aabb) -> ShaftOfBoxes {
        let pace = |way: f64| if way == 0.0 { 0.0 } else { 1.0 / way };
        let paces = |way: DVec3| DVec3::new(pace(way.x), pace(way.y), pace(way.z));
        ShaftOfBoxes {
            lo: a.lo,
            hi: a.hi,
            lo_pace: paces(b.lo - a.lo),
            hi_pace: paces(a.hi - b.hi),
        }
    }

    /// Whether a box, grown by a margin, meets the shaft; exact up to rounding. Some 3 ns.
    #[inline]
    pub fn meets(&self, o: &Aabb, margin_m: f64) -> bool {
        let (below, above) = (o.hi + margin_m - self.lo, self.hi - o.lo + margin_m);
        let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
        for (room, pace) in [
            (below.x, self.lo_pace.x),
            (above.x, self.hi_pace.x),
            (below.y, self.lo_pace.y),
            (above.y, self.hi_pace.y),
            (below.z, self.lo_pace.z),
            (above.z, self.hi_pace.z),
        ] {
            if pace > 0.0 {
                t1 = t1.min(room * pace);
            } else if pace < 0.0 {
                t0 = t0.max(room * pace);
            } else if room < 0.0 {
                return false;
            }
        }
        t0 <= t1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn arbitrary_box() -> impl Strategy<Value = Aabb> {
        (prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(0.0..0.5f64)).prop_map(
            |(c, e)| {
                let (c, e) = (DVec3::from(c), DVec3::from(e));
                Aabb { lo: c - e, hi: c + e }
            },
        )
    }

    proptest! {
        /// No segment between the boxes may pass through a box that the shaft is said to miss.
        #[test]
        fn a_missed_box_is_met_by_no_segment(
            a in arbitrary_box(), b in arbitrary_box(), o in arbitrary_box(),
            s in prop::array::uniform3(0.0..1.0f64), r in prop::array::uniform3(0.0..1.0f64),
        ) {
            let p = a.lo + a.extent() * DVec3::from(s);
            let q = b.lo + b.extent() * DVec3::from(r);
            let hit = (0..=200).any(|k| {
                let x = p.lerp(q, f64::from(k) / 200.0);
                x.cmpge(o.lo).all() && x.cmple(o.hi).all()
            });
            prop_assert!(!hit || shaft_meets_box(&a, &b, &o));
            prop_assert!(!hit || ShaftOfBoxes::new(&a, &b).meets(&o, 1e-12));
        }
    }

    proptest! {
        /// Boxes on a grid, so that faces rest, are flush and touch.
        #[test]
        fn a_shaft_made_ready_says_the_same(
            at in prop::array::uniform9(-2..3_i32), size in prop::array::uniform9(0..2_i32),
        ) {
            let box_at = |k: usize| {
                let of = |v: &[i32; 9]| {
                    DVec3::new(f64::from(v[k]), f64::from(v[k + 1]), f64::from(v[k + 2]))
                };
                Aabb { lo: of(&at), hi: of(&at) + of(&size) }
            };
            let (a, b, o) = (box_at(0), box_at(3), box_at(6));
            let shaft = ShaftOfBoxes::new(&a, &b);
            prop_assert_eq!(shaft_meets_box(&a, &b, &o.grown(1e-9)), shaft.meets(&o, 1e-9));
            prop_assert_eq!(shaft_meets_box(&a, &b, &o.grown(-1e-9)), shaft.meets(&o, -1e-9));
        }
    }

    #[test]
    fn a_box_beside_the_shaft_is_missed() {
        let at = |x: f64, y: f64| Aabb {
            lo: DVec3::new(x, y, 0.0),
            hi: DVec3::new(x + 1.0, y + 1.0, 1.0),
        };
        assert!(shaft_meets_box(&at(0.0, 0.0), &at(10.0, 0.0), &at(5.0, 0.5)));
        assert!(!shaft_meets_box(&at(0.0, 0.0), &at(10.0, 0.0), &at(5.0, 1.5)));
        assert!(!shaft_meets_box(&at(0.0, 0.0), &at(10.0, 10.0), &at(8.0, 0.0)));
    }
}
