//! Snapshot to pixels: camera, reconstruction, tone, overlays, PNG.
//!
//! This room reads snapshots and writes pictures. It must not know elements, pairs, links or the
//! solver, and nothing that it computes is ever written back into a solution.
//!
//! The steps, each in a file of its own:
//!
//! | file | one sentence |
//! |---|---|
//! | `camera` | where the picture is taken from: [`Viewpoint`], [`View`] |
//! | `overview` | a view that finds the light, for a scene without a camera: [`Overview`] |
//! | `project` | world to pixels, near clipping, and pixels back to a patch's plane |
//! | `outline` | edges of polygons, for line drawings: [`Outlines`] |
//! | `gouraud` | sample points of a patch, triangulated in the patch's own frame |
//! | `smooth` | light at the corners of curved bodies, as neighbours have it |
//! | `field` | light over surfaces as one continuous function, from the lines of leaves |
//! | `direct` | light straight from lamps, found exactly: [`direct_lamps`] |
//! | `lit` | both together, and over curved bodies |
//! | `weights` | how much each corner of a polygon counts at a point |
//! | `assemble` | a snapshot as an ordered list of things to draw |
//! | `raster` | which thing each sample of each pixel sees |
//! | `stitch` | points of neighbours on the edges of patches |
//! | `tone` | radiosity to display values and bytes |
//! | `layers` | what is seen as numbers, and OpenEXR files: [`Layers`] |
//! | `exposure` | one exposure for a clip |
//! | `show` | numbers, elements and bodies that a view sees: [`numbers_of`], [`mesh`], [`bodies`] |
//! | `maps` | numbers as colours: [`Scale`] |
//! | `sketch` | a rough picture of a scene that is not solved: [`Sketch`] |
//! | `recording` | light at several instants on one triangulation: [`Recorder`] |
//! | `image` | pixels and PNG files |

mod assemble;
mod camera;
mod direct;
mod exposure;
mod field;
mod gouraud;
mod image;
mod layers;
mod lit;
mod maps;
mod outline;
mod overview;
mod printed;
mod project;
mod raster;
mod recording;
mod render;
mod shading;
mod show;
mod sketch;
mod smooth;
mod stitch;
mod tone;
mod tuning;
mod weights;

pub use camera::{View, ViewError, Viewpoint};
pub use direct::direct_lamps;
pub use exposure::{Exposure, Metered};
pub use image::{Image, WriteError, is_whole_png};
pub use layers::{Layers, Seen, is_whole_exr, layers};
pub use maps::{ColourMap, Numbers, Scale};
pub use outline::Outlines;
pub use overview::Overview;
pub use recording::{PatchLight, Recorder, Recording};
pub use render::{Settings, render};
pub use shading::Shading;
pub use show::{bodies, colour_of_body, mesh, numbers_of, numbers_of_leaves};
pub use sketch::Sketch;
pub use tone::Tone;
