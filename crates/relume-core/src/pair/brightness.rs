//! Brightness of one end of a pair, as verdicts know it.

/// Brightness of one coarse element as the oracle knows it; W/m2, mean of the channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brightness {
    /// Radiosity, emitted and reflected (or intensity of a punctual light).
    pub radiosity: f64,
    /// The reflected part of it, which varies over the element; the emitted part does not.
    pub reflected: f64,
    /// Irradiance that errors on this element are measured against; positive.
    pub irradiance: f64,
}

impl Brightness {
    /// Brightness of every element of a scene in which all surfaces weigh the same.
    pub const UNIFORM: Brightness = Brightness { radiosity: 1.0, reflected: 1.0, irradiance: 1.0 };

    /// In place of a brightness that margins were not counted with: it equals none, and any change from it is without bounds.
    pub const UNKNOWN: Brightness =
        Brightness { radiosity: -1.0, reflected: -1.0, irradiance: -1.0 };

    /// Brightness of a distant element without its emission: nothing arrives there, and no error counts.
    pub const DISTANT: Brightness =
        Brightness { radiosity: 0.0, reflected: 0.0, irradiance: f64::INFINITY };
}
