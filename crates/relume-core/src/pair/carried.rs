//! What a link carries, in few bits: exchange area, visibility and gradients.

use glam::DVec2;

/// Relative gradients of what arrives over both ends of a pair, in their patches' frames, times the
/// ends' radii, in eight bits each: finer near 0 (steps of 2.5e-4 there, of 2e-2 at 0.3), at
/// most [`Gradients::MAX`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gradients {
    /// Over the first end.
    pub over_a: [i8; 2],
    /// Over the second end.
    pub over_b: [i8; 2],
}

/// A visibility from 0 to 1 in 65,535ths. One half, the commonest value between 0 and 1, would be a tie:
/// ties, and what rounding makes of them, always go down.
pub fn in_steps(visibility: f64) -> u16 {
    const TIE: f64 = 1e-6;
    (visibility * 65_535.0 + (0.5 - TIE)).floor() as u16
}

impl Gradients {
    /// The largest that is told from larger ones.
    pub const MAX: f32 = 4.0;

    /// From relative gradients (1/m) and radii (m) of both ends.
    pub fn new((a, radius_a): (DVec2, f64), (b, radius_b): (DVec2, f64)) -> Gradients {
        let step = |v: f64, r: f64| {
            let share = (v * r / f64::from(Gradients::MAX)).clamp(-1.0, 1.0);
            (share.abs().sqrt() * 127.0).round().copysign(share) as i8
        };
        let steps = |g: DVec2, r: f64| [step(g.x, r), step(g.y, r)];
        Gradients { over_a: steps(a, radius_a), over_b: steps(b, radius_b) }
    }

    /// The value of one of them, per radius.
    #[inline]
    pub fn value(step: i8) -> f32 {
        VALUES[usize::from(step as u8)]
    }
}

/// Values of all steps, by their bits: square, so that they are finer near 0.
static VALUES: [f32; 256] = {
    let mut values = [0.0; 256];
    let mut k = 0;
    while k < 256 {
        let s = (k as u8 as i8) as f32;
        let size = if s < 0.0 { -s } else { s };
        values[k] = s * size * (Gradients::MAX / (127.0 * 127.0));
        k += 1;
    }
    values
};

/// Values of a link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Carried {
    /// Exchange area X without occlusion, m2.
    pub exchange_area_m2: f32,
    /// Visibility V in 65,535ths.
    pub visibility: u16,
    /// Relative gradients of the arriving light over both ends.
    pub gradients: Gradients,
}

impl Carried {
    /// Visibility V, in [0, 1].
    #[inline]
    pub fn visibility(&self) -> f32 {
        f32::from(self.visibility) / 65_535.0
    }

    /// Exchange area with occlusion, V X, m2.
    #[inline]
    pub fn exchange_area_past_occluders_m2(&self) -> f32 {
        self.exchange_area_m2 * self.visibility()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_half_is_one_value_however_it_was_summed() {
        for noise in [-1e-12, 0.0, 1e-12] {
            assert_eq!(in_steps(0.5 + noise), 32_767);
        }
        assert_eq!((in_steps(0.0), in_steps(1.0), in_steps(1.0 - 1e-12)), (0, 65_535, 65_535));
    }

    #[test]
    fn gradients_are_finer_near_zero() {
        for g in [-3.9, -0.3, -0.01, 0.0, 0.002, 0.3, 1.7] {
            let packed = Gradients::new((DVec2::new(g, 0.0), 1.0), (DVec2::ZERO, 1.0));
            let back = f64::from(Gradients::value(packed.over_a[0]));
            assert!((back - g).abs() <= 0.016 * g.abs().sqrt() + 1e-4, "{g} {back}");
        }
    }
}
