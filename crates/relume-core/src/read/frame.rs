//! A solved state as its readers see it.

use std::sync::Arc;

use glam::DVec3;

use crate::element::{ElementId, Forest};
use crate::follow::{Accuracy, FrameReport};
use crate::geometry::Pose;
use crate::pair::{Link, LinkEvent, PairTree};
use crate::scene::{PatchId, Scene};
use crate::solver::{Links, Radiosity};
use crate::space::{Sensor, Solved, row_sums_of};

use super::estimate::{self, PointError};
use super::events::{self, Event};
use super::factors::{Factors, Grouping, GroupingError};
use super::fluxes::{self, Flux};
use super::sensors;
use super::snapshot::{self, Snapshot};
use super::{accuracy, direct, reconstruct};

/// Solution of a world, readable until the session changes.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    solved: &'a Solved,
    revision: u32,
}

/// A 128-bit hash of all links with their exchange areas and visibilities: equal for equal states, whatever led to
/// them, on any number of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Hash(u128);

impl std::fmt::Display for Hash {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// The leaves of a solution as flat arrays, in the world: one entry for each leaf.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Mesh {
    /// Corners, metres, counter-clockwise seen from the front; a triangle repeats its last.
    pub corners: Vec<[[f32; 3]; 4]>,
    /// Radiosity, W/m2, linear RGB.
    pub radiosity: Vec<[f32; 3]>,
    /// Index of the patch that it is a part of.
    pub patch: Vec<u32>,
    /// Number of the solve that it is of: meshes of one session with the same number are equal.
    pub revision: u64,
}

impl<'a> Frame<'a> {
    /// A solution, with the number of the solve that it is of.
    pub(crate) fn new(solved: &'a Solved, revision: u32) -> Frame<'a> {
        Frame { solved, revision }
    }

    /// The scene that was solved; bodies inserted or removed since are not in it.
    pub fn scene(&self) -> &'a Arc<Scene> {
        &self.solved.space.scene
    }

    /// Counters, energies and seconds.
    pub fn report(&self) -> &'a FrameReport {
        &self.solved.report
    }

    /// The hash of the links.
    pub fn hash(&self) -> Hash {
        Hash(self.solved.hash.bits())
    }

    /// Irradiance at a point with a normal of any length but 0, W/m2, linear RGB: gathered from all elements and punctual lights,
    /// each with visibility of its own from this point. What an emitter emits is exact; what an element sends errs by its
    /// radiosity's variation within it. NaN where the point or the direction of the normal is no number.
    pub fn irradiance_at(&self, point: impl Into<DVec3>, normal: impl Into<DVec3>) -> [f64; 3] {
        self.irradiances_at(&[Sensor { at: point.into(), normal: normal.into() }])[0]
    }

    /// Irradiances at many sensors in parallel, W/m2, linear RGB, in their order. Cost: some 0.1 us for each element
    /// that is neither far from a sensor nor hidden, more where something is partly in the way.
    pub fn irradiances_at(&self, sensors: &[Sensor]) -> Vec<[f64; 3]> {
        let sensors: Vec<Sensor> = sensors.iter().map(Sensor::with_unit_normal).collect();
        sensors::irradiances_at(self.solved, &sensors)
    }

    /// Errors of the mesh's irradiance, estimated at `points` points by walks along rays. Cost: some 2,000 rays a point.
    pub fn accuracy(&self, points: usize) -> Accuracy {
        accuracy::accuracy(self.solved, points)
    }

    /// Errors of the mesh's irradiance, estimated at 4 to 128 points, most of them where light changes much over a leaf: there it
    /// is gathered from the elements with exact visibility. What the elements send is taken at its word, so light that comes wrong
    /// from elsewhere is not told ([`Frame::accuracy`] tells it). The number of points follows from numbers of links, leaves and
    /// patches, so that the cost is some tenth of that of a cold build.
    pub fn estimate(&self) -> Accuracy {
        estimate::estimate(self.solved)
    }

    /// Errors of the mesh's irradiance point by point, as [`Frame::estimate`] finds them, at so many points, with the part of the light of
    /// lamps in each error. Points that are dark are left out. Cost: some 0.2 to 2 ms a point, and a sweep over all links.
    pub fn errors(&self, points: usize) -> Vec<PointError> {
        estimate::errors(self.solved, points, true)
    }

    /// Errors of the irradiance at sensors, estimated at each of them as by [`Frame::accuracy`]. Those where no light arrives are left
    /// out, and so are those of which the point or the direction of the normal is no number: [`Accuracy::points`] counts the others.
    pub fn accuracy_at(&self, sensors: &[Sensor]) -> Accuracy {
        let units = sensors.iter().map(Sensor::with_unit_normal);
        let sensors: Vec<Sensor> = units.filter(Sensor::is_finite).collect();
        accuracy::accuracy_at(self.solved, &sensors)
    }

    /// The link events of this frame, if [`Options::events`](crate::session::Options::events) asks for them: none after a cold build.
    /// In the order in which they were found, which is the same for any number of threads.
    pub fn events(&self) -> Vec<Event> {
        events::named(self.solved)
    }

    /// Form factors between groups of patches.
    ///
    /// Error of an entry: that of its links, which the tolerance bounds relative to the row where
    /// nothing emits (see [`Scene::without_light`](crate::scene::Scene::without_light)). Cost: one pass over all links.
    ///
    /// # Errors
    /// If the grouping is for another scene than [`Frame::scene`], or has a group without a name.
    pub fn factors(&self, grouping: &Grouping) -> Result<Factors, GroupingError> {
        grouping.fits(self.scene())?;
        Ok(Factors::of(self.solved, grouping))
    }

    /// Fluxes emitted by, arriving at and absorbed by groups of patches, W, in their order. Errors: the tolerance's, in the mean over a
    /// group. Cost: one pass over all elements.
    ///
    /// # Errors
    /// As [`Frame::factors`].
    pub fn fluxes(&self, grouping: &Grouping) -> Result<Vec<Flux>, GroupingError> {
        grouping.fits(self.scene())?;
        Ok(fluxes::fluxes(self.solved, grouping))
    }

    /// Sums of the form factors from every leaf element, in no particular order: 1 in a closed scene, up to the links'
    /// errors. Elements of absent bodies are among them.
    pub fn row_sums(&self) -> Vec<f64> {
        row_sums_of(self.solved).into_iter().map(|(_, sum)| sum).collect()
    }

    /// The same with the elements.
    #[doc(hidden)]
    pub fn rows(&self) -> Vec<(ElementId, f64)> {
        row_sums_of(self.solved)
    }

    /// The solution as pictures and exports read it, with the second order (bends), which links, keeping means and gradients,
    /// leave out. Cost: a pass over all links, some 90 ns each.
    pub fn solution(&self) -> Snapshot {
        snapshot::take(self.solved, &self.solved.links, &self.solved.radiosity)
    }

    /// The same with [`Snapshot::indirect`]: the light of leaves without what comes straight from punctual lights and from some
    /// patches, lamps, emit. For who finds that more exactly than the mesh has it. Cost: another sweep over all links.
    pub fn solution_beside(&self, lamps: &[PatchId]) -> Snapshot {
        self.beside(&self.solved.links, &self.solved.radiosity, lamps)
    }

    /// The solution as [`Frame::solution`] reads it, with the light of every element gathered again over links of each leaf's own
    /// in place of links of its ancestors: along edges between surfaces, where leaves of [`Frame::solution`] inherit lines and
    /// parabolas through steep curves, some thirty times as accurate. The solution itself stays as it is.
    ///
    /// Error: at the default tolerance leaves of a uniform closed scene are within 1e-3, relative
    /// (docs/tolerance.md). Cost: some ten times that of a frame with a moving light.
    pub fn reconstruction(&self) -> Snapshot {
        let (links, radiosity) = reconstruct::solve(self.solved);
        snapshot::take(self.solved, &links, &radiosity)
    }

    /// The same with [`Snapshot::indirect`], as [`Frame::solution_beside`] has it.
    pub fn reconstruction_beside(&self, lamps: &[PatchId]) -> Snapshot {
        let (links, radiosity) = reconstruct::solve(self.solved);
        self.beside(&links, &radiosity, lamps)
    }

    fn beside(&self, links: &Links, radiosity: &Radiosity, lamps: &[PatchId]) -> Snapshot {
        let lights = direct::lights(self.solved, lamps);
        let direct = direct::of(self.solved, links, radiosity, &lights);
        let (all, lines) = snapshot::take_with_lines(self.solved, links, radiosity);
        all.beside((&lines, &direct), lights)
    }

    /// The radiosity of all surfaces, as flat arrays.
    pub fn snapshot(&self) -> Mesh {
        let Snapshot { scene, world, leaves, leaf_offsets, .. } = self.solution();
        let mut mesh = Mesh { revision: u64::from(self.revision), ..Mesh::default() };
        for (k, patch) in scene.patches.iter().enumerate() {
            let pose = world.pose(patch.body).unwrap_or(Pose::IDENTITY);
            for leaf in &leaves[leaf_offsets[k] as usize..leaf_offsets[k + 1] as usize] {
                let place = |c| pose.point(patch.frame.point(c)).as_vec3().to_array();
                mesh.corners.push(leaf.corners.map(place));
                mesh.radiosity.push(leaf.radiosity);
                mesh.patch.push(k as u32);
            }
        }
        mesh
    }

    /// The link events of this frame, by the keys of their ends.
    #[doc(hidden)]
    pub fn link_events(&self) -> &'a [LinkEvent] {
        &self.solved.events
    }

    /// For how long it is certified that motion changes a link's visibility in nothing, seconds from now, link by link; `None` where
    /// nothing is certified, so that the link is looked at in the next step. A lower bound of the time until its next event by
    /// occlusion; of links with a moving end the exchange area may bring one earlier. With it the longest that anything is certified for.
    #[doc(hidden)]
    pub fn certificates(&self) -> (Vec<(Link, Option<f64>)>, f64) {
        let Solved { tree, ticks, time_s, .. } = self.solved;
        let left = |until| {
            let left_s = ticks.time_s(until) - time_s;
            (until > 0 && left_s >= 0.0).then_some(left_s)
        };
        let links = tree.certified_links().into_iter().map(|(link, until)| (link, left(until)));
        (links.collect(), ticks.horizon_s())
    }

    /// The pair tree, with the forest its elements are in.
    #[doc(hidden)]
    pub fn pairs(&self) -> (&'a PairTree, &'a Forest) {
        (&self.solved.tree, &self.solved.space.forest)
    }

    /// The state itself.
    #[doc(hidden)]
    pub fn solved(&self) -> &'a Solved {
        self.solved
    }
}
