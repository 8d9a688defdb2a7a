//! What of each patch is covered by what rests on it: no light reaches it, and nobody sees it. Pure geometry.
//!
//! A crate on a floor hides the floor under it. What a part of the floor that is larger than the crate sends comes from the
//! rest alone; if the covered part counted in its mean, it would count twice, as dark and as hidden.

mod cover;
mod hull;
mod in_gap;
mod lamps;
mod parts;
mod stands;

pub(super) use hull::{Hull, hulls_of};
pub(super) use in_gap::{Face, dark_in_gaps};
pub use parts::{Covered, Inside};
pub(super) use stands::Stands;
