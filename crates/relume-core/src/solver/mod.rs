//! Gather over links, push irradiance down, pull radiosity up, until the residual is small.
//!
//! The solver knows no time, no shafts and no geometry: links come as numbers.

mod dirty_path;
mod field;
mod gather;
mod groups;
mod jump;
mod level;
mod links;
mod place;
mod push;
mod radiosity;
mod settle;
mod surfaces;
mod trend;
mod tuning;
mod work;

pub use field::Linear;
pub use groups::{GroupEnd, GroupLink, GroupLinks, PlacedLinks};
pub use links::{Link, Links, LinksBuilder};
pub use place::Place;
pub use push::{RowSum, row_sums};
pub use radiosity::{Bounds, Radiosity, Stop};
pub use surfaces::{FacetMaterial, SQUARE_MOMENT, Surfaces};
pub use work::Dirty;
