//! Oracles: whether a pair of elements is good enough as a link, and if not which side to refine.

use crate::geometry::no_smaller;
use crate::transport::{BlockerSizes, Exchange, SEGMENTS, Variation, Visibility};

use super::brightness::Brightness;
use super::margin::Margin;
use super::tuning::{
    ALIKE_FACTOR, ALIKE_SHARE, BENT, EDGE, EDGE_REFLECTED, JUMP, NOISE, PREFERENCE, SEEN,
    SHADOW_AREAS, SMALL_SHADOW, SOURCE_VARIATION, SPOT, STEEP,
};
use crate::transport::Side;

/// Refinement criterion: threshold below which a pair of elements becomes a link; made of the session's oracle and tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RefinementCriterion {
    /// An estimate of the error of irradiance that the link causes on its receivers.
    Error {
        /// Largest error of a link relative to the irradiance of its receiver.
        threshold: f64,
    },
    /// The paper's: the form factor, with a smallest area.
    FormFactor {
        /// Largest form factor of a link.
        epsilon: f64,
        /// Elements below this area are not refined, m2.
        min_area_m2: f64,
    },
}

/// One end of a pair as the error oracle sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(super) area: f64,
    /// Area at which an element of this surface weighs 1 in the error norm, m2.
    pub(super) reference_area: f64,
    pub(super) light: Brightness,
    /// Its area where it sends: also of what is distant, which receives nothing; m2.
    pub(super) own_area: f64,
    /// Area of the surface that it is a part of and that may send alike: of its patch, or of the sky; m2.
    pub(super) surface_area: f64,
}

/// Norm that errors are measured in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Norm {
    /// Area at which an element weighs 1, m2.
    pub(super) reference_area_m2: f64,
    /// Error that a link may make, relative.
    pub(super) threshold: f64,
}

/// Errors of a link, each relative to its threshold's unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    /// The errors on the two receivers.
    pub(super) on: [f64; 2],
    /// Part of the error that splitting each end would remove.
    mends: [f64; 2],
}

impl Estimate {
    /// The larger error.
    pub(super) fn error(&self) -> f64 {
        self.on[0].max(self.on[1])
    }

    /// The receiver that it is on.
    pub(super) fn larger(&self) -> Side {
        if self.on[1] > self.on[0] { Side::B } else { Side::A }
    }

    /// The side to refine, and how far it is from being the other one.
    ///
    /// The larger, unless splitting the smaller mends far more: where both mend about as much the
    /// smallest motion would make the other side the better one, and everything below anew.
    pub(super) fn side(&self, a: &End, b: &End) -> (Side, u16) {
        let [one, two] = self.mends;
        let (large, small, by_large, by_small) = match no_smaller(a.area, b.area) {
            true => (Side::A, Side::B, one, two),
            false => (Side::B, Side::A, two, one),
        };
        let by_large = PREFERENCE * by_large;
        let side = if by_small > by_large { small } else { large };
        (side, Margin::between(by_large.max(by_small), by_large.min(by_small)))
    }
}

/// The errors that a link makes on both its receivers.
///
/// The irradiance on a from b is B_b X V / A_a, with a gradient over a and one over b. It errs by
/// (1) what the gradient does not catch of its variation over the receiver, of the kernel and of
/// the visibility; (2) the variation of the source's reflected radiosity beyond its gradient, as
/// far as the kernel weighs it unevenly, with jumps where something stands on it; (3) the sampling
/// of V. All three are standard deviations and add in quadrature. Small receivers weigh by the root
/// of their area: equal shares of the total squared error.
pub(super) fn estimate(
    x: &Exchange,
    v: &Visibility,
    [a, b]: [&End; 2],
    blockers: &BlockerSizes,
    &Norm { reference_area_m2, threshold }: &Norm,
) -> Estimate {
    // Fewer than a bundle: clipped, without noise.
    let noise = if v.segments < SEGMENTS as u32 {
        0.0
    } else {
        ((v.value * (1.0 - v.value) + 0.02) / f64::from(v.segments)).sqrt() * NOISE
    };
    let sends = |over: &Variation, spread: f64| length(v.value * (over.slope + over.bend), spread);
    let over = |over: &Variation, edge: f64, end: usize| Uneven {
        bend: BENT * v.value * over.bend,
        edge,
        sends: sends(over, edge),
        spot: SPOT * blockers.spots[end],
        jump: JUMP * blockers.near[end],
    };
    // The points that V is found from tell no more than those of the kernel: over an end where that is even they tell all.
    let least = |over: &Variation| match x.is_steep && v.segments > 0 {
        true => STEEP.min(over.slope + over.bend) * (v.value / SEEN).min(1.0),
        false => 0.0,
    };
    let over_a = over(&x.over_a, v.spread_a.max(least(&x.over_a)), 0);
    let over_b = over(&x.over_b, v.spread_b.max(least(&x.over_b)), 1);
    let link = LinkSize {
        exchange: x.area_m2,
        noise,
        least_shadow: SMALL_SHADOW * blockers.least_shadow_m2[0],
        shadow: SHADOW_AREAS * blockers.all_m2,
        reference_area: reference_area_m2,
        threshold,
        leverage: blockers.leverage[0],
    };
    let least_shadow = SMALL_SHADOW * blockers.least_shadow_m2[1];
    let back = LinkSize { leverage: blockers.leverage[1], least_shadow, ..link };
    let (over_a, over_b) = (Over { end: a, uneven: &over_a }, Over { end: b, uneven: &over_b });
    let (on_a, on_b) = (one_way(&link, over_a, over_b), one_way(&back, over_b, over_a));
    Estimate {
        on: [on_a.error, on_b.error],
        mends: [on_a.by_receiver + on_b.by_source, on_a.by_source + on_b.by_receiver],
    }
}

/// The hypotenuse; `f64::hypot` is the platform's, and differs from one to another.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// Values that both directions of a link share.
#[derive(Clone, Copy)]
struct LinkSize {
    exchange: f64,
    noise: f64,
    /// Area that weighs 1 where the edges of shadows are concerned, if that of the receiver is not smaller: that of the
    /// smallest shadow's.
    least_shadow: f64,
    /// Area within which neighbouring sources are hidden alike: that of the shadow of all between.
    shadow: f64,
    reference_area: f64,
    threshold: f64,
    /// Leverage: largest motion of a shadow's edge over the source per motion of its point on the receiver: 1.
    leverage: f64,
}

impl LinkSize {
    /// Links to neighbours of the source whose light is hidden along the same edge across the receiver, this one included:
    /// their errors have one sign.
    ///
    /// The edge that a point of the receiver sees sweeps over as much of the source's surface as the receiver is large,
    /// times the leverage. Light does not count: the margins of verdicts know how errors grow with it, not how a count would.
    fn alike(&self, receiver: &End, source: &End) -> f64 {
        let swept = receiver.area * self.leverage * self.leverage;
        let by_size = ALIKE_SHARE * swept.min(source.surface_area) / source.own_area;
        let factor = self.exchange / receiver.area;
        match by_size > 1.0 && factor > 0.0 {
            true => by_size.min(ALIKE_FACTOR / factor).max(1.0),
            false => 1.0,
        }
    }
}

/// Standard deviations over one end of what crosses a link, relative to the mean without occlusion.
struct Uneven {
    /// Standard deviation of the kernel, beyond its gradient.
    bend: f64,
    /// Standard deviation of the visibility.
    edge: f64,
    /// Standard deviation of both with the gradient, by which uneven radiosity of the source is weighed.
    sends: f64,
    /// Standard deviation of the radiosity reflected from lamps close by, weighted by `SPOT`, over the mean around: 1.
    spot: f64,
    /// Standard deviation of the reflected radiosity where what stands on the end hides light from it, over its mean: 1.
    jump: f64,
}

/// An end, and how unevenly light crosses a link over it.
#[derive(Clone, Copy)]
struct Over<'a> {
    end: &'a End,
    uneven: &'a Uneven,
}

/// Error of a link on one of its receivers.
struct OneWay {
    /// All of it.
    error: f64,
    /// Part of it that splitting the receiver would mend.
    by_receiver: f64,
    /// Part of it that splitting the source would mend.
    by_source: f64,
}

/// Error on the receiver.
fn one_way(
    link: &LinkSize,
    Over { end: receiver, uneven: over_receiver }: Over<'_>,
    Over { end: source, uneven: over_source }: Over<'_>,
) -> OneWay {
    if receiver.area <= 0.0 {
        return OneWay { error: 0.0, by_receiver: 0.0, by_source: 0.0 };
    }
    let by_area = (receiver.area / receiver.reference_area).sqrt();
    let scale = receiver.reference_area.min(link.least_shadow).max(f64::MIN_POSITIVE);
    let finer = (receiver.reference_area / scale).sqrt();
    let weight = by_area / receiver.light.irradiance;
    let per_radiosity = link.exchange / receiver.area * weight;
    let Brightness { radiosity, reflected, .. } = source.light;
    let varies = SOURCE_VARIATION * (source.area / link.reference_area).min(4.0);
    // What a small source does unevenly its neighbours do too, in the same sense: splitting the
    // source does not mend it, so it counts as if the source were as large as the receiver.
    let whole = |area: f64| if source.area > 0.0 { (area / source.area).max(1.0) } else { 1.0 };
    let (whole, in_shadow) = (whole(receiver.area), whole(receiver.area.min(link.shadow)));
    let alike = EDGE * link.alike(receiver, source).max(in_shadow);
    let edge = alike * (radiosity - reflected) + alike.max(EDGE_REFLECTED) * reflected;
    let uneven = length(radiosity * over_receiver.bend * whole, edge * over_receiver.edge * finer);
    let by_receiver = per_radiosity * uneven;
    // The edges of what is hidden run through as many sources as it is long: all err in the same sense.
    let along = whole.sqrt();
    let (spot, jump) = (over_source.spot * along, over_source.edge * over_source.jump * along);
    let sends = length(over_source.sends * varies.max(spot), jump);
    let by_source = per_radiosity * reflected * sends;
    let by_noise = per_radiosity * radiosity * link.noise;
    // Relative to what the link itself brings, which no light changes: close to a lamp that is the most of what arrives.
    let alone = length(over_receiver.bend, EDGE * over_receiver.edge * finer);
    let alone = by_area * length(length(alone, sends), link.noise);
    let error = match alone <= link.threshold {
        true => 0.0,
        false => (by_receiver.powi(2) + by_source.powi(2) + by_noise.powi(2)).sqrt(),
    };
    OneWay { error, by_receiver, by_source }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An element of 3 cm close by a wall of a square metre that is partly hidden, steep over the wall alone.
    #[test]
    fn what_is_steep_over_one_end_alone_is_divided_there() {
        let even = Variation::default();
        let steep = Variation { slope: 1.5, bend: 3.0, ..even };
        let light = Brightness { irradiance: 1.0, radiosity: 1.0, reflected: 1.0 };
        let end =
            |area: f64| End { area, reference_area: 0.5, light, own_area: area, surface_area: 1.0 };
        let (wall, small) = (end(1.0), end(1e-3));
        let v = Visibility { value: 0.02, spread_a: 0.14, segments: 4, ..Visibility::CLEAR };
        let norm = Norm { reference_area_m2: 0.5, threshold: 0.005 };
        let error_on_small = |over_a, over_b| {
            let x = Exchange { area_m2: 5e-4, over_a, over_b, is_steep: true };
            let e = estimate(&x, &v, [&wall, &small], &BlockerSizes::NOTHING, &norm);
            e.on[1]
        };
        assert!(error_on_small(steep, even) < norm.threshold);
        assert!(error_on_small(steep, steep) > norm.threshold);
    }
}
