//! What a solve has left to do, batch by batch: which receivers to gather, and the ways to them.

use super::dirty_path::{Batch, DirtyPath, clear_bit, set_bit};
use super::field::Linear;
use super::links::Links;
use super::settle::Settled;
use super::surfaces::{Surfaces, for_each_below};
use super::tuning::{ALL_SHARE, BATCHES, PENDING_SHARE, SOME_SHARE};

/// Which receivers to gather anew to begin with.
#[derive(Clone, Debug)]
pub enum Dirty {
    /// All of them.
    All,
    /// Some of them, and all that depends on them.
    Some {
        /// Receivers whose links changed.
        receivers: Vec<u32>,
        /// Elements whose children came or went.
        parents: Vec<u32>,
    },
}

/// What is left to be done, batch by batch.
pub(super) struct Work {
    pub(super) batches: Vec<Batch>,
    /// Batch of each facet, by the facet's id.
    batch_of: Vec<u16>,
    /// Receivers that wait in some batch, a bit each.
    marks: Vec<u64>,
    /// Every sweep gathers everything.
    pub(super) all: bool,
    /// Elements that the last sweep changed by more than the limit, and by how much.
    pub(super) changed: Vec<(u32, f32)>,
    pub(super) path: DirtyPath,
    pub(super) scratch: Scratch,
}

/// Room that is used again and again.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) gathered: Vec<Linear>,
    pub(super) settled: Vec<Settled>,
}

impl Work {
    pub(super) fn new(surfaces: &impl Surfaces, dirty: Dirty) -> Work {
        let facets = surfaces.facets();
        let first = surfaces.first_facets();
        let count = first.min(BATCHES).max(facets.len().min(1));
        let mut batches: Vec<Batch> = (0..count).map(|_| Batch::default()).collect();
        let mut batch_of = vec![0; facets.last().map_or(0, |f| f.0 as usize + 1)];
        for (k, facet) in facets.iter().enumerate() {
            let batch = if k < first { k * count / first } else { count - 1 };
            batches[batch].facets.push(facet.0);
            batch_of[facet.0 as usize] = batch as u16;
        }
        let marks = vec![0; surfaces.len() / 64 + 1];
        let mut work = Work {
            batches,
            batch_of,
            marks,
            all: false,
            changed: Vec::new(),
            path: DirtyPath::new(surfaces.len()),
            scratch: Scratch::default(),
        };
        match dirty {
            Dirty::Some { receivers, parents }
                if receivers.len() <= surfaces.len() / SOME_SHARE =>
            {
                for parent in parents {
                    let batch = work.batch_of(surfaces, parent);
                    work.batches[batch].parents.push(parent);
                }
                receivers.into_iter().for_each(|id| work.mark(surfaces, id));
            }
            _ => work.start_all(surfaces),
        }
        work
    }

    pub(super) fn start_all(&mut self, surfaces: &impl Surfaces) {
        self.all = true;
        self.marks.fill(0);
        for batch in &mut self.batches {
            batch.receivers.clear();
            for &facet in &batch.facets {
                for_each_below(surfaces, facet, &mut |id| batch.receivers.push(id));
            }
        }
    }

    fn batch_of(&self, surfaces: &impl Surfaces, id: u32) -> usize {
        usize::from(self.batch_of[surfaces.facet_of(id) as usize])
    }

    /// Lets a receiver wait to be gathered.
    pub(super) fn mark(&mut self, surfaces: &impl Surfaces, id: u32) {
        if !set_bit(&mut self.marks, id) {
            let batch = self.batch_of(surfaces, id);
            self.batches[batch].receivers.push(id);
        }
    }

    /// Marks who gathers from an element that changed, as soon as the changes add up to something.
    pub(super) fn mark_neighbours(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        id: u32,
        change: f32,
        limit: f32,
        pending: &mut [f32],
    ) {
        let flux = change * surfaces.area_m2(id) as f32;
        // Whoever an element gathers from gathers from it.
        for link in links.of(id) {
            // Sources that are no surfaces receive nothing.
            let area = surfaces.area_m2(link.source) as f32;
            if area > 0.0 {
                let pending = &mut pending[link.source as usize];
                *pending += flux * link.coupling / area;
                if *pending > limit * PENDING_SHARE {
                    self.mark(surfaces, link.source);
                }
            }
        }
    }

    /// What a batch has to do now. Of a sweep over all it is to be put back.
    pub(super) fn take(&mut self, surfaces: &impl Surfaces, batch: usize) -> Batch {
        if self.all {
            return std::mem::take(&mut self.batches[batch]);
        }
        let batch = &mut self.batches[batch];
        let mut receivers = std::mem::take(&mut batch.receivers);
        receivers.sort_unstable();
        receivers.iter().for_each(|&id| clear_bit(&mut self.marks, id));
        let parents = std::mem::take(&mut batch.parents);
        let concerned = receivers.iter().chain(&parents);
        let mut facets: Vec<u32> = concerned.map(|&id| surfaces.facet_of(id)).collect();
        facets.sort_unstable();
        facets.dedup();
        Batch { receivers, changes: Vec::new(), facets, parents }
    }

    /// Whether another sweep is needed.
    pub(super) fn is_left(
        &mut self,
        surfaces: &impl Surfaces,
        links: &Links,
        limit: f32,
        pending: &mut [f32],
    ) -> bool {
        let many =
            self.changed.len() > surfaces.len() / if self.all { ALL_SHARE } else { SOME_SHARE };
        if self.all && !many {
            // From now on only what depends on a change.
            self.all = false;
            self.batches.iter_mut().for_each(|b| b.receivers.clear());
            for (id, change) in std::mem::take(&mut self.changed) {
                self.mark_neighbours(surfaces, links, id, change, limit, pending);
            }
        } else if many && !self.all {
            self.start_all(surfaces);
        }
        self.all || self.waits()
    }

    /// Whether receivers wait.
    pub(super) fn waits(&self) -> bool {
        self.batches.iter().any(|b| !b.receivers.is_empty())
    }
}
