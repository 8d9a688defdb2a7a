//! The element forest: scene > body > cluster > patch > quadtree element.
//!
//! An element knows its place in its body's own frame and nothing else: no light, no links, no
//! pose. Parents come before children.

mod clusters;
mod exposed;
mod forest;
mod groups;
mod ids;
mod split;
mod tuning;
mod world;

pub use forest::{Counts, Forest, PartInside, Seeds, old_coarse_numbers};
pub use groups::{Group, GroupLeaf, Groups, NormalCone, distant_parts, grouped_patches};
pub use ids::{ElementId, ElementKey, Kind, Renumbering};
pub use split::{Extent, Shape, bilinear, bilinear_area};
pub use world::{OccluderPolygon, WorldElement, WorldLight, WorldPatch, WorldView};
