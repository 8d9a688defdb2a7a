//! The pair tree: which elements exchange light with which, and at what level.
//!
//! A verdict is a pure function of the poses, the materials' brightness bounds and the tolerance:
//! this room knows no history, and no radiosity beyond the [`Brightness`] it is handed.

mod brightness;
mod certificate;
mod ends;
mod groups;
mod hash;
mod judge;
mod light;
mod margin;
mod oracle;
mod outlook;
mod side;
mod since;
mod tree;
mod update;

pub use brightness::Brightness;
pub use hash::{PairHash, pair_key};
pub use judge::{Placed, Stage};
pub use light::Light;
pub use margin::{Margin, Shift};
pub use oracle::Oracle;
pub use outlook::Finding;
pub use side::Side;
pub use since::Since;
pub use tree::{
    Carried, CullReason, Gradients, Link, PairId, PairTree, State, StateCounts, in_steps,
};
// The plane has certificates of its own.
pub(crate) use outlook::{Moves, Outlook};

pub use update::{
    Changes, Edit, EventKind, Held, Hierarchy, Judge, Judgement, LinkEvent, OutOfMemory, Pairs,
    Record, Scope, Stale, Verdict, Work, update,
};
