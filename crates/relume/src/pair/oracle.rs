//! Oracles: whether a pair of elements is good enough as a link, and if not which side to refine.

use crate::transport::{Exchange, Variation, Visibility};

use super::brightness::Light;

/// What decides on a pair of elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Oracle {
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

/// One end of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The first.
    A,
    /// The second.
    B,
}

/// One end of a pair as the error oracle sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(super) area: f64,
    pub(super) light: Light,
}

/// Share of a source's reflected radiosity by which it may vary over a reference-sized element
/// beyond its gradient.
const SOURCE_VARIATION: f64 = 0.1;

/// Errors of a link, each relative to its threshold's unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    /// Largest of the errors on the two receivers.
    pub(super) error: f64,
    /// What splitting each end would mend.
    mends: (f64, f64),
}

impl Estimate {
    pub(super) fn side(&self, a: &End, b: &End) -> Side {
        let (one, two) = self.mends;
        if one > two || (one == two && a.area >= b.area) { Side::A } else { Side::B }
    }
}

/// Share of the variation of visibility over an end that a straight line does not catch.
const EDGE: f64 = 0.5;

/// The errors that a link makes on both its receivers.
///
/// The irradiance on a from b is B_b X V / A_a, with a gradient over a and one over b. It errs by
/// (1) what the gradient does not catch of its variation over the receiver, of the kernel and of
/// the visibility; (2) the variation of the source's reflected radiosity beyond its gradient, as
/// far as the kernel weighs it unevenly; (3) the sampling of V. All three are standard deviations
/// and add in quadrature. Small receivers weigh by the root of their area: equal shares of the
/// total squared error.
pub(super) fn estimate(
    x: &Exchange,
    v: &Visibility,
    (a, b): (&End, &End),
    reference_area: f64,
) -> Estimate {
    let noise = if v.segments == 0 {
        0.0
    } else {
        ((v.value * (1.0 - v.value) + 0.02) / f64::from(v.segments)).sqrt()
    };
    let receives = |over: &Variation, spread: f64| (v.value * over.bend).hypot(EDGE * spread);
    let sends = |over: &Variation, spread: f64| (v.value * (over.slope + over.bend)).hypot(spread);
    let (ra, rb) = (receives(&x.over_a, v.spread_a), receives(&x.over_b, v.spread_b));
    let (sa, sb) = (sends(&x.over_a, v.spread_a), sends(&x.over_b, v.spread_b));
    let (on_a, by_a, by_b) = one_way(x.area_m2, a, b, (ra, sb, noise), reference_area);
    let (on_b, cy_b, cy_a) = one_way(x.area_m2, b, a, (rb, sa, noise), reference_area);
    Estimate { error: on_a.max(on_b), mends: (by_a + cy_a, by_b + cy_b) }
}

/// Error on the receiver, and the parts of it that splitting receiver and source would mend.
fn one_way(
    x: f64,
    receiver: &End,
    source: &End,
    (uneven_receiver, uneven_source, noise): (f64, f64, f64),
    reference_area: f64,
) -> (f64, f64, f64) {
    if receiver.area <= 0.0 {
        return (0.0, 0.0, 0.0);
    }
    let weight = (receiver.area / reference_area).sqrt() / receiver.light.irradiance;
    let per_radiosity = x / receiver.area * weight;
    let varies = SOURCE_VARIATION * (source.area / reference_area).min(4.0);
    let by_receiver = per_radiosity * source.light.radiosity * uneven_receiver;
    let by_source = per_radiosity * source.light.reflected * varies * uneven_source;
    let by_noise = per_radiosity * source.light.radiosity * noise;
    let error = (by_receiver.powi(2) + by_source.powi(2) + by_noise.powi(2)).sqrt();
    (error, by_receiver, by_source)
}
