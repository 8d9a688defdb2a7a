//! Planting: the fixed part of the forest, from the scene down to its facets.
//!
//! Bodies, patches and inserted bodies come in an order that is a function of the scene alone; patches are cut along lines of
//! contact first.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::grouping::groups_of;
use super::{ChildRange, Counts, Fixed, Forest, NONE, Node, STAGE, Siblings};
use crate::element::clusters::{Branch, binary_tree};
use crate::element::exposed::exposed_m2;
use crate::element::groups::{Layout, Sort};
use crate::element::ids::{ElementId, Kind};
use crate::element::split::{Chart, Place, Shape};
use crate::element::tuning::{
    CUT_LEAST, CUT_SHARE, SMALL_CUT_PART, SMALL_CUT_SHARE, SMALL_CUT_TIMES, SPOT_LINES_MAX, WIDE,
};
use crate::geometry::{Aabb, Segment, cut_along, polygon_area, segment_within, split_convex};
use crate::scene::{BodyId, Discontinuities, Scene};

/// Input of planting: the scene, the lines that its patches are cut along, and the order of its bodies.
#[derive(Clone, Copy)]
struct Plot<'a> {
    scene: &'a Scene,
    cuts: &'a Cuts,
    layout: &'a Layout,
}

/// The children of the root.
struct Rows {
    /// Bodies that are there.
    near: Vec<u32>,
    /// Bodies that are far away.
    far: Vec<u32>,
    /// The node after those of the lights: of what is far away, if anything is.
    after_lights: u32,
    /// The node of the first inserted body.
    first_inserted: u32,
}

impl Forest {
    /// The fixed part of the forest of a scene, in which no cluster is an end of links.
    pub fn new(scene: &Scene) -> Forest {
        Forest::displaced(scene, &|_| false)
    }

    /// The fixed part where some bodies that no clip moves are not where the scene has them at rest.
    pub fn displaced(scene: &Scene, is_displaced: &dyn Fn(BodyId) -> bool) -> Forest {
        Forest::planted(scene, &Layout::default(), is_displaced)
    }

    /// The fixed part with clusters of small patches as ends of links, where there are many such patches; else that of
    /// [`Forest::displaced`].
    pub fn with_groups(scene: &Scene, is_displaced: &dyn Fn(BodyId) -> bool) -> Forest {
        let layout = Layout::of(scene, is_displaced);
        let mut forest = Forest::planted(scene, &layout, is_displaced);
        if layout.has_groups() {
            let groups = groups_of(scene, &forest, &layout);
            // Also what is no group now: it may become one when a body is put down.
            let clusters = (0..forest.fixed_len).map(ElementId);
            let clusters: Vec<ElementId> =
                clusters.filter(|&id| forest.kind(id) == Kind::Cluster).collect();
            for id in clusters {
                let siblings = &mut forest.siblings[id.0 as usize];
                (siblings.facet, siblings.path) = (id.0, 1);
            }
            forest.fixed_mut().groups = groups;
        }
        forest
    }

    fn planted(scene: &Scene, layout: &Layout, is_displaced: &dyn Fn(BodyId) -> bool) -> Forest {
        let solids = scene.solids();
        let mut forest = Forest {
            nodes: Vec::new(),
            siblings: Vec::new(),
            exposed: BTreeMap::new(),
            covered_now: BTreeMap::new(),
            // All that is planted here.
            fixed_len: u32::MAX,
            kept_len: u32::MAX,
            fixed: Arc::new(Fixed {
                patch_roots: vec![ElementId(NONE); scene.patches.len()],
                body_roots: vec![ElementId(NONE); scene.bodies.len()],
                covered: scene.covered(&solids, is_displaced),
                solids,
                ..Fixed::default()
            }),
            vacant: [Vec::new(), Vec::new()],
            loose: Vec::new(),
            changed: Vec::new(),
            counts: Counts::default(),
        };
        forest.push_fixed(Kind::Cluster, NONE, 1);
        let rows = forest.sow(scene);
        let cuts = Cuts::new(scene);
        let plot = Plot { scene, cuts: &cuts, layout };
        if !rows.near.is_empty() {
            forest.plant_bodies(plot, &rows.near, 1);
        }
        let mut beds = Vec::new();
        for (at, body) in (rows.first_inserted..).zip(scene.inserted_bodies()) {
            let first = forest.nodes.len() as u32;
            forest.plant_body(plot, body.0, at);
            let names = scene.names_of(body).expect("it was inserted").clone();
            beds.push(Bed { root: at, below: first..forest.nodes.len() as u32, names });
        }
        if !rows.far.is_empty() {
            let first = forest.nodes.len();
            forest.plant_bodies(plot, &rows.far, rows.after_lights);
            let mut distant = vec![false; forest.nodes.len()];
            distant[rows.after_lights as usize] = true;
            distant[first..].fill(true);
            forest.fixed_mut().distant = distant;
            forest.fixed_mut().wide = forest.wide_parts(scene, first);
        }
        if !beds.is_empty() {
            forest.fixed_mut().names = names_in(forest.nodes.len() as u32, &beds);
        }
        forest.finish_fixed(scene);
        forest
    }

    /// Makes the children of the root: what is there, the lights, what is far away, and each body that was inserted.
    fn sow(&mut self, scene: &Scene) -> Rows {
        let bodies = |distant: bool| -> Vec<u32> {
            let bodies = (0..).zip(&scene.bodies);
            let is_wanted = |(k, b): &(u32, &crate::scene::Body)| {
                !b.patches.is_empty() && b.distant == distant && !scene.is_inserted(BodyId(*k))
            };
            bodies.filter(is_wanted).map(|(k, _)| k).collect()
        };
        let (near, far) = (bodies(false), bodies(true));
        let first_light = 1 + u32::from(!near.is_empty());
        let after_lights = first_light + scene.lights.len() as u32;
        let made_children = after_lights + u32::from(!far.is_empty()) - 1;
        let children = made_children + scene.inserted_bodies().len() as u32;
        self.push_fixed(Kind::Light, 0, children);
        self.nodes[0].children = ChildRange::other(1);
        self.fixed_mut().made_children = made_children;
        self.fixed_mut().child_counts[0] =
            u16::try_from(children).expect("fewer than 65,536 lights and inserted bodies");
        for (light, id) in (first_light..after_lights).enumerate() {
            self.fixed_mut().subjects[id as usize] = light as u32;
            let siblings = &mut self.siblings[id as usize];
            (siblings.facet, siblings.path) = (id, 1);
        }
        Rows { near, far, after_lights, first_inserted: made_children + 1 }
    }

    /// Which nodes are wide parts of the sky; those from `first` on are distant.
    fn wide_parts(&self, scene: &Scene, first: usize) -> Vec<bool> {
        let is_wide = |id: usize| {
            let id = ElementId(id as u32);
            let wide_m2 = (WIDE * scene.outside_m).powi(2);
            self.kind(id) == Kind::Element && self.shape(id).area() > wide_m2
        };
        (0..self.nodes.len()).map(|id| id >= first && is_wide(id)).collect()
    }

    /// Works out what is known of the fixed part once all of it is there.
    fn finish_fixed(&mut self, scene: &Scene) {
        self.fixed_mut().facets.sort_unstable();
        let near_facets = self.facets().partition_point(|facet| !self.is_distant(*facet));
        self.fixed_mut().near_facets = near_facets;
        self.fixed_len = self.nodes.len() as u32;
        self.kept_len = self.fixed_len;
        self.sum_areas();
        self.fixed_mut().normals = self.boxes_of_normals(scene);
        self.fixed_mut().shines = !scene.lights.is_empty();
        self.set_glowing(scene.glowing(&|_| [0.0; 3]));
        self.fixed_mut().connected_m2 = scene.connected_areas_m2();
    }

    fn boxes_of_normals(&self, scene: &Scene) -> Vec<Aabb> {
        let mut boxes = vec![Aabb::EMPTY; self.nodes.len()];
        for id in (0..self.nodes.len()).rev() {
            let element = ElementId(id as u32);
            if let Some(patch) = self.patch(element) {
                boxes[id] = Aabb::of([scene.patches[patch.0 as usize].frame.normal]);
            }
            if let Some(parent) = self.parent(element) {
                boxes[parent.0 as usize] = boxes[parent.0 as usize].union(boxes[id]);
            }
        }
        boxes
    }

    fn push_fixed(&mut self, kind: Kind, parent: u32, count: u32) -> u32 {
        let first = self.nodes.len() as u32;
        let len = self.nodes.len() + count as usize;
        self.nodes.resize(len, Node { children: ChildRange::LEAF, ..Node::VACANT });
        self.siblings.resize(len, Siblings { parent, ..Siblings::VACANT });
        let fixed = self.fixed_mut();
        fixed.kinds.resize(len, kind);
        fixed.child_counts.resize(len, 0);
        fixed.subjects.resize(len, NONE);
        fixed.charts.resize(len, Chart::of(&Shape { corners: [DVec2::ZERO; 4], len: 4 }));
        first
    }

    fn plant_bodies(&mut self, plot: Plot<'_>, bodies: &[u32], at: u32) {
        let Plot { scene, layout, .. } = plot;
        let is_staged = |body: &&u32| layout.is_staged(**body);
        let staged: Vec<u32> = bodies.iter().filter(is_staged).copied().collect();
        let alone = bodies.iter().filter(|body| !is_staged(body));
        // What is planted as one comes first.
        let mut wholes: Vec<Vec<u32>> = alone.map(|&body| vec![body]).collect();
        if !staged.is_empty() {
            wholes.insert(0, staged);
        }
        let of_whole = |whole: &Vec<u32>| {
            let boxes = whole.iter().map(|&body| box_at_start(scene, BodyId(body)));
            boxes.fold(Aabb::EMPTY, Aabb::union)
        };
        let boxes: Vec<Aabb> = wholes.iter().map(of_whole).collect();
        let tree = binary_tree(&boxes);
        self.plant(&tree, 0, at, NONE, &mut |forest, leaf, id| {
            let whole = &wholes[leaf as usize];
            match layout.is_staged(whole[0]) {
                true => forest.plant_stage(plot, whole, id),
                false => forest.plant_body(plot, whole[0], id),
            }
        });
    }

    fn plant_body(&mut self, plot: Plot<'_>, body: u32, at: u32) {
        self.fixed_mut().body_roots[body as usize] = ElementId(at);
        let Plot { scene, layout, .. } = plot;
        let range = scene.bodies[body as usize].patches.clone();
        let is_pure = layout.pure_sort(range.clone()).is_some();
        let patches: Vec<u32> = range.collect();
        match layout.is_staged(body) {
            true if is_pure => return self.plant_patches(plot, &patches, body, at),
            is_staged if is_staged || layout.is_sorted(body) => {
                return self.plant_sorted(plot, body, at);
            }
            _ => {}
        }
        self.set(at, Kind::Cluster, body);
        let child = self.add_children(at, 1);
        self.plant_patches(plot, &patches, body, child);
    }

    /// The bodies that never move in the clip and have few small patches, each of them as a unit, whether a hand holds it or
    /// not. Those of small patches of one sort alone come apart from the others: clusters of them may be groups.
    fn plant_stage(&mut self, plot: Plot<'_>, bodies: &[u32], at: u32) {
        let Plot { scene, layout, .. } = plot;
        let sort = |body: u32| layout.pure_sort(scene.bodies[body as usize].patches.clone());
        let of_sort = |sought: Option<Sort>| {
            bodies.iter().copied().filter(|&body| sort(body) == sought).collect::<Vec<u32>>()
        };
        let parts = [None, Some(Sort::Shines), Some(Sort::Small)].map(of_sort);
        let parts: Vec<&Vec<u32>> = parts.iter().filter(|part| !part.is_empty()).collect();
        self.set(at, Kind::Cluster, STAGE);
        let first = self.add_children(at, parts.len() as u16);
        for (child, part) in (first..).zip(parts) {
            let boxes: Vec<Aabb> =
                part.iter().map(|&body| box_at_start(scene, BodyId(body))).collect();
            self.plant(&binary_tree(&boxes), 0, child, STAGE, &mut |forest, leaf, id| {
                forest.plant_body(plot, part[leaf as usize], id);
            });
        }
        // What is above a body that is not where it rests is in no one frame.
        for &body in bodies.iter().filter(|&&body| layout.is_displaced(body)) {
            let mut id = self.fixed.body_roots[body as usize].0;
            loop {
                id = self.siblings[id as usize].parent;
                if self.fixed.subjects[id as usize] != STAGE {
                    break;
                }
                self.fixed_mut().subjects[id as usize] = NONE;
            }
        }
    }

    /// One body, with a tree for each sort of its patches.
    fn plant_sorted(&mut self, plot: Plot<'_>, body: u32, at: u32) {
        let Plot { scene, layout, .. } = plot;
        let all = || scene.bodies[body as usize].patches.clone();
        let of_sort =
            |sort: Sort| all().filter(|&patch| layout.sort(patch) == sort).collect::<Vec<u32>>();
        let sorts = Sort::ALL.map(of_sort);
        let sorts: Vec<&Vec<u32>> = sorts.iter().filter(|patches| !patches.is_empty()).collect();
        self.set(at, Kind::Cluster, body);
        let first = self.add_children(at, sorts.len() as u16);
        for (child, patches) in (first..).zip(sorts) {
            self.plant_patches(plot, patches, body, child);
        }
    }

    fn plant_patches(&mut self, plot: Plot<'_>, patches: &[u32], subject: u32, at: u32) {
        let Plot { scene, cuts, .. } = plot;
        let of_patch = |&patch: &u32| Aabb::of(scene.patches[patch as usize].corners_in_body());
        let boxes: Vec<Aabb> = patches.iter().map(of_patch).collect();
        let tree = binary_tree(&boxes);
        self.plant(&tree, 0, at, subject, &mut |forest, leaf, id| {
            let patch = patches[leaf as usize];
            forest.fixed_mut().patch_roots[patch as usize] = ElementId(id);
            let corners = &scene.patches[patch as usize].corners;
            forest.plant_polygon(&cuts.of(patch), 0, corners, id);
        });
    }

    fn plant(
        &mut self,
        tree: &[Branch],
        node: u32,
        at: u32,
        subject: u32,
        leaf: &mut dyn FnMut(&mut Forest, u32, u32),
    ) {
        match tree[node as usize] {
            Branch::Leaf(k) => leaf(self, k, at),
            Branch::Inner(a, b) => {
                self.set(at, Kind::Cluster, subject);
                let child = self.add_children(at, 2);
                self.plant(tree, a, child, subject, leaf);
                self.plant(tree, b, child + 1, subject, leaf);
            }
        }
    }

    /// A polygon as a facet, or as a group of facets where lines cut it or it has too many corners; `cut` is how often it was cut
    /// before.
    fn plant_polygon(&mut self, cuts: &PatchCuts<'_>, cut: u32, corners: &[DVec2], at: u32) {
        let along_lines = cuts.apply(corners, cut);
        let cut = cut + u32::from(along_lines.is_some());
        let parts = along_lines.or_else(|| (corners.len() > 4).then(|| split_convex(corners)));
        let Some([one, two]) = parts else {
            return self.plant_facet(cuts, corners, at);
        };
        self.set(at, Kind::Polygon, cuts.patch);
        let child = self.add_children(at, 2);
        self.plant_polygon(cuts, cut, &one, child);
        self.plant_polygon(cuts, cut, &two, child + 1);
    }

    fn plant_facet(&mut self, cuts: &PatchCuts<'_>, corners: &[DVec2], at: u32) {
        self.set(at, Kind::Element, cuts.patch);
        let shape = Shape::new(corners);
        let chart = Chart::of(&shape);
        let Discontinuities { met, glows, spots } = cuts.lines;
        let seams = chart.seams(&[&met[..], glows, spots].concat());
        let fixed = self.fixed_mut();
        fixed.charts[at as usize] = chart;
        if !seams.is_empty() {
            fixed.seams.insert(at, seams);
        }
        fixed.facets.push(ElementId(at));
        self.nodes[at as usize].place = Place::whole(shape.len);
        let siblings = &mut self.siblings[at as usize];
        (siblings.facet, siblings.path) = (at, 1);
        self.counts.elements += 1;
        self.counts.leaves += 1;
    }

    fn set(&mut self, at: u32, kind: Kind, subject: u32) {
        let fixed = self.fixed_mut();
        fixed.kinds[at as usize] = kind;
        fixed.subjects[at as usize] = subject;
    }

    fn add_children(&mut self, at: u32, count: u16) -> u32 {
        let first = self.push_fixed(Kind::Cluster, at, u32::from(count));
        self.nodes[at as usize].children = ChildRange::other(first);
        self.fixed_mut().child_counts[at as usize] = count;
        first
    }

    fn sum_areas(&mut self) {
        let mut sums = vec![[0.0_f64; 2]; self.nodes.len()];
        for id in (0..self.nodes.len()).rev() {
            let id = ElementId(id as u32);
            if self.kind(id) == Kind::Element && !self.is_distant(id) {
                let shape = self.shape(id);
                sums[id.0 as usize] = [shape.area(), exposed_m2(&shape, self.covered(id))];
            }
            if let Some(parent) = self.parent(id) {
                let [area, exposed] = sums[id.0 as usize];
                sums[parent.0 as usize][0] += area;
                sums[parent.0 as usize][1] += exposed;
            }
        }
        let made = (1..=self.fixed.made_children).rev();
        self.fixed_mut().made_m2 = made.map(|id| sums[id as usize][0]).sum::<f64>() as f32;
        for (id, [area, exposed]) in (0..).zip(sums) {
            self.nodes[id as usize].area_m2 = area as f32;
            if (exposed as f32) < area as f32 {
                self.exposed.insert(id, exposed as f32);
            }
        }
    }
}

/// The lines that patches are cut along before anything else, so that no element lies on both sides of a wall's foot, or of the outline
/// of a lamp close before it.
struct Cuts {
    of: Vec<Discontinuities>,
    /// Smaller polygons are cut where lines run from edge to edge only, m2.
    least_m2: f64,
}

/// Lines that one patch is cut along.
struct PatchCuts<'a> {
    patch: u32,
    lines: &'a Discontinuities,
    least_m2: f64,
    slack_m: f64,
}

impl Cuts {
    fn new(scene: &Scene) -> Cuts {
        Cuts { of: scene.discontinuities(), least_m2: CUT_LEAST * scene.made_area_m2() }
    }

    fn of(&self, patch: u32) -> PatchCuts<'_> {
        let lines = &self.of[patch as usize];
        let ends = lines.met.iter().chain(&lines.spots).flatten();
        let reach = ends.fold(0.0_f64, |reach, p| reach.max(p.abs().max_element()));
        PatchCuts { patch, lines, least_m2: self.least_m2, slack_m: 1e-6 * reach }
    }
}

impl PatchCuts<'_> {
    /// Both parts of a polygon that is to be cut, after so many cuts before.
    fn apply(&self, corners: &[DVec2], cut: u32) -> Option<[Vec<DVec2>; 2]> {
        self.at_contact(corners, cut).or_else(|| self.around_spots(corners))
    }

    fn at_contact(&self, corners: &[DVec2], cut: u32) -> Option<[Vec<DVec2>; 2]> {
        let area = polygon_area(corners);
        if area >= self.least_m2 {
            return cut_along(corners, &self.lines.met, CUT_SHARE, self.slack_m);
        }
        if cut >= SMALL_CUT_TIMES {
            return None;
        }
        let is_part = |part: &Vec<DVec2>| polygon_area(part) >= SMALL_CUT_PART * area;
        cut_along(corners, &self.lines.met, SMALL_CUT_SHARE, self.slack_m)
            .filter(|parts| parts.iter().all(is_part))
    }

    /// Along the outlines of lamps where elements cannot be divided along these.
    fn around_spots(&self, corners: &[DVec2]) -> Option<[Vec<DVec2>; 2]> {
        let within = |&line: &Segment| segment_within(corners, line, self.slack_m);
        let spots: Vec<Segment> = self.lines.spots.iter().filter_map(within).collect();
        let is_seam = |line: &Segment, chart: &Chart| !chart.seams(&[*line]).is_empty();
        let divides = |chart: &Chart| spots.iter().all(|line| is_seam(line, chart));
        let are_seams = corners.len() <= 4 && divides(&Chart::of(&Shape::new(corners)));
        if spots.len() > SPOT_LINES_MAX || are_seams {
            return None;
        }
        cut_along(corners, &spots, 0.0, self.slack_m)
    }
}

/// Where an inserted body was planted.
struct Bed {
    root: u32,
    /// All nodes below its root.
    below: Range<u32>,
    names: Range<u32>,
}

/// Names of so many nodes of the fixed part: of what the scene was made with the ids that they would have without the
/// inserted bodies, which have their own.
fn names_in(len: u32, beds: &[Bed]) -> Vec<u32> {
    let mut out = vec![NONE; len as usize];
    for Bed { root, below, names } in beds {
        assert!(below.len() < names.len(), "an inserted body has more parts than names");
        out[*root as usize] = names.start;
        below.clone().zip(names.start + 1..).for_each(|(id, name)| out[id as usize] = name);
    }
    let made = out.iter_mut().filter(|name| **name == NONE);
    (0..).zip(made).for_each(|(id, name)| *name = id);
    out
}

/// Box of a body where it is at time 0, or in its own frame if it is absent then.
fn box_at_start(scene: &Scene, body: BodyId) -> Aabb {
    let pose = scene.pose(body, 0.0).unwrap_or(crate::geometry::Pose::IDENTITY);
    let corners = scene.patches_of(body).flat_map(|(_, p)| p.corners_in_body());
    Aabb::of(corners.map(|c: DVec3| pose.point(c)))
}
