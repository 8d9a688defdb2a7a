//! The light of one end of a pair, as far as a verdict may know it.

/// What the oracle may know about the light of one coarse element; W/m2, mean of the channels.
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
    /// The light of a scene in which every surface weighs the same.
    pub const UNIFORM: Brightness = Brightness { radiosity: 1.0, reflected: 1.0, irradiance: 1.0 };

    /// The light of what is distant, but for what it emits: nothing arrives there, and no error.
    pub const DISTANT: Brightness =
        Brightness { radiosity: 0.0, reflected: 0.0, irradiance: f64::INFINITY };
}
