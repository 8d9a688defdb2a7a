//! The sum over the links of a receiver, in vector registers.

use fearless_simd::{Simd, f32x4, prelude::*};

use super::field::{Field, Linear};
use super::links::{Link, Links};
use super::surfaces::Surfaces;

/// Scales of the lines of a receiver and its sources.
#[derive(Clone, Copy)]
struct Scales {
    /// Inverse of the receiver's radius, 1/m.
    per_radius: f32,
    /// See [`Surfaces::source_moment`].
    source_moment: f32,
}

/// Everything some receivers gather; each in the order of its links.
#[inline(always)]
pub(super) fn gather_some<S: Simd>(
    simd: S,
    radiosity: &Field,
    links: &Links,
    surfaces: &impl Surfaces,
    receivers: &[u32],
    linear: bool,
    out: &mut [Linear],
) {
    for (&id, h) in receivers.iter().zip(out) {
        *h = match links.of(id) {
            [] => Linear::default(),
            list => {
                let scales = Scales {
                    per_radius: 1.0 / surfaces.place(id).radius,
                    source_moment: surfaces.source_moment(),
                };
                match linear {
                    true => gather_one(simd, radiosity, list, scales),
                    false => gather_means(radiosity, list),
                }
            }
        };
    }
}

/// Everything one receiver gathers where elements are taken to be constant.
fn gather_means(radiosity: &Field, list: &[Link]) -> Linear {
    let mut mean = [0.0; 3];
    for link in list {
        let b = radiosity.get(link.source).mean;
        (0..3).for_each(|c| mean[c] += b[c] * link.coupling);
    }
    Linear { mean, ..Linear::default() }
}

/// Everything one receiver gathers.
///
/// Four lanes at a time: red, green, blue and one of no meaning, the number next in memory.
#[inline(always)]
fn gather_one<S: Simd>(
    simd: S,
    radiosity: &Field,
    list: &[Link],
    Scales { per_radius, source_moment }: Scales,
) -> Linear {
    let zero = f32x4::splat(simd, 0.0);
    let (mut mean, mut gx, mut gy) = (zero, zero, zero);
    for link in list {
        let near = radiosity.with_next(link.source);
        let lanes = |at: usize| f32x4::from_slice(simd, &near[at..at + 4]);
        let arriving = lanes(0) * link.coupling;
        let [su, sv] = link.source_gradient();
        let uneven = lanes(3) * su + lanes(6) * sv;
        mean += arriving + uneven * (link.coupling * source_moment);
        let [ru, rv] = link.receiver_gradient();
        gx += arriving * ru;
        gy += arriving * rv;
    }
    let three = |lanes: f32x4<S>, scale: f32| {
        let mut all = [0.0; 4];
        (lanes * scale).store_slice(&mut all);
        [all[0], all[1], all[2]]
    };
    Linear { mean: three(mean, 1.0), gradient: [three(gx, per_radius), three(gy, per_radius)] }
}
