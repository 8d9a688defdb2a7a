//! Radiosity to display values, and display values to bytes.
//!
//! Must not know where on the screen, or on which patch.

use super::tuning::KNEE;
use std::f64::consts::PI;

/// How exposed radiance becomes a display value in [0, 1], channel by channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Tone {
    /// Proportional up to 1, then cut off: pixels can be read back as numbers.
    Clip,
    /// Proportional up to 0.6, then a shoulder `0.6 + 0.4 t/(1+t)`, `t = (x - 0.6)/0.4`: bright
    /// walls near a lamp keep their shape, and the slope has no break. A lamp tends to white.
    #[default]
    Shoulder,
}

impl Tone {
    /// Display value in [0, 1] of an exposed radiance `x`, both linear; no transcendental function.
    pub fn display(self, x: f64) -> f64 {
        match self {
            Tone::Clip => x.clamp(0.0, 1.0),
            Tone::Shoulder if x > KNEE => {
                let t = (x - KNEE) / (1.0 - KNEE);
                // 1 - 1/(1+t), which is also right for an infinite t.
                KNEE + (1.0 - KNEE) * (1.0 - 1.0 / (1.0 + t))
            }
            Tone::Shoulder => x.max(0.0),
        }
    }

    /// Linear display values of a radiosity (W/m2) at `exposure` (display value per W/m2/sr).
    pub(crate) fn map(self, exposure: f64, radiosity: [f32; 3]) -> [f64; 3] {
        radiosity.map(|b| self.display(f64::from(b) / PI * exposure))
    }
}

/// Luminance of linear RGB (Rec. 709).
pub(crate) fn luminance(rgb: [f32; 3]) -> f64 {
    0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2])
}

/// sRGB bytes of linear display values, correctly rounded.
#[derive(Debug)]
pub(crate) struct SrgbEncoder {
    /// Least linear value of codes 1 to 255.
    thresholds: Vec<f64>,
    /// Code at the start of each of equally long intervals of [0, 1].
    starts: Vec<u8>,
}

const INTERVALS: usize = 4096;

impl SrgbEncoder {
    pub(crate) fn new() -> SrgbEncoder {
        let thresholds: Vec<f64> =
            (1..=255).map(|code| decode((f64::from(code) - 0.5) / 255.0)).collect();
        let start =
            |i: usize| thresholds.partition_point(|&t| t <= i as f64 / INTERVALS as f64) as u8;
        let starts = (0..=INTERVALS).map(start).collect();
        SrgbEncoder { thresholds, starts }
    }

    /// The byte for a linear value; below 0 and NaN give 0, above 1 gives 255.
    pub(crate) fn encode(&self, linear: f64) -> u8 {
        let x = linear.clamp(0.0, 1.0);
        let mut code = self.starts[(x * INTERVALS as f64) as usize];
        while code < 255 && self.thresholds[code as usize] <= x {
            code += 1;
        }
        code
    }
}

/// Linear value of an sRGB-encoded one (IEC 61966-2-1), both in [0, 1].
fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_correctly_rounded() {
        let encoder = SrgbEncoder::new();
        for code in 0..=255_u8 {
            assert_eq!(encoder.encode(decode(f64::from(code) / 255.0)), code);
        }
        for i in 0..10_000 {
            let x = f64::from(i) / 9_999.0;
            let exact =
                if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
            assert!((f64::from(encoder.encode(x)) - 255.0 * exact).abs() < 0.501, "{x}");
        }
        assert_eq!(
            [-1.0, f64::NAN, 2.0, f64::INFINITY].map(|x| encoder.encode(x)),
            [0, 0, 255, 255]
        );
    }

    #[test]
    fn the_shoulder_is_smooth_and_ends_at_one() {
        let tone = |x| Tone::Shoulder.display(x);
        assert_eq!(tone(0.3), 0.3);
        assert!((tone(KNEE + 1e-6) - tone(KNEE) - 1e-6).abs() < 1e-10);
        assert_eq!(tone(f64::INFINITY), 1.0);
        assert!((1..1000).all(|i| tone(f64::from(i) / 100.0) > tone(f64::from(i - 1) / 100.0)));
    }
}
