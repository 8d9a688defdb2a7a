//! Report of a frame: exact counters, energies, seconds.

use serde::Serialize;

use crate::pair::Work;

/// Counters, energies and seconds of a frame: an entry of `frames` in a report of schema `relume-report/1`.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct FrameReport {
    /// Frame number.
    pub frame: u32,
    /// Time in the animation, seconds.
    pub time_s: f64,
    /// Names of the bodies whose pose differs from the frame before.
    pub moved: Vec<String>,
    /// Elements alive: every node of the forest that can carry radiosity.
    pub elements: u64,
    /// Elements without children: what is drawn.
    pub leaves: u64,
    /// Active pairs: links, each used in both directions.
    pub links: u64,
    /// Nodes of the pair tree by state.
    pub pairs: PairCounts,
    /// Links by what they end on; absent where no group of patches is an end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link_kinds: Option<LinkKinds>,
    /// Exact counts of what was evaluated and edited; in JSON its fields stand among the others.
    #[serde(flatten)]
    pub work: Work,
    /// Number of elements that were taken away, since no link ends on them any more.
    pub elements_reaped: u64,
    /// Gather sweeps of the solver.
    pub sweeps: u32,
    /// Receivers gathered in all sweeps together.
    pub gathers: u64,
    /// Largest change of radiosity that the last sweep left undone, relative to the mean radiosity.
    pub residual: f64,
    /// Distance of the row sums of the form factors from 1, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row_sum_error: Option<RowSumError>,
    /// Flux balance, summed over the three channels, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<Energy>,
    /// Errors of the solution, where they were estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<Accuracy>,
    /// Surfaces that receive most light over rows that sum to more than 1; empty unless the balance is off.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub suspects: Vec<String>,
    /// Hash over the active pairs with their exchange areas and visibilities, in key order.
    pub hash: String,
    /// Wall-clock seconds by phase.
    pub seconds: Seconds,
}

/// Nodes of the pair tree by state.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PairCounts {
    /// Links.
    pub active: u64,
    /// Pairs whose children carry the transport.
    pub refined: u64,
    /// Pairs that exchange nothing.
    pub culled: u64,
}

/// Links by what they end on: groups of patches, or elements (and lights).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LinkKinds {
    /// Between two elements.
    pub element_element: u64,
    /// Between a group and an element.
    pub group_element: u64,
    /// Between two groups.
    pub group_group: u64,
}

/// |1 - row sum| over the leaf elements of one frame.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct RowSumError {
    /// Area-weighted root mean square.
    pub rms: f64,
    /// Largest.
    pub max: f64,
}

/// Flux balance of a frame, watts, summed over the channels.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Energy {
    /// Emitted by surfaces and punctual lights.
    pub emitted_w: f64,
    /// Absorbed by surfaces.
    pub absorbed_w: f64,
    /// Flux that leaves the scene: sent by surfaces along no link. Below 0 where form factors sum to more than 1.
    pub escaped_w: f64,
}

impl Energy {
    /// Error of the balance as a share of the emitted flux, 1: the larger of |emitted - absorbed - escaped| and of the flux that
    /// arrives beyond what is sent.
    pub fn unbalanced(&self) -> f64 {
        let residual_w = (self.emitted_w - self.absorbed_w - self.escaped_w).abs();
        // What is not a number stays one.
        let off = if -self.escaped_w > residual_w { -self.escaped_w } else { residual_w };
        if self.emitted_w > 0.0 { off / self.emitted_w } else { 0.0 }
    }
}

/// Estimated errors of irradiance at some points, relative to the irradiance there (sum of the channels), dimensionless: of the
/// mesh (`Snapshot::irradiance_at`), or of what sensors read (`Frame::irradiance_at`), as it was asked for. Estimated, not
/// bounded. By `Frame::estimate` all are relative to the larger of what is said and what arrives: a dark place that is said to be
/// bright is wholly wrong, and no more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Accuracy {
    /// Number of points.
    pub points: u32,
    /// Root mean square of the errors over the points.
    pub rms: f64,
    /// Size of error that nine tenths of the points, each for the area that it stands for, do not exceed.
    pub nine_tenths: f64,
    /// Root mean square error that these points and walks can tell from none: of what is below, `rms` says nothing.
    pub resolved: f64,
    /// Mean of the errors, with its sign: positive where the solution is too bright.
    pub mean: f64,
    /// Largest of the errors, with its sign: positive where the solution is too bright.
    pub largest: f64,
    /// Point of the largest error, metres.
    pub largest_at: [f64; 3],
}

/// Bytes that the engine's structures hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Pair tree and links by receiver.
    pub pairs: u64,
    /// Element forest, radiosities, and where each element's links are.
    pub elements: u64,
    /// Structures of the same size at every tolerance: the forest that builds start from, data of
    /// facets and clusters alone (one copy for all), the coarse solution.
    pub fixed: u64,
}

/// Wall-clock seconds by phase.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Seconds {
    /// Poses and bounds.
    #[serde(rename = "move")]
    pub moving: f64,
    /// Which pairs are affected.
    pub predict: f64,
    /// Exchange areas and visibilities.
    pub evaluate: f64,
    /// Edits of the links, the elements and the groups.
    #[serde(rename = "judge")]
    pub edit: f64,
    /// Gather, push, pull.
    pub solve: f64,
    /// The whole step.
    pub total: f64,
}

impl FrameReport {
    /// The report of a frame in which nothing changed: the state as it was, and no work.
    pub(super) fn of_a_still_frame(&self, label: FrameReport) -> FrameReport {
        FrameReport {
            elements: self.elements,
            leaves: self.leaves,
            links: self.links,
            pairs: self.pairs,
            link_kinds: self.link_kinds,
            residual: self.residual,
            row_sum_error: self.row_sum_error,
            energy: self.energy,
            suspects: self.suspects.clone(),
            hash: self.hash.clone(),
            ..label
        }
    }
}
