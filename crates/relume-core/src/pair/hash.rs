//! Names of pairs as numbers, and a hash over sets of links.

use crate::element::ElementKey;

use super::carried::{Carried, Gradients};

/// A number that depends on the names of the two ends and on nothing else.
#[inline]
pub fn pair_key(a: ElementKey, b: ElementKey) -> u64 {
    let one = u64::from(a.facet) << 32 | u64::from(a.path);
    let two = u64::from(b.facet) << 32 | u64::from(b.path);
    mix(mix(one) ^ two.rotate_left(17))
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a bijection of 64 bits.
#[inline]
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A 128-bit hash of a set of links with their exchange areas and visibilities.
///
/// The sum of a hash of each link: the order of the links does not matter, so it is the same as
/// in key order, and a link can be added or taken away without looking at the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairHash(u128);

impl PairHash {
    /// Adds a link; `key` is its [`pair_key`].
    pub fn add(&mut self, key: u64, carried: &Carried) {
        self.0 = self.0.wrapping_add(hash_of(key, carried));
    }

    /// The hash as a number.
    pub fn bits(&self) -> u128 {
        self.0
    }

    /// Takes a link away that was added before.
    pub fn remove(&mut self, key: u64, carried: &Carried) {
        self.0 = self.0.wrapping_sub(hash_of(key, carried));
    }
}

impl std::fmt::Display for PairHash {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

fn hash_of(key: u64, carried: &Carried) -> u128 {
    let x = u64::from(carried.exchange_area_m2.to_bits());
    let v = u64::from(carried.visibility);
    let Gradients { over_a: [au, av], over_b: [bu, bv] } = carried.gradients;
    let gradients = [au, av, bu, bv].iter().fold(0, |sum, &g| sum << 8 | u64::from(g as u8));
    let low = mix(key ^ mix(x << 32 | v) ^ mix(gradients).rotate_left(7));
    let high = mix(low ^ key.rotate_left(31));
    u128::from(high) << 64 | u128::from(low)
}
