//! Scenes of the plane from their text form and from SVG.
//!
//! Must not know how they are solved.

mod size;
mod svg;
mod text;

pub use svg::{SvgError, parse_svg};
pub use text::{TextError, parse};
