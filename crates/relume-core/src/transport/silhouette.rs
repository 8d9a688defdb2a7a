//! The shadow of a convex solid: its sides run through the edges between faces that a point sees and
//! faces that it does not.

use glam::DVec3;

use crate::scene::{Solid, SolidEdge, SolidFace};

/// A solid in some frame, prepared for views from points of one polygon, the observer.
pub(super) struct Silhouette {
    corners: Vec<DVec3>,
    /// Faces that some points of the observer see and others do not.
    faces: Vec<Face>,
    /// Edges that bound the shadow from every point.
    always: Vec<[usize; 2]>,
    /// Edges that bound the shadow from some points only.
    sometimes: Vec<Edge>,
}

struct Face {
    normal: DVec3,
    /// One of its corners.
    corner: usize,
}

struct Edge {
    /// Corners; it runs counter-clockwise about the first face, clockwise about the second.
    ends: [usize; 2],
    faces: [Sight; 2],
}

/// Whether the observer sees a face.
#[derive(Clone, Copy, PartialEq)]
enum Sight {
    All,
    None,
    /// It depends on the point: one of the faces that are kept.
    Some(usize),
}

impl Silhouette {
    /// Corners and normals by `place` and `turn` to the frame, in which the observer's corners are; `is_low`
    /// says of a corner in the frame whether it is in the observer's plane or behind it.
    pub(super) fn new(
        solid: &Solid,
        (place, turn): (impl Fn(DVec3) -> DVec3, impl Fn(DVec3) -> DVec3),
        observer: &[DVec3],
        is_low: impl Fn(DVec3) -> bool,
    ) -> Silhouette {
        let corners: Vec<DVec3> = solid.corners.iter().map(|&c| place(c)).collect();
        let low: Vec<bool> = corners.iter().map(|&c| is_low(c)).collect();
        // An edge in the observer's plane, or behind it, bounds nothing in front; and a face of such edges
        // nobody sees.
        let is_high = |edge: &&SolidEdge| !edge.ends.iter().all(|&c| low[c as usize]);
        let mut is_low = vec![true; solid.faces.len()];
        for edge in solid.edges.iter().filter(is_high) {
            edge.faces.iter().for_each(|&f| is_low[f as usize] = false);
        }
        let mut faces = Vec::new();
        let sight = |(face, &is_low): (&SolidFace, &bool)| {
            let (normal, corner) = (turn(face.normal), face.corner as usize);
            let above = |p: &DVec3| normal.dot(*p - corners[corner]) > 0.0;
            let count = observer.iter().filter(|p| above(p)).count();
            match count {
                _ if is_low => Sight::None,
                0 => Sight::None,
                n if n == observer.len() => Sight::All,
                _ => {
                    faces.push(Face { normal, corner });
                    Sight::Some(faces.len() - 1)
                }
            }
        };
        let sights: Vec<Sight> = solid.faces.iter().zip(&is_low).map(sight).collect();
        let (mut always, mut sometimes) = (Vec::new(), Vec::new());
        for edge in solid.edges.iter().filter(is_high) {
            let [p, q] = [edge.ends[0] as usize, edge.ends[1] as usize];
            let of = [sights[edge.faces[0] as usize], sights[edge.faces[1] as usize]];
            match of {
                [Sight::All, Sight::All] | [Sight::None, Sight::None] => {}
                [Sight::All, Sight::None] => always.push([q, p]),
                [Sight::None, Sight::All] => always.push([p, q]),
                _ => sometimes.push(Edge { ends: [p, q], faces: of }),
            }
        }
        Silhouette { corners, faces, always, sometimes }
    }

    /// About twice the solid angle that it hides from a point, as that of a polygon is estimated.
    pub(super) fn size(&self, from: DVec3) -> f64 {
        let away = self.corners.iter().sum::<DVec3>() / self.corners.len() as f64 - from;
        let r2 = away.length_squared().max(f64::MIN_POSITIVE);
        // Twice the area within the outline, but for edges that bound nothing in front.
        let mut area = DVec3::ZERO;
        let sides = self.always.iter().copied();
        for [p, q] in sides.chain(self.outline(from, &mut Vec::new())) {
            area += (self.corners[p] - from).cross(self.corners[q] - from);
        }
        area.dot(away).abs() / (r2 * r2.sqrt())
    }

    /// Which of the edges that bound the shadow of some points bound that of this one.
    fn outline<'a>(
        &'a self,
        point: DVec3,
        seen: &'a mut Vec<bool>,
    ) -> impl Iterator<Item = [usize; 2]> + 'a {
        seen.clear();
        let is_seen = |f: &Face| f.normal.dot(point - self.corners[f.corner]) > 0.0;
        seen.extend(self.faces.iter().map(is_seen));
        self.sometimes.iter().filter_map(|edge| {
            let [p, q] = edge.ends;
            let sees = |sight| match sight {
                Sight::All => true,
                Sight::None => false,
                Sight::Some(face) => seen[face],
            };
            match [sees(edge.faces[0]), sees(edge.faces[1])] {
                [true, false] => Some([q, p]),
                [false, true] => Some([p, q]),
                _ => None,
            }
        })
    }

    /// Calls `side` with the normal, into the shadow and of any length, of each plane through the point
    /// that bounds the shadow, until it returns false; false then. A point inside, or under a face, has no
    /// such plane: everything is in the shadow.
    pub(super) fn cast(
        &self,
        point: DVec3,
        seen: &mut Vec<bool>,
        mut side: impl FnMut(DVec3) -> bool,
    ) -> bool {
        let mut between =
            |[p, q]: [usize; 2]| side((self.corners[p] - point).cross(self.corners[q] - point));
        self.always.iter().all(|&ends| between(ends)) && self.outline(point, seen).all(between)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::scene::SceneBuilder;

    fn cuboid() -> Solid {
        let mut b = SceneBuilder::new("box");
        let node = b.node("box", None, DVec3::ZERO, glam::DQuat::IDENTITY);
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        b.cuboid(node, "box", grey, DVec3::splat(-1.0), DVec3::ONE);
        b.build().unwrap().solids().list.remove(0)
    }

    fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-3.0..3.0).prop_map(DVec3::from)
    }

    /// Whether the way from one point on through another meets the box of half size 1.
    fn meets(from: DVec3, way: DVec3) -> bool {
        let (low, high) = ((-DVec3::ONE - from) / way, (DVec3::ONE - from) / way);
        let (enter, leave) = (low.min(high).max_element(), low.max(high).min_element());
        enter <= leave && leave >= 0.0
    }

    proptest! {
        /// A ray is within all sides of the shadow if and only if it meets the solid.
        #[test]
        fn a_shadow_is_where_rays_meet_the_solid(
            observer in prop::array::uniform3(point()),
            share in prop::array::uniform3(0.01..1.0),
            to in point(),
        ) {
            let sum: f64 = share.iter().sum();
            let from: DVec3 = observer.iter().zip(share).map(|(p, s)| *p * (s / sum)).sum();
            let identity = |p: DVec3| p;
            let solid = Silhouette::new(&cuboid(), (identity, identity), &observer, |_| false);
            let is_in = solid.cast(from, &mut Vec::new(), |n| n.dot(to - from) >= 0.0);
            prop_assert_eq!(is_in, meets(from, to - from));
        }
    }

    #[test]
    fn under_a_box_everything_is_dark_and_beside_it_only_what_is_behind() {
        let observer =
            [DVec3::new(-2.0, -1.0, 0.0), DVec3::new(2.0, -1.0, 0.5), DVec3::new(0.0, -1.0, -0.5)];
        let on_floor = |p: DVec3| p.y <= -1.0 + 1e-9;
        let identity = |p: DVec3| p;
        let solid = Silhouette::new(&cuboid(), (identity, identity), &observer, on_floor);
        let sides = |from: DVec3, to: DVec3| {
            let mut count = 0;
            let is_in = solid.cast(from, &mut Vec::new(), |n| {
                count += 1;
                n.dot(to - from) >= 0.0
            });
            (is_in, count)
        };
        assert_eq!(sides(DVec3::new(0.5, -1.0, 0.0), DVec3::new(9.0, 3.0, 0.0)), (true, 0));
        let beside = DVec3::new(-1.5, -1.0, 0.0);
        assert!(sides(beside, DVec3::new(1.0, 0.5, 0.0)).0);
        assert!(!sides(beside, DVec3::new(1.0, 9.5, 0.0)).0);
        assert!(!sides(beside, DVec3::new(-9.0, 0.5, 0.0)).0);
    }
}
