//! Groups: clusters of small patches of one rigid body that may be ends of links.
//!
//! Which there are, and all that is known of them, is a pure function of the scene and of the bodies that hands have displaced: in
//! the frame of the body, or in the world for a cluster of several bodies, all of them at rest. Must not know light or links.

use std::ops::Range;

use glam::DVec3;

use super::ids::ElementId;
use super::tuning::{PATCHES_MIN, SMALL_SHARE, WIDE};
use crate::scene::{BodyId, Scene};

/// Sorts of patches that are planted apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sort {
    /// As large as a group.
    Large,
    /// Small, and emits light at some time.
    Shines,
    /// Small, and does not.
    Small,
}

impl Sort {
    pub(super) const ALL: [Sort; 3] = [Sort::Large, Sort::Shines, Sort::Small];
}

/// How the bodies of a scene are planted. By default each for itself, in one tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    /// By patch; empty if no body is sorted.
    sorts: Vec<Sort>,
    /// By body: whether its patches are planted by sorts.
    sorted: Vec<bool>,
    /// By body: whether it is planted under one node with all others that no clip moves and that have few small patches.
    staged: Vec<bool>,
    /// By body: whether it is not where the scene has it at rest.
    displaced: Vec<bool>,
    /// By body: whether it may hold groups: of an inserted one it depends on that body alone.
    grouped: Vec<bool>,
}

impl Layout {
    /// How they are where some bodies that never move in the clip are displaced. What is planted where does not depend on
    /// these: only which clusters of several bodies are of one frame, and so may be groups. Cost: proportional to the patches.
    pub(super) fn of(scene: &Scene, is_displaced: &dyn Fn(BodyId) -> bool) -> Layout {
        let small_m2 = SMALL_SHARE * scene.made_area_m2();
        let sort_of = |patch: &crate::scene::Patch| match patch.area_m2() > small_m2 {
            true => Sort::Large,
            false if scene.patch_emits(patch) => Sort::Shines,
            false => Sort::Small,
        };
        let sorts: Vec<Sort> = scene.patches.iter().map(sort_of).collect();
        let bodies = || (0..scene.bodies.len() as u32).map(BodyId);
        let small = |body: BodyId| {
            let patches = scene.bodies[body.0 as usize].patches.clone();
            patches.filter(|&patch| sorts[patch as usize] != Sort::Large).count()
        };
        let rests = |body: &BodyId| {
            !scene.is_distant(*body) && !scene.moves(*body) && !scene.is_inserted(*body)
        };
        // A body of many small patches stands for itself, whether it rests or not.
        let sorted = |body: BodyId| !scene.is_distant(body) && small(body) >= PATCHES_MIN;
        let shares = |body: &BodyId| rests(body) && !sorted(*body);
        let resting: usize = bodies().filter(shares).map(small).sum();
        let staged = |body: BodyId| shares(&body) && resting >= PATCHES_MIN;
        let (sorted, staged): (Vec<bool>, Vec<bool>) =
            bodies().map(|body| (sorted(body), staged(body))).unzip();
        let own = |body: BodyId| sorted[body.0 as usize] || staged[body.0 as usize];
        let any_made = bodies().any(|body| !scene.is_inserted(body) && own(body));
        let may = |body| if scene.is_inserted(body) { own(body) } else { any_made };
        let grouped = bodies().map(may).collect();
        let displaced = bodies().map(is_displaced).collect();
        let layout = Layout { sorts, sorted, staged, displaced, grouped };
        if layout.has_groups() { layout } else { Layout::default() }
    }

    /// How many patches are small and may be in groups.
    fn small_count(&self) -> usize {
        self.sorts.iter().filter(|&&sort| sort != Sort::Large).count()
    }

    /// Whether there may be any groups.
    pub(super) fn has_groups(&self) -> bool {
        self.sorted.contains(&true) || self.staged.contains(&true)
    }

    pub(super) fn is_grouped(&self, body: BodyId) -> bool {
        self.grouped.get(body.0 as usize).is_some_and(|&grouped| grouped)
    }

    pub(super) fn is_sorted(&self, body: u32) -> bool {
        self.sorted.get(body as usize).is_some_and(|&sorted| sorted)
    }

    pub(super) fn is_staged(&self, body: u32) -> bool {
        self.staged.get(body as usize).is_some_and(|&staged| staged)
    }

    pub(super) fn is_displaced(&self, body: u32) -> bool {
        self.displaced.get(body as usize).is_some_and(|&displaced| displaced)
    }

    /// The one sort of all patches of a body; `None` where there are several, or a large one.
    pub(super) fn pure_sort(&self, patches: Range<u32>) -> Option<Sort> {
        let first = self.sort(patches.start);
        let is_pure = first != Sort::Large && patches.into_iter().all(|p| self.sort(p) == first);
        is_pure.then_some(first)
    }

    pub(super) fn sort(&self, patch: u32) -> Sort {
        self.sorts.get(patch as usize).copied().unwrap_or(Sort::Large)
    }
}

/// How many patches of a scene groups are made of ([`Forest::with_groups`](super::Forest::with_groups)); 0 where there are none. Cost: proportional to
/// the patches.
pub fn grouped_patches(scene: &Scene) -> usize {
    Layout::of(scene, &|_| false).small_count()
}

/// Parts of what is distant that groups are linked with ([`Forest::is_wide`](super::Forest::is_wide)), and those that meet each patch.
pub fn distant_parts(scene: &Scene) -> [u64; 2] {
    let wide_m2 = (WIDE * scene.outside_m).powi(2);
    let distant = scene.patches.iter().filter(|p| scene.is_distant(p.body));
    distant.fold([0, 0], |[wide, narrow], patch| match patch.area_m2() > wide_m2 {
        true => [wide + 1, narrow],
        false => [wide, narrow + 1],
    })
}

/// A facet of a group, as a point that radiates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupLeaf {
    /// The facet.
    pub facet: ElementId,
    /// Centroid, metres.
    pub centre: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Area, m2.
    pub area_m2: f64,
}

/// What is known of a cluster that may be an end of links: in the frame of its body, or in the world if it is of several
/// bodies that never move.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Its facets, by their places in [`Groups::leaves`].
    pub leaves: Range<u32>,
    /// Area-weighted middle of its facets, metres.
    pub centre: DVec3,
    /// Largest distance of a corner from the middle, metres.
    pub radius: f64,
    /// Its body; `None` for a cluster of several bodies, all of them at rest.
    pub body: Option<BodyId>,
    /// Whether no corner of it is in front of any of its planes: nothing of it sees anything else of it.
    pub is_convex: bool,
    /// The convex solid that all of its facets are of, if there is one.
    pub solid: Option<u32>,
    /// Cone around the normals of its facets.
    pub normals: NormalCone,
}

/// A cone of directions around an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalCone {
    /// Unit axis; any where the angle is pi.
    pub axis: DVec3,
    /// Largest angle of a direction with the axis, radians.
    pub angle: f64,
}

impl NormalCone {
    /// The cone of one direction.
    pub fn of_one(normal: DVec3) -> NormalCone {
        NormalCone { axis: normal, angle: 0.0 }
    }

    /// A cone around weighted directions: its axis is their mean.
    pub(super) fn of(normals: impl Iterator<Item = (DVec3, f64)> + Clone) -> NormalCone {
        let mean: DVec3 = normals.clone().map(|(normal, weight)| normal * weight).sum();
        let weight: f64 = normals.clone().map(|(_, weight)| weight).sum();
        // Of directions that cancel out the mean is a rounding.
        if mean.length() < 1e-3 * weight {
            return NormalCone { axis: DVec3::Z, angle: std::f64::consts::PI };
        }
        let axis = mean.normalize();
        let least = normals.map(|(normal, _)| axis.dot(normal)).fold(1.0, f64::min);
        NormalCone { axis, angle: libm::acos(least.max(-1.0)) }
    }

    /// Half the angle of the smallest cone around this one and another, radians.
    pub fn half_angle_with(&self, other: &NormalCone) -> f64 {
        let between = libm::acos(self.axis.dot(other.axis).clamp(-1.0, 1.0));
        self.angle.max(other.angle).max(0.5 * (self.angle + other.angle + between))
    }
}

/// All groups of a forest.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    pub(super) list: Vec<Group>,
    /// Their ids.
    pub(super) ids: Vec<ElementId>,
    /// Number of each node's group, by id; [`NONE`] for what is none.
    pub(super) numbers: Vec<u32>,
    /// Places in `leaves` of what is at or below a node, by id; empty outside groups.
    pub(super) spans: Vec<Range<u32>>,
    pub(super) leaves: Vec<GroupLeaf>,
    /// Those that are in no other.
    pub(super) roots: Vec<ElementId>,
}

/// Number of a node that is no group.
pub(super) const NONE: u32 = u32::MAX;

impl Groups {
    /// The group that a node is.
    #[inline]
    pub(super) fn get(&self, id: ElementId) -> Option<&Group> {
        let number = *self.numbers.get(id.0 as usize)?;
        self.list.get(number as usize)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Ids of all groups.
    pub fn ids(&self) -> impl Iterator<Item = ElementId> + '_ {
        self.ids.iter().copied()
    }

    /// Those that are in no other.
    pub fn roots(&self) -> &[ElementId] {
        &self.roots
    }

    /// Which of [`Groups::roots`] a node is, if it is one.
    pub fn root_number(&self, id: ElementId) -> Option<usize> {
        self.roots.binary_search(&id).ok()
    }

    /// The facets of all groups: those of each side by side.
    pub fn leaves(&self) -> &[GroupLeaf] {
        &self.leaves
    }

    /// The facets of one group.
    pub fn leaves_of(&self, group: &Group) -> &[GroupLeaf] {
        &self.leaves[group.leaves.start as usize..group.leaves.end as usize]
    }

    /// Whether a node of the fixed part is a group's, or at or below it.
    pub fn is_within(&self, id: ElementId, group: &Group) -> bool {
        let Some(span) = self.spans.get(id.0 as usize) else { return false };
        !span.is_empty() && span.start >= group.leaves.start && span.end <= group.leaves.end
    }

    /// Whether a node of the fixed part is in some group, or one itself.
    pub(super) fn holds(&self, id: ElementId) -> bool {
        self.spans.get(id.0 as usize).is_some_and(|span| !span.is_empty())
    }

    /// Bytes held.
    pub(super) fn memory_bytes(&self) -> u64 {
        let lists = self.list.capacity() * size_of::<Group>()
            + self.leaves.capacity() * size_of::<GroupLeaf>();
        let by_id = self.numbers.capacity() * 4 + self.spans.capacity() * 8;
        (lists + by_id + (self.ids.capacity() + self.roots.capacity()) * 4) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cone(normals: &[DVec3]) -> NormalCone {
        NormalCone::of(normals.iter().map(|&normal| (normal.normalize(), 1.0)))
    }

    #[test]
    fn a_cone_holds_its_directions_and_a_cone_around_two_holds_both() {
        let one = cone(&[DVec3::new(0.1, 0.0, 1.0), DVec3::new(-0.1, 0.0, 1.0)]);
        assert!((one.axis - DVec3::Z).length() < 1e-12);
        assert!((one.angle - libm::atan(0.1)).abs() < 1e-12);
        // Side by side: from the far edge of one to the far edge of the other.
        let aside = NormalCone { axis: DVec3::X, angle: 0.2 };
        let around = 0.5 * (one.angle + 0.2 + std::f64::consts::FRAC_PI_2);
        assert!((one.half_angle_with(&aside) - around).abs() < 1e-12);
        // One within the other.
        let inner = NormalCone::of_one(DVec3::new(0.01, 0.0, 1.0).normalize());
        assert_eq!(one.half_angle_with(&inner), one.angle);
    }

    #[test]
    fn directions_that_cancel_out_fill_the_sphere() {
        let cone = cone(&[DVec3::Z, DVec3::NEG_Z]);
        assert_eq!(cone.angle, std::f64::consts::PI);
    }
}
