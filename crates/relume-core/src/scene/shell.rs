//! Closed surfaces, of polygons seen from one side or from both, and what is inside them.
//!
//! Pure geometry in a body's own frame. Must not know motion, materials or light.

use std::collections::BTreeMap;

use glam::DVec3;

use super::inside::solid_angle;
use super::topology::{Polygon, Side, components, grouped, matched, sides_of};
use super::weld::Weld;
use super::{BodyId, Patch, PatchId, Scene};
use crate::geometry::{Aabb, Plane};
use crate::scene::tuning::{SHELL_LOOKS_MAX, SHELL_PIECES_MAX};

/// Volume over area of a shell at least, in weld tolerances: two polygons back to back close nothing in.
const THICK: f64 = 16.0;

/// Winding numbers above which a point is in or on a shell, and in it.
const TOUCHES: f64 = 0.25;
const INSIDE: f64 = 0.75;

/// What may still be spent on questions about shells: a count, so that the answers are the same everywhere.
pub(super) struct Effort(usize);

impl Effort {
    pub(super) fn new() -> Effort {
        Effort(SHELL_LOOKS_MAX)
    }

    /// Whether as much is left, which is then spent.
    fn takes(&mut self, looks: usize) -> bool {
        let left = self.0.checked_sub(looks);
        self.0 = left.unwrap_or(0);
        left.is_some()
    }
}

/// A closed surface of one body that does not cross itself.
pub(super) struct Shell {
    pub(super) faces: Vec<Face>,
    pub(super) bounds: Aabb,
    /// Metres.
    pub(super) tolerance: f64,
    corners: usize,
}

/// A polygon of a [`Shell`].
pub(super) struct Face {
    /// Of two twins the first.
    pub(super) patch: PatchId,
    /// Whether the patch looks out of the shell; otherwise it looks in.
    pub(super) outwards: bool,
    is_two_sided: bool,
    /// Counter-clockwise seen from outside.
    pub(super) corners: Vec<DVec3>,
    /// Outwards.
    plane: Plane,
    bounds: Aabb,
}

/// How a polygon lies to a shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Lies {
    Outside,
    /// A part of it lies on the shell, none inside.
    On,
    /// A part of it is inside, or whether one is was not settled.
    Inside,
}

impl Scene {
    /// The closed surfaces of a body. A double-sided polygon is one face, whichever way it is wound; a
    /// single-sided one has to look outwards.
    pub(super) fn shells(&self, body: BodyId, effort: &mut Effort) -> Vec<Shell> {
        let firsts = || self.patches_of(body).filter(|(id, p)| p.twin.is_none_or(|t| t > *id));
        let mut weld = Weld::of_corners(firsts().flat_map(|(_, p)| p.corners_in_body()));
        let polygon = |(patch, p): (PatchId, &super::Patch)| {
            let mut corners: Vec<u32> = p.corners_in_body().map(|c| weld.vertex(c)).collect();
            corners.dedup();
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            Polygon { patch, two_sided: p.twin.is_some(), corners }
        };
        // What is thinner than the tolerance has no sides to meet others along.
        let polygons: Vec<Polygon> =
            firsts().map(polygon).filter(|p| p.corners.len() > 2).collect();
        let groups = closed(&weld, &polygons);
        let shell = |group: Vec<Member>| self.shell(&weld, &polygons, group, effort);
        groups.into_iter().filter_map(shell).collect()
    }

    fn shell(
        &self,
        weld: &Weld,
        polygons: &[Polygon],
        group: Vec<Member>,
        effort: &mut Effort,
    ) -> Option<Shell> {
        let face = |member: &Member| {
            let patch = polygons[member.polygon as usize].patch;
            let p = &self.patches[patch.0 as usize];
            let mut corners: Vec<DVec3> =
                member.corners.iter().map(|&c| weld.points[c as usize]).collect();
            let mut normal = p.frame.normal;
            if member.turned {
                corners.reverse();
                normal = -normal;
            }
            let plane = Plane::through(p.frame.origin, normal);
            let bounds = Aabb::of(corners.iter().copied());
            let (outwards, is_two_sided) = (!member.turned, p.twin.is_some());
            Face { patch, outwards, is_two_sided, corners, plane, bounds }
        };
        let mut faces: Vec<Face> = group.iter().map(face).collect();
        let origin = faces[0].corners[0];
        let area: f64 = faces.iter().map(Face::area).sum();
        let volume = faces.iter().map(|f| f.plane.distance(origin) * f.area()).sum::<f64>() / -3.0;
        if volume.abs() <= THICK * weld.tolerance * area {
            return None;
        }
        if volume < 0.0 {
            faces.iter_mut().for_each(Face::turn);
        }
        let bounds = faces.iter().fold(Aabb::EMPTY, |b, f| b.union(f.bounds));
        let corners = faces.iter().map(|f| f.corners.len()).sum();
        let shell = Shell { faces, bounds, tolerance: weld.tolerance, corners };
        let looks_out = shell.faces.iter().all(|f| f.outwards || f.is_two_sided);
        (looks_out && !shell.crosses_itself(effort)).then_some(shell)
    }
}

/// A polygon of a closed group.
pub(super) struct Member {
    pub(super) polygon: u32,
    /// Whether it is wound the other way than the first of the group.
    pub(super) turned: bool,
    /// Welded, in the order of the polygon, with those of others that lie on its sides.
    pub(super) corners: Vec<u32>,
}

/// Groups of polygons that hang together along sides, each of which is one of exactly two, and that can
/// all be turned to look the same way: out or in. Whole sides are tried first; what they close nothing with
/// is cut where corners of others lie on it.
pub(super) fn closed(weld: &Weld, polygons: &[Polygon]) -> Vec<Vec<Member>> {
    let whole = sides_of(polygons);
    let mut out = Vec::new();
    let mut used = closed_by(polygons.len(), &grouped(whole.clone()), &mut out);
    let rest: Vec<Side> = whole.into_iter().filter(|s| !used[s.polygon as usize]).collect();
    let cut = matched(&weld.points, weld.tolerance, rest);
    used.iter_mut().for_each(|u| *u = false);
    closed_by(polygons.len(), &cut, &mut out);
    out
}

/// Adds the groups that some sides close; which polygons are in one.
fn closed_by(polygons: usize, sides: &[Vec<Side>], out: &mut Vec<Vec<Member>>) -> Vec<bool> {
    let component = components(polygons, sides);
    let mut is_closed = vec![true; polygons];
    let mut neighbours: Vec<Vec<(u32, bool)>> = vec![Vec::new(); polygons];
    for group in sides {
        match group[..] {
            [a, b] if a.polygon != b.polygon => {
                let turned = a.start == b.start;
                neighbours[a.polygon as usize].push((b.polygon, turned));
                neighbours[b.polygon as usize].push((a.polygon, turned));
            }
            _ => {
                group.iter().for_each(|s| is_closed[component[s.polygon as usize] as usize] = false)
            }
        }
    }
    let mut loops = loops(polygons, sides);
    let mut turned: Vec<Option<bool>> = vec![None; polygons];
    let mut used = vec![false; polygons];
    for first in 0..polygons {
        if turned[first].is_some() || neighbours[first].is_empty() {
            continue;
        }
        turned[first] = Some(false);
        let (mut group, mut is_two_sided) = (vec![first as u32], true);
        let mut looked_at = 0;
        while looked_at < group.len() {
            let at = group[looked_at] as usize;
            for &(other, against) in &neighbours[at] {
                let wanted = turned[at].is_some_and(|t| t != against);
                match turned[other as usize] {
                    Some(found) => is_two_sided &= found == wanted,
                    None => {
                        turned[other as usize] = Some(wanted);
                        group.push(other);
                    }
                }
            }
            looked_at += 1;
        }
        if is_two_sided && is_closed[component[first] as usize] {
            group.sort_unstable();
            group.iter().for_each(|&p| used[p as usize] = true);
            let member = |&polygon: &u32| {
                let turned = turned[polygon as usize] == Some(true);
                Member { polygon, turned, corners: std::mem::take(&mut loops[polygon as usize]) }
            };
            out.push(group.iter().map(member).collect());
        }
    }
    used
}

/// The corners of each polygon in order, as its sides have them.
fn loops(polygons: usize, sides: &[Vec<Side>]) -> Vec<Vec<u32>> {
    let mut next: Vec<BTreeMap<u32, u32>> = vec![BTreeMap::new(); polygons];
    for side in sides.iter().flatten() {
        next[side.polygon as usize].insert(side.start, side.end);
    }
    let in_order = |next: BTreeMap<u32, u32>| {
        let Some((&first, _)) = next.first_key_value() else { return Vec::new() };
        let following = |c: &u32| next.get(c).copied().filter(|&c| c != first);
        std::iter::successors(Some(first), following).take(next.len()).collect()
    };
    next.into_iter().map(in_order).collect()
}

impl Face {
    fn area(&self) -> f64 {
        let at = |k: usize| self.corners[k] - self.corners[0];
        let twice: DVec3 = (1..self.corners.len() - 1).map(|k| at(k).cross(at(k + 1))).sum();
        0.5 * twice.length()
    }

    fn turn(&mut self) {
        self.outwards = !self.outwards;
        self.corners.reverse();
        self.plane = Plane { normal: -self.plane.normal, offset: -self.plane.offset };
    }

    /// Whether a line from `p` to `q` that passes through the plane does so in or close to the polygon.
    fn is_passed(&self, p: DVec3, q: DVec3, tolerance: f64) -> bool {
        let (before, after) = (self.plane.distance(p), self.plane.distance(q));
        if before.min(after) >= -tolerance || before.max(after) <= tolerance {
            return false;
        }
        let at = p + (q - p) * (before / (before - after));
        sides(&self.corners).all(|(a, b)| {
            let inwards = self.plane.normal.cross(b - a);
            (at - a).dot(inwards) >= -tolerance * inwards.length()
        })
    }
}

fn sides(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]))
}

fn meet(a: &Aabb, b: &Aabb, tolerance: f64) -> bool {
    a.lo.cmple(b.hi + tolerance).all() && b.lo.cmple(a.hi + tolerance).all()
}

impl Shell {
    /// Whether a face passes through another. What cannot be settled counts as that.
    fn crosses_itself(&self, effort: &mut Effort) -> bool {
        let spread = self.bounds.extent();
        let axis = (0..3).fold(0, |best, k| if spread[k] > spread[best] { k } else { best });
        let mut order: Vec<&Face> = self.faces.iter().collect();
        order.sort_by(|a, b| {
            a.bounds.lo[axis].total_cmp(&b.bounds.lo[axis]).then(a.patch.cmp(&b.patch))
        });
        for (k, a) in order.iter().enumerate() {
            let near = order[k + 1..]
                .iter()
                .take_while(|b| b.bounds.lo[axis] <= a.bounds.hi[axis] + self.tolerance);
            for b in near {
                if !effort.takes(1) {
                    return true;
                }
                let passes = |one: &Face, other: &Face| {
                    sides(&one.corners).any(|(p, q)| other.is_passed(p, q, self.tolerance))
                };
                if meet(&a.bounds, &b.bounds, self.tolerance) && (passes(a, b) || passes(b, a)) {
                    return true;
                }
            }
        }
        false
    }

    /// Whether a patch of the same frame lies flush in a double-sided face and looks to the inside.
    pub(super) fn is_looked_into(&self, patch: &Patch) -> bool {
        let corners: Vec<DVec3> = patch.corners_in_body().collect();
        let bounds = Aabb::of(corners.iter().copied());
        meet(&self.bounds, &bounds, self.tolerance)
            && self.faces.iter().any(|face| {
                face.is_two_sided
                    && face.plane.normal.dot(patch.frame.normal) < -0.5
                    && meet(&face.bounds, &bounds, self.tolerance)
                    && corners.iter().all(|&c| face.plane.distance(c).abs() <= self.tolerance)
            })
    }

    /// Winding number of the shell about a point: 1 inside, 1/2 on a face, 0 outside.
    fn winding(&self, p: DVec3) -> f64 {
        let of_face = |f: &Face| {
            let at = |k: usize| f.corners[k] - p;
            (1..f.corners.len() - 1).map(|k| solid_angle(at(0), at(k), at(k + 1))).sum::<f64>()
        };
        self.faces.iter().map(of_face).sum::<f64>() / (4.0 * std::f64::consts::PI)
    }

    /// How a point lies to the shell.
    pub(super) fn place_of(&self, p: DVec3, effort: &mut Effort) -> Lies {
        if !meet(&self.bounds, &Aabb::of([p]), self.tolerance) {
            return Lies::Outside;
        }
        if !effort.takes(self.corners) {
            return Lies::Inside;
        }
        match self.winding(p) {
            w if w > INSIDE => Lies::Inside,
            w if w > TOUCHES => Lies::On,
            _ => Lies::Outside,
        }
    }

    /// How a convex polygon lies to the shell: cut along the planes of the faces that it meets, each piece
    /// is on one side.
    pub(super) fn place_of_polygon(&self, corners: &[DVec3], effort: &mut Effort) -> Lies {
        let bounds = Aabb::of(corners.iter().copied());
        if !meet(&self.bounds, &bounds, self.tolerance) {
            return Lies::Outside;
        }
        if !effort.takes(self.faces.len()) {
            return Lies::Inside;
        }
        let mut pieces = vec![corners.to_vec()];
        for face in self.faces.iter().filter(|f| meet(&f.bounds, &bounds, self.tolerance)) {
            let mut next = Vec::with_capacity(pieces.len() + 1);
            for piece in pieces {
                let within = Aabb::of(piece.iter().copied());
                if meet(&face.bounds, &within, self.tolerance) {
                    next.extend(halves(piece, &face.plane, self.tolerance));
                } else {
                    next.push(piece);
                }
            }
            pieces = next;
            if pieces.len() > SHELL_PIECES_MAX {
                return Lies::Inside;
            }
        }
        let place = |piece: &Vec<DVec3>| {
            let middle = piece.iter().sum::<DVec3>() / piece.len() as f64;
            self.place_of(middle, effort)
        };
        let wide = |piece: &&Vec<DVec3>| is_wide(piece, self.tolerance);
        pieces.iter().filter(wide).map(place).max().unwrap_or(Lies::On)
    }
}

/// The parts of a convex polygon on either side of a plane; itself where it does not pass through.
fn halves(corners: Vec<DVec3>, plane: &Plane, tolerance: f64) -> Vec<Vec<DVec3>> {
    let away: Vec<f64> = corners.iter().map(|&c| plane.distance(c)).collect();
    if away.iter().all(|&d| d >= -tolerance) || away.iter().all(|&d| d <= tolerance) {
        return vec![corners];
    }
    let half = |sign: f64| {
        let mut half = Vec::with_capacity(corners.len() + 1);
        for k in 0..corners.len() {
            let next = (k + 1) % corners.len();
            let (d, e) = (sign * away[k], sign * away[next]);
            if d >= 0.0 {
                half.push(corners[k]);
            }
            if (d > 0.0 && e < 0.0) || (d < 0.0 && e > 0.0) {
                half.push(corners[k] + (corners[next] - corners[k]) * (d / (d - e)));
            }
        }
        half
    };
    vec![half(1.0), half(-1.0)]
}

/// Whether a polygon is more than a sliver that rounding may have left.
fn is_wide(corners: &[DVec3], tolerance: f64) -> bool {
    let at = |k: usize| corners[k] - corners[0];
    let twice: DVec3 = (1..corners.len().max(1) - 1).map(|k| at(k).cross(at(k + 1))).sum();
    let around: f64 = sides(corners).map(|(a, b)| a.distance(b)).sum();
    twice.length() > 2.0 * tolerance * around
}
