//! What is wrong with the shape: gaps, normals that face the wrong way, polygons that coincide.
//!
//! Must not know materials beyond whether they are double-sided, nor how sides are matched.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::{listed, note};
use crate::scene::topology::{Side, Topology};
use crate::scene::{Note, Scene, Severity};

/// Adds what is wrong with the shape at time 0.
pub(super) fn shape(scene: &Scene, notes: &mut Vec<Note>) {
    let topology = Topology::of(scene, 0.0);
    let parts = parts(&topology);
    open(scene, &topology, &parts, notes);
    turned(scene, &topology, notes);
    against_all(scene, &topology, notes);
    inside_out(scene, &topology, &parts, notes);
    overlaps(scene, &topology, notes);
    duplicates(scene, &topology, notes);
    bent(scene, &topology, notes);
}

/// Angles between neighbouring triangles, radians, that suggest a polygon that was meant to be flat.
const BENT: (f64, f64) = (1e-5, 0.02);

/// Triangles of one surface that meet at a very small angle: likely a polygon that is not planar,
/// cut in two by the export. Merging leaves them apart, so the scene has more patches than meant.
fn bent(scene: &Scene, topology: &Topology, notes: &mut Vec<Note>) {
    let mut counts: BTreeMap<&str, (usize, f64)> = BTreeMap::new();
    for group in &topology.sides {
        let [one, two] = group[..] else { continue };
        let patch = |side: &crate::scene::topology::Side| {
            &scene.patches[topology.polygons[side.polygon as usize].patch.0 as usize]
        };
        let (a, b) = (patch(&one), patch(&two));
        if a.surface != b.surface || a.corners.len() != 3 || b.corners.len() != 3 {
            continue;
        }
        let angle = libm::asin(a.frame.normal.cross(b.frame.normal).length().min(1.0));
        let alike = a.frame.normal.dot(b.frame.normal) > 0.0;
        if alike && angle > BENT.0 && angle < BENT.1 {
            let entry = counts.entry(object(scene, topology, one.polygon)).or_default();
            *entry = (entry.0 + 1, entry.1.max(angle));
        }
    }
    for (name, (count, angle)) in counts {
        let message = format!(
            "triangles meet at angles of up to {angle:.1e} radians, as the halves of polygons that are not \
             planar do; each half is a patch of its own: make the polygons flat to have fewer"
        );
        notes.push(note(Severity::Info, "non-planar", name, count, message));
    }
}

/// What hangs together along sides.
struct Part {
    bounds: (DVec3, DVec3),
    free_sides: usize,
    /// Sides on which two neighbours face opposite ways, or more than two polygons meet.
    odd_sides: usize,
    flat: bool,
    two_sided: bool,
    /// Signed volume, m3: negative if the fronts are inside. Meaningful where closed.
    volume: f64,
}

impl Part {
    fn closed(&self) -> bool {
        self.free_sides == 0
    }

    fn diagonal(&self) -> f64 {
        self.bounds.0.distance(self.bounds.1)
    }

    /// Whether the bounds of another part, or its own, lie within its bounds.
    fn spans(&self, other: &Part) -> bool {
        other.bounds.0.cmpge(self.bounds.0).all() && other.bounds.1.cmple(self.bounds.1).all()
    }

    fn contains(&self, p: DVec3) -> bool {
        p.cmpgt(self.bounds.0).all() && p.cmplt(self.bounds.1).all()
    }
}

fn parts(topology: &Topology) -> Vec<Part> {
    let count = topology.component.iter().max().map_or(0, |&c| c + 1);
    let mut parts: Vec<Part> = vec![];
    let mut normals: Vec<Option<DVec3>> = vec![None; count as usize];
    parts.resize_with(count as usize, || Part {
        bounds: (DVec3::INFINITY, DVec3::NEG_INFINITY),
        free_sides: 0,
        odd_sides: 0,
        flat: true,
        two_sided: false,
        volume: 0.0,
    });
    for (polygon, &c) in topology.polygons.iter().zip(&topology.component) {
        let part = &mut parts[c as usize];
        let points: Vec<DVec3> =
            polygon.corners.iter().map(|&v| topology.points[v as usize]).collect();
        for &p in &points {
            part.bounds = (part.bounds.0.min(p), part.bounds.1.max(p));
        }
        let origin = points[0];
        for i in 1..points.len().saturating_sub(1) {
            part.volume += origin.dot(points[i].cross(points[i + 1])) / 6.0;
        }
        let area = (1..points.len().saturating_sub(1))
            .map(|i| (points[i] - origin).cross(points[i + 1] - origin));
        let normal = area.sum::<DVec3>().normalize_or_zero();
        let first = *normals[c as usize].get_or_insert(normal);
        part.flat &= first.cross(normal).length() < 1e-4;
        part.two_sided |= polygon.two_sided;
    }
    for group in &topology.sides {
        let part = &mut parts[topology.component[group[0].polygon as usize] as usize];
        part.free_sides += usize::from(group.len() == 1);
        part.odd_sides +=
            usize::from(group.len() > 2 || (group.len() == 2 && group[0].start == group[1].start));
    }
    parts
}

/// Whether a part encloses what it holds although it has free sides: whether what is left without the double-sided polygons
/// that hang on it by some of their sides (partitions, shelves, leaves of doors) is closed, and as large.
fn closed_but_for_sheets(topology: &Topology, parts: &[Part], part: usize) -> bool {
    let is_of_part = |side: &Side| topology.component[side.polygon as usize] as usize == part;
    let groups: Vec<&Vec<Side>> = topology.sides.iter().filter(|g| is_of_part(&g[0])).collect();
    let mut hangs = vec![false; topology.polygons.len()];
    let mut before = usize::MAX;
    let mut count = 0;
    while before != count {
        before = count;
        for group in &groups {
            let mut left = group.iter().filter(|s| !hangs[s.polygon as usize]);
            if let (Some(side), None) = (left.next(), left.next()) {
                if !topology.polygons[side.polygon as usize].two_sided {
                    return false;
                }
                hangs[side.polygon as usize] = true;
                count += 1;
            }
        }
    }
    let left = topology.polygons.iter().enumerate();
    let left = left.filter(|(k, _)| topology.component[*k] as usize == part && !hangs[*k]);
    let points = left.flat_map(|(_, polygon)| &polygon.corners);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &corner in points {
        let at = topology.points[corner as usize];
        (low, high) = (low.min(at), high.max(at));
    }
    let whole = parts[part].bounds;
    low.cmple(whole.0).all() && high.cmpge(whole.1).all()
}

/// Free sides, for each object: of the largest part as a warning, of others for information. Flat
/// sheets (a lamp, a leaf) are meant to have free sides, and so are sheets that hang on what is closed without them.
fn open(scene: &Scene, topology: &Topology, parts: &[Part], notes: &mut Vec<Note>) {
    let largest = (0..parts.len())
        .max_by(|&a, &b| parts[a].diagonal().total_cmp(&parts[b].diagonal()).then(b.cmp(&a)));
    let closed = largest.filter(|&k| closed_but_for_sheets(topology, parts, k));
    let mut free: BTreeMap<(&str, bool), (usize, f64)> = BTreeMap::new();
    for side in topology.sides.iter().filter(|g| g.len() == 1).map(|g| g[0]) {
        let part = topology.component[side.polygon as usize] as usize;
        if !parts[part].flat && Some(part) != closed {
            let entry = free
                .entry((object(scene, topology, side.polygon), Some(part) == largest))
                .or_default();
            entry.0 += 1;
            entry.1 +=
                topology.points[side.start as usize].distance(topology.points[side.end as usize]);
        }
    }
    let gaps = free.keys().any(|&(_, enclosure)| enclosure);
    for ((object, enclosure), (count, length)) in free {
        let (severity, code, what) = match enclosure {
            true => (
                Severity::Warning,
                "open-enclosure",
                "light escapes there into black surroundings; close the gap unless it is meant",
            ),
            false => (
                Severity::Info,
                "open-object",
                "the object is not closed; close it if its back faces (black, blocking light) can be seen",
            ),
        };
        let message = format!(
            "{count} free sides, {length:.4} m in all, where no other polygon joins: {what}"
        );
        notes.push(note(severity, code, object, count, message));
    }
    let around_all = |p: &Part| parts.iter().all(|q| p.spans(q));
    let encloses = |(k, p): (usize, &Part)| {
        let is_closed = p.closed() && (parts.len() > 1 || p.volume < 0.0);
        (is_closed || (Some(k) == closed && !p.closed())) && around_all(p)
    };
    if !gaps && !parts.iter().enumerate().any(encloses) {
        let message = "nothing encloses the scene: light that leaves it is lost in black surroundings; \
                       put it in a closed room if that is not meant";
        notes.push(note(Severity::Info, "open-enclosure", &scene.name, 1, message.to_owned()));
    }
}

/// Neighbours of one object that face opposite ways.
fn turned(scene: &Scene, topology: &Topology, notes: &mut Vec<Note>) {
    let mut turned: BTreeMap<&str, usize> = BTreeMap::new();
    for group in &topology.sides {
        let [a, b] = group[..] else { continue };
        let two_sided = [a, b].iter().any(|s| topology.polygons[s.polygon as usize].two_sided);
        let (of_a, of_b) = (object(scene, topology, a.polygon), object(scene, topology, b.polygon));
        if a.start == b.start && !two_sided && of_a == of_b {
            *turned.entry(of_a).or_default() += 1;
        }
    }
    for (object, count) in turned {
        let message = format!(
            "at {count} sides two neighbouring polygons face opposite ways; some normals are flipped: \
             recalculate them (in Blender: Mesh > Normals > Recalculate Outside) or make the material double-sided"
        );
        notes.push(note(Severity::Warning, "flipped-normals", object, count, message));
    }
}

/// What one object has to do with its neighbours along sides.
#[derive(Default)]
struct Neighbours<'a> {
    free: usize,
    shared: usize,
    odd: usize,
    of: BTreeSet<&'a str>,
    area_m2: f64,
    polygons: usize,
}

/// Objects that face the other way from every object around them: a wall of a room of separate
/// objects that faces outwards. Of two that face against each other the smaller.
fn against_all(scene: &Scene, topology: &Topology, notes: &mut Vec<Note>) {
    let mut objects: BTreeMap<&str, Neighbours<'_>> = BTreeMap::new();
    for (number, polygon) in topology.polygons.iter().enumerate() {
        let entry = objects.entry(object(scene, topology, number as u32)).or_default();
        entry.area_m2 += scene.patches[polygon.patch.0 as usize].area_m2();
        entry.polygons += 1;
    }
    for group in &topology.sides {
        let names: BTreeSet<&str> =
            group.iter().map(|side| object(scene, topology, side.polygon)).collect();
        let two_sided = group.iter().any(|s| topology.polygons[s.polygon as usize].two_sided);
        let odd = group.len() == 2 && group[0].start == group[1].start && !two_sided;
        for &name in &names {
            let entry = objects.entry(name).or_default();
            entry.free += usize::from(group.len() == 1);
            if names.len() > 1 {
                entry.shared += 1;
                entry.odd += usize::from(odd);
                entry.of.extend(names.iter().filter(|&&other| other != name));
            }
        }
    }
    let mut against: Vec<(&str, &Neighbours<'_>)> = objects
        .iter()
        .filter(|(_, n)| n.free == 0 && n.shared >= 3 && n.odd == n.shared)
        .map(|(&name, n)| (name, n))
        .collect();
    against.sort_by(|a, b| a.1.area_m2.total_cmp(&b.1.area_m2));
    let mut said: BTreeSet<&str> = BTreeSet::new();
    for (name, neighbours) in against {
        if !neighbours.of.is_disjoint(&said) {
            continue;
        }
        said.insert(name);
        let message = format!(
            "it faces away from where all that joins it faces ({}), so it is black on their side; flip its \
             normals (in Blender: Mesh > Normals > Flip) or make the material double-sided",
            listed(&neighbours.of)
        );
        notes.push(note(Severity::Warning, "flipped-normals", name, neighbours.polygons, message));
    }
}

/// Share of the scene's diagonal within which polygons are in one plane, and by which they overlap at
/// least.
const ONE_PLANE: f64 = 1e-6;

/// Polygons that face the same way in one plane and overlap, but for those with the same corners.
fn overlaps(scene: &Scene, topology: &Topology, notes: &mut Vec<Note>) {
    let Some(bounds) = scene.bounds(0.0) else { return };
    let tolerance = ONE_PLANE * bounds.diagonal();
    let mut planes: BTreeMap<[i64; 4], Vec<usize>> = BTreeMap::new();
    let mut normals = Vec::new();
    for (number, polygon) in topology.polygons.iter().enumerate() {
        let p = &scene.patches[polygon.patch.0 as usize];
        let normal = scene.pose(p.body, 0.0).map_or(DVec3::ZERO, |b| b.direction(p.frame.normal));
        normals.push(normal);
        let Some(&corner) = polygon.corners.first() else { continue };
        let offset =
            (topology.points[corner as usize] - bounds.lo).dot(normal) / (10.0 * tolerance);
        let [x, y, z] = (normal * 1e4).to_array().map(|c| c.round() as i64);
        planes.entry([x, y, z, offset.round() as i64]).or_default().push(number);
    }
    let mut found: BTreeMap<&str, (usize, BTreeSet<&str>)> = BTreeMap::new();
    for members in planes.values().filter(|m| m.len() > 1) {
        let normal = normals[members[0]];
        let u = normal.any_orthonormal_vector();
        let v = normal.cross(u);
        let flat = |number: &usize| -> Vec<DVec2> {
            let corners = topology.polygons[*number].corners.iter();
            let points = corners.map(|&c| topology.points[c as usize]);
            points.map(|p| DVec2::new(p.dot(u), p.dot(v))).collect()
        };
        let lowest = |polygon: &[DVec2]| polygon.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
        let mut flats: Vec<(usize, Vec<DVec2>)> = members.iter().map(|n| (*n, flat(n))).collect();
        flats.sort_by(|a, b| lowest(&a.1).total_cmp(&lowest(&b.1)));
        for (k, (one, a)) in flats.iter().enumerate() {
            let end = a.iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max) - tolerance;
            for (two, b) in flats[k + 1..].iter().take_while(|(_, b)| lowest(b) < end) {
                let corners = |n: usize| {
                    topology.polygons[n].corners.iter().copied().collect::<BTreeSet<u32>>()
                };
                if !parted(a, b, tolerance)
                    && !parted(b, a, tolerance)
                    && corners(*one) != corners(*two)
                {
                    let (one, two) = (one.max(two), one.min(two));
                    let entry = found.entry(object(scene, topology, *one as u32)).or_default();
                    entry.0 += 1;
                    entry.1.insert(object(scene, topology, *two as u32));
                }
            }
        }
    }
    for (name, (count, with)) in found {
        let message = format!(
            "{count} polygons overlap polygons of {} in one plane and face the same way (they are coplanar): the \
             smaller is taken to lie on the larger, where a lamp counts as a fifth of its area, of equal ones the first; raise by a \
             millimetre what is to be on top, or cut the other out beneath it",
            listed(&with)
        );
        notes.push(note(Severity::Warning, "overlap", name, count, message));
    }
}

/// Whether a side of the convex polygon `a` parts it from `b`, up to a tolerance.
fn parted(a: &[DVec2], b: &[DVec2], tolerance: f64) -> bool {
    (0..a.len()).any(|k| {
        let (from, to) = (a[k], a[(k + 1) % a.len()]);
        let outwards = -(to - from).perp().normalize_or_zero();
        b.iter().all(|p| (*p - from).dot(outwards) > -tolerance)
    })
}

/// Closed, evenly turned parts that face the wrong way: inward around nothing, or outward around
/// everything else.
fn inside_out(scene: &Scene, topology: &Topology, parts: &[Part], notes: &mut Vec<Note>) {
    let hangs = scene.lights.iter().map(|l| l.node).chain(scene.cameras.iter().map(|c| c.node));
    let stands: Vec<DVec3> =
        hangs.filter_map(|n| scene.motion.pose(n, 0.0)).map(|pose| pose.translation).collect();
    for (number, part) in parts.iter().enumerate() {
        if !part.closed() || part.odd_sides > 0 || part.two_sided {
            continue;
        }
        let others = || parts.iter().enumerate().filter(|(n, _)| *n != number).map(|(_, p)| p);
        let holds = |p: &Part| part.contains(p.bounds.0) && part.contains(p.bounds.1);
        // A lamp flush in a wall is inside too.
        let is_in = |p: &Part| part.spans(p) || part.contains((p.bounds.0 + p.bounds.1) / 2.0);
        let empty = !others().any(is_in) && !stands.iter().any(|&p| part.contains(p));
        let all_in = parts.len() > 1 && others().all(holds);
        let is_in_a_room = || others().any(|room| room.volume < 0.0 && room.spans(part));
        let what = match part.volume < 0.0 {
            true if empty && emits_nothing(scene, topology, number) => {
                "it is closed and faces inward, but nothing is inside"
            }
            true if empty && is_in_a_room() => {
                "it is closed and shines inward, into nothing but itself"
            }
            false if all_in => {
                "it encloses all the rest but faces outward, so from inside it is black"
            }
            _ => continue,
        };
        let members =
            (0..topology.polygons.len()).filter(|&p| topology.component[p] as usize == number);
        let names: BTreeSet<&str> =
            members.clone().map(|p| object(scene, topology, p as u32)).collect();
        let message = format!("{what}; flip its normals (in Blender: Mesh > Normals > Flip)");
        notes.push(note(
            Severity::Warning,
            "flipped-normals",
            &listed(&names),
            members.count(),
            message,
        ));
    }
}

/// Whether no polygon of a part emits: an empty room whose walls glow is a furnace, not a mistake.
fn emits_nothing(scene: &Scene, topology: &Topology, part: usize) -> bool {
    let mut members =
        topology.polygons.iter().zip(&topology.component).filter(|(_, c)| **c as usize == part);
    members.all(|(p, _)| !scene.patch_emits(&scene.patches[p.patch.0 as usize]))
}

/// Polygons with the same corners that do not lie back to back.
fn duplicates(scene: &Scene, topology: &Topology, notes: &mut Vec<Note>) {
    let mut seen: BTreeMap<Vec<u32>, Vec<usize>> = BTreeMap::new();
    for (number, polygon) in topology.polygons.iter().enumerate() {
        let mut key = polygon.corners.clone();
        key.sort_unstable();
        seen.entry(key).or_default().push(number);
    }
    let mut doubled: BTreeMap<&str, (usize, BTreeSet<&str>)> = BTreeMap::new();
    let mut touching: BTreeMap<&str, (usize, BTreeSet<&str>)> = BTreeMap::new();
    for same in seen.values().filter(|s| s.len() > 1) {
        for (k, &later) in same.iter().enumerate().skip(1) {
            let earlier = same[..k].iter().find(|&&e| coincide(topology, e, later));
            if let Some(&earlier) = earlier {
                let entry = doubled.entry(object(scene, topology, later as u32)).or_default();
                entry.0 += 1;
                entry.1.insert(object(scene, topology, earlier as u32));
            } else if let Some(&earlier) = same[..k].iter().find(|&&e| touch(topology, e, later)) {
                let entry = touching.entry(object(scene, topology, later as u32)).or_default();
                entry.0 += 1;
                entry.1.insert(object(scene, topology, earlier as u32));
            }
        }
    }
    for (object, (count, with)) in touching {
        let message = format!(
            "{count} double-sided polygons touch polygons of {} back to back, as blocks do that stand on each \
             other; no light gets between them, so both may be deleted to have fewer",
            listed(&with)
        );
        notes.push(note(Severity::Info, "touching", object, count, message));
    }
    for (object, (count, with)) in doubled {
        let message = format!(
            "{count} polygons coincide with polygons of {} and face the same way: a lamp shows, or else the first of each, the \
             others count as covered, so that no light is exchanged twice; delete one of each",
            listed(&with)
        );
        notes.push(note(Severity::Warning, "duplicate", object, count, message));
    }
}

/// Whether the fronts of two polygons of the same corners face the same way.
fn coincide(topology: &Topology, a: usize, b: usize) -> bool {
    let (a, b) = (&topology.polygons[a], &topology.polygons[b]);
    let after = |c: &[u32]| {
        let at = c.iter().position(|&v| v == a.corners[0]).unwrap_or(0);
        c[(at + 1) % c.len()]
    };
    after(&a.corners) == after(&b.corners)
}

/// Whether two polygons of the same corners show opposite sides, and both sides are to be seen.
fn touch(topology: &Topology, a: usize, b: usize) -> bool {
    let two_sided = |n: usize| topology.polygons[n].two_sided;
    !coincide(topology, a, b) && (two_sided(a) || two_sided(b))
}

fn object<'a>(scene: &'a Scene, topology: &Topology, polygon: u32) -> &'a str {
    let patch = topology.polygons[polygon as usize].patch;
    &scene.surfaces[scene.patches[patch.0 as usize].surface.0 as usize].object
}
