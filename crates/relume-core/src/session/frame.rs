//! A solved state as its readers see it.

use glam::DVec3;

use crate::geometry::Pose;

use super::{Accuracy, Event, FrameReport, Sensor, Session, Snapshot};

/// The solution of a world, until the session goes on.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    session: &'a Session,
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
    /// The present solution of a session that has one.
    pub(super) fn new(session: &'a Session) -> Frame<'a> {
        Frame { session }
    }

    /// Counters, energies and seconds.
    pub fn report(&self) -> &'a FrameReport {
        &self.session.now().report
    }

    /// The hash of the links.
    pub fn hash(&self) -> Hash {
        Hash(self.session.now().hash.bits())
    }

    /// Irradiance at a point with a unit normal, W/m2, linear RGB: gathered from all elements and punctual lights, each
    /// with visibility of its own from this point. What an emitter emits is exact; what an element sends errs by its
    /// radiosity's variation within it.
    pub fn irradiance_at(&self, point: impl Into<DVec3>, normal: impl Into<DVec3>) -> [f64; 3] {
        self.session.irradiance_at(point.into(), normal.into())
    }

    /// Irradiances at many sensors in parallel, W/m2, linear RGB, in their order. Cost: some 0.1 us for each element
    /// that is neither far from a sensor nor hidden, more where something is partly in the way.
    pub fn irradiances_at(&self, sensors: &[Sensor]) -> Vec<[f64; 3]> {
        self.session.irradiances_at(sensors)
    }

    /// Errors of the solution, estimated at so many points with exact visibility; each costs some fifty sensors.
    pub fn accuracy(&self, points: usize) -> Accuracy {
        self.session.accuracy(points)
    }

    /// Errors of what sensors read, estimated at each of them as by [`Frame::accuracy`]; where no light arrives, there is none.
    pub fn accuracy_at(&self, sensors: &[Sensor]) -> Accuracy {
        self.session.accuracy_at(sensors)
    }

    /// The link events of this frame, if [`super::Options::events`] asks for them.
    pub fn events(&self) -> Vec<Event> {
        self.session.events()
    }

    /// Sums of the form factors from every leaf element, in no order of meaning: 1 in a closed scene, up to the links'
    /// errors.
    pub fn row_sums(&self) -> Vec<f64> {
        self.session.row_sums().into_iter().map(|(_, sum)| sum).collect()
    }

    /// The solution as pictures and exports read it.
    pub fn solution(&self) -> Snapshot {
        self.session.snapshot()
    }

    /// The same with the light of every element found anew from all links above it: cleaner corners and contact
    /// shadows. Cost: some ten times that of a frame with a moving light.
    pub fn reconstruction(&self) -> Snapshot {
        self.session.reconstruction()
    }

    /// The radiosity of all surfaces, as flat arrays.
    pub fn snapshot(&self) -> Mesh {
        let Snapshot { scene, world, leaves, leaf_offsets, .. } = self.session.snapshot();
        let mut mesh = Mesh { revision: u64::from(self.session.frames), ..Mesh::default() };
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
}
