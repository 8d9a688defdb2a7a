//! How radiosity is shown over the elements.

/// How the elements' constant radiosities are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Shading {
    /// Every leaf in its one radiosity.
    Flat,
    /// Linear over a Delaunay triangulation of the sample points, patch by patch.
    Gouraud,
    /// One continuous function over every surface, blended from the lines of the leaves; with the light of lamps found exactly
    /// where the snapshot knows the rest ([`relume_core::session::Snapshot::indirect`]).
    #[default]
    Smooth,
}
