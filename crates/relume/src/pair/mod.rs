//! The pair tree: which elements exchange light with which, and at what level.
//!
//! A verdict is a pure function of the poses, the materials' brightness bounds and the tolerance:
//! this room knows no history, and no radiosity beyond the [`Brightness`] it is handed.

mod brightness;
mod grow;
mod hash;
mod judge;
mod oracle;
mod tree;

pub use brightness::{Brightness, Light};
pub use grow::{Frontier, Hierarchy, Judge, Judgement, Verdict, Work, grow, resume};
pub use hash::{PairHash, pair_key};
pub use judge::{Placed, Stage};
pub use oracle::{Oracle, Side};
pub use tree::{CullReason, Gradients, Pair, PairId, PairTree, State};
