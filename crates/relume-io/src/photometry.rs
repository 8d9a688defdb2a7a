//! Photometric units, in which files state light, and the radiometric ones of scenes.

/// Luminous efficacy of light of 555 nm, lm/W: glTF's photometric units are divided by it, for light of any colour.
///
/// Exact: the definition of the candela at 540 THz. Not the luminous efficacy of daylight,
/// [`outside::LUMENS_PER_WATT`](relume_core::scene::outside::LUMENS_PER_WATT).
pub const PEAK_LUMENS_PER_WATT: f64 = 683.0;
