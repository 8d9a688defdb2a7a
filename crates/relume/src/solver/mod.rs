//! Gather over links, push irradiance down, pull radiosity up, until the residual is small.
//!
//! The solver knows no time, no shafts and no geometry: links come as numbers.

mod links;
mod radiosity;

pub use links::{Link, Links, LinksBuilder};
pub use radiosity::{Dirty, Linear, Lit, Place, Radiosity, Stop, Surfaces, row_sums};
