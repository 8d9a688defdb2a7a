//! References for the tests of Relume: exact formulas, a dense solver, brute-force exchange areas
//! and a path tracer.
//!
//! An independent judge: this crate depends on no other crate of the project and shares no code with
//! the engine. All it is told of a scene is its polygons ([`Polygon`]). Nothing here is tuned for large
//! scenes. The same input gives the same numbers on any number of threads.

pub mod dense;
pub mod exact;
pub mod monte_carlo;
pub mod path;
mod polygon;
mod random;
mod rays;
pub mod rows;
pub mod seen;

pub use polygon::{Polygon, Quad};
pub use random::Random;
pub use rays::{Hit, World};
