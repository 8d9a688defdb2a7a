//! Random numbers that are the same on every machine.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

/// A stream of pseudo-random numbers: SplitMix64 (Steele, Lea, Flood 2014). The field is its state,
/// and any number will do as a seed.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The stream of part `index` of a calculation with a seed: parts can run in any order.
    pub fn of_part(seed: u64, index: u64) -> Random {
        let mut mixed = Random(seed ^ index.wrapping_mul(0xd134_2543_de82_ef95));
        Random(mixed.bits())
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In [lo, hi).
    pub fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.unit()
    }

    /// Uniform in a box.
    pub fn point(&mut self, lo: DVec3, hi: DVec3) -> DVec3 {
        lo + (hi - lo) * DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// A rotation; near enough to uniform.
    pub fn rotation(&mut self) -> DQuat {
        let axis = self.point(DVec3::splat(-1.0), DVec3::ONE) + DVec3::new(1e-3, 0.0, 0.0);
        DQuat::from_axis_angle(axis.normalize(), self.between(0.0, TAU))
    }
}
