//! Pictures and exports of Relume solutions: a snapshot in, pixels and files out.
//!
//! Nothing here is ever written back into the solution.

pub mod drawing;
pub mod export;
pub mod picture;
