//! Groups of a planted forest: which clusters may be ends of links, and their facets.

use glam::DVec3;

use super::Forest;
use crate::element::groups::{Group, GroupLeaf, Groups, Layout, NONE, NormalCone, Sort};
use crate::element::ids::{ElementId, Kind};
use crate::element::tuning::{ACROSS_SHARE, AREA_SHARE};
use crate::scene::Scene;

/// Height over the plane of a face, in radii of a group, from which a corner counts as in front of it.
const IN_FRONT: f64 = 1e-6;

/// The groups of a planted forest.
pub(super) fn groups_of(scene: &Scene, forest: &Forest, layout: &Layout) -> Groups {
    let len = forest.fixed_len() as usize;
    let numbers = vec![NONE; len];
    let spans = vec![0..0; len];
    let mut out = Groups { numbers, spans, ..Groups::default() };
    let area_max = AREA_SHARE * scene.made_area_m2();
    let across_max = scene.made_bounds().map_or(0.0, |bounds| ACROSS_SHARE * bounds.diagonal());
    let mut stack = vec![Forest::ROOT];
    while let Some(id) = stack.pop() {
        let rigid = forest.cluster_body(id).is_some() || forest.is_of_stage(id);
        if !rigid || forest.is_distant(id) {
            if forest.kind(id) == Kind::Cluster {
                stack.extend(forest.children(id).rev().map(ElementId));
            }
            continue;
        }
        if forest.cluster_body(id).is_some_and(|body| !layout.is_grouped(body)) {
            continue;
        }
        let fits = forest.area_m2(id) <= area_max
            && 2.0 * reach_of(scene, forest, id) <= across_max
            && is_of_one_small_sort(forest, layout, id);
        if fits {
            out.roots.push(id);
            add(&mut out, scene, forest, id);
        } else {
            stack.extend(forest.children(id).rev().map(ElementId));
        }
    }
    out.roots.sort_unstable();
    out
}

/// Adds a cluster with all below it; returns whether it is convex.
fn add(groups: &mut Groups, scene: &Scene, forest: &Forest, id: ElementId) -> bool {
    let start = groups.leaves.len() as u32;
    if forest.kind(id) == Kind::Element {
        groups.leaves.push(leaf_of(scene, forest, id));
    }
    let mut convex = true;
    for child in forest.children(id).map(ElementId) {
        convex &= add(groups, scene, forest, child);
    }
    let leaves = start..groups.leaves.len() as u32;
    groups.spans[id.0 as usize] = leaves.clone();
    if forest.kind(id) != Kind::Cluster {
        return true;
    }
    let own = &groups.leaves[leaves.start as usize..leaves.end as usize];
    let area: f64 = own.iter().map(|leaf| leaf.area_m2).sum();
    let centre = own.iter().map(|leaf| leaf.centre * leaf.area_m2).sum::<DVec3>() / area;
    let corners: Vec<DVec3> =
        own.iter().flat_map(|leaf| corners_of(scene, forest, leaf.facet)).collect();
    let radius = corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max);
    let in_front = |leaf: &GroupLeaf, corner: &DVec3| {
        leaf.normal.dot(*corner - leaf.centre) > IN_FRONT * radius
    };
    let is_convex =
        convex && !own.iter().any(|leaf| corners.iter().any(|corner| in_front(leaf, corner)));
    let solid_of = |leaf: &GroupLeaf| forest.patch(leaf.facet).and_then(|p| forest.solid(p));
    let first = solid_of(&own[0]);
    let solid = first.filter(|_| own.iter().all(|leaf| solid_of(leaf) == first));
    groups.numbers[id.0 as usize] = groups.list.len() as u32;
    groups.ids.push(id);
    let body = forest.cluster_body(id);
    let normals = NormalCone::of(own.iter().map(|leaf| (leaf.normal, leaf.area_m2)));
    groups.list.push(Group { leaves, centre, radius, body, is_convex, solid, normals });
    is_convex
}

fn leaf_of(scene: &Scene, forest: &Forest, facet: ElementId) -> GroupLeaf {
    let patch = forest.patch(facet).expect("a facet has a patch");
    let frame = scene.patches[patch.0 as usize].frame;
    let shape = forest.shape(facet);
    GroupLeaf {
        facet,
        centre: frame.point(shape.centroid()),
        normal: frame.normal,
        area_m2: shape.area(),
    }
}

fn corners_of(scene: &Scene, forest: &Forest, facet: ElementId) -> [DVec3; 4] {
    let patch = forest.patch(facet).expect("a facet has a patch");
    let frame = scene.patches[patch.0 as usize].frame;
    // A group is in its body's frame, which is the world's where the body rests.
    forest.shape(facet).corners.map(|c| frame.point(c))
}

/// Half the diagonal of the box of a node, metres.
fn reach_of(scene: &Scene, forest: &Forest, id: ElementId) -> f64 {
    let mut bounds = crate::geometry::Aabb::EMPTY;
    for_each_facet(forest, id, &mut |facet| {
        for corner in corners_of(scene, forest, facet) {
            bounds = bounds.with(corner);
        }
    });
    0.5 * bounds.diagonal()
}

/// Whether all patches of a node are small, and either all of them shine or none.
fn is_of_one_small_sort(forest: &Forest, layout: &Layout, id: ElementId) -> bool {
    let (mut all, mut first) = (true, None);
    for_each_facet(forest, id, &mut |facet| {
        let patch = forest.patch(facet).expect("a facet has a patch");
        let sort = layout.sort(patch.0);
        all &= sort != Sort::Large && *first.get_or_insert(sort) == sort;
    });
    all
}

fn for_each_facet(forest: &Forest, id: ElementId, visit: &mut dyn FnMut(ElementId)) {
    let mut stack = vec![id];
    while let Some(id) = stack.pop() {
        if forest.kind(id) == Kind::Element {
            visit(id);
        } else {
            stack.extend(forest.children(id).map(ElementId));
        }
    }
}
