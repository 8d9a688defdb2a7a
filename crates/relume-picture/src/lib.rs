//! Pictures of Relume solutions: a snapshot in, pixels out.
//!
//! Nothing here is ever written back into the solution.

pub mod drawing;
pub mod picture;
