//! What numbers the engine can compute with: one place for scenes of space, sensors and the plane.
//!
//! Boxes are held in 32 bits, and so are areas and radiosities; distances are squared twice. Within these
//! bounds nothing overflows and nothing vanishes. Must not know where the numbers come from.

/// Largest coordinate, metres: several times the distance to the sun.
pub const COORDINATE_MAX_M: f64 = 1e12;

/// Smallest extent of a whole scene, metres.
pub const EXTENT_MIN_M: f64 = 1e-6;

/// Largest exitance (W/m2) or intensity of a light (W/sr, W/m2).
pub const EMISSION_MAX: f64 = 1e30;

/// Smallest exitance or intensity that counts: less is none. Shares of it down to 1e-7 are numbers of 32 bits still.
pub const EMISSION_MIN: f64 = 1e-30;

/// Length and width of the smallest polygon that is solved, as a share of the scene's extent: the rounding of 32-bit
/// coordinates moves the corners of such a polygon by a tenth of that. Slivers that export leaves along edges are thinner.
pub const SPECK: f64 = 1e-6;

/// An emission as it counts: none below [`EMISSION_MIN`].
pub fn emission(channels: [f64; 3]) -> [f64; 3] {
    channels.map(|m| if m < EMISSION_MIN { 0.0 } else { m })
}

/// Whether a point is one to compute with: finite, and no coordinate beyond [`COORDINATE_MAX_M`].
pub fn is_place(coordinates: &[f64]) -> bool {
    coordinates.iter().all(|c| c.abs() <= COORDINATE_MAX_M)
}
