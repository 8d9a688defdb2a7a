//! The natural logarithm in plain arithmetic, without branches, so that it fits vector registers and is the same on every machine.

use std::f64::consts::{LN_2, SQRT_2};

/// (atanh(s) / s - 1) / s^2 as a polynomial in s^2 for |s| <= 3 - 2 sqrt(2), doubled: 2/3, 2/5, 2/7, ... with the last terms fitted
/// (FreeBSD's e_log.c).
const SERIES: [f64; 7] = [
    6.666_666_666_666_735e-1,
    3.999_999_999_940_942e-1,
    2.857_142_874_366_239e-1,
    2.222_219_843_214_978_4e-1,
    1.818_357_216_161_805e-1,
    1.531_383_769_920_937_3e-1,
    1.479_819_860_511_658_6e-1,
];

/// What a double with this exponent field and the integer n in its last bits is more than n.
const COUNTED: u64 = 0x4330_0000_0000_0000;

/// ln(x) of a normal positive number; error below 1e-15 of the larger of it and 1.
#[inline(always)]
pub(super) fn logarithm(x: f64) -> f64 {
    let bits = x.to_bits();
    // 2^52 + the exponent, as a double, without a conversion of integers.
    let exponent = f64::from_bits((bits >> 52) | COUNTED) - (f64::from_bits(COUNTED) + 1023.0);
    let mantissa = f64::from_bits((bits & ((1 << 52) - 1)) | 1.0_f64.to_bits());
    let large = mantissa > SQRT_2;
    let (m, e) = if large { (0.5 * mantissa, exponent + 1.0) } else { (mantissa, exponent) };
    let f = m - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let mut p = SERIES[6];
    for k in (0..6).rev() {
        p = p * z + SERIES[k];
    }
    e * LN_2 + (2.0 * s + s * (z * p))
}

#[cfg(test)]
mod tests {
    use super::logarithm;

    #[test]
    fn logarithms_agree_with_the_library() {
        let mut x = 1e-300_f64;
        while x < 1e300 {
            let want = libm::log(x);
            assert!((logarithm(x) - want).abs() <= 1e-15 * want.abs().max(1.0), "{x}");
            x *= 1.003_7;
        }
        for k in -1000..=1000 {
            let x = 1.0 + 1e-3 * f64::from(k) * 0.4;
            assert!((logarithm(x) - libm::log(x)).abs() <= 4e-16, "{x}");
        }
        assert_eq!(logarithm(1.0), 0.0);
    }
}
