//! How radiosity is shown over the elements.

/// How the elements' constant radiosities are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Shading {
    /// Every leaf in its one radiosity.
    Flat,
    /// Linear over a Delaunay triangulation of the sample points, patch by patch.
    #[default]
    Gouraud,
}
