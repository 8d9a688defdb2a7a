//! The pair tree: which elements exchange light with which, and at what level.
//!
//! [`update`] walks the tree and has pairs judged ([`Judge`]): a verdict is a link, a refinement or a cull. A verdict is a
//! pure function of the poses, the brightness of coarse elements ([`CoarseBrightness`]) and the tolerance. Which pairs are
//! judged again after a motion follows from [`WorldChange`], the margins of verdicts ([`Margin`]) and certificates
//! ([`Finding`]). Must not know radiosities beyond the [`CoarseBrightness`] it is handed.

mod brightness;
mod carried;
mod certificate;
mod certificate_tests;
mod changes;
mod coarse_brightness;
mod editor;
mod ends;
mod evaluate;
mod groups;
mod hash;
mod judge;
mod margin;
mod oracle;
mod space;
mod tree;
mod tuning;
mod update;
mod verdict;
mod wave;
mod world_change;

pub use crate::transport::Side;
pub use brightness::Brightness;
pub use carried::{Carried, Gradients, in_steps};
pub use certificate_tests::Finding;
pub use coarse_brightness::{CoarseBrightness, coarsen};
pub use hash::{PairHash, pair_key};
pub use judge::{SpaceJudge, Stage};
pub use margin::{Margin, Shift};
pub use oracle::RefinementCriterion;
pub use tree::{CullReason, Link, PairId, PairTree, State, StateCounts};
pub use world_change::WorldChange;
// The plane has certificates of its own.
pub(crate) use certificate_tests::{CertificateTests, Moves};

pub use changes::{Changes, CoarseLink, Edit, EventKind, LinkEvent, Record, Work};
pub use space::{Hierarchy, Judge};
pub use update::{OutOfMemory, Pairs, Scope, update};
pub use verdict::{Judgement, Stale, Verdict};
