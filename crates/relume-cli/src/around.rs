//! Pictures of links: around some bodies, with what happened to them or how long nothing will, over a pale picture of what hides them.
//!
//! Knows nothing of flags.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};
use relume::element::{ElementId, ElementKey};
use relume::pair::{EventKind, Link};
use relume::scene::{BodyId, LightId, LightKind, PatchId};
use relume::session::{Frame, Session};
use relume_picture::drawing::{Colour, Drawing, Pen, with_key};
use relume_picture::picture::{self, Image, Layers, Outlines, Scale, Settings, View};

use crate::flat::draw::{BLACK, PINK, colour_of};

/// Links drawn at most: more are one pink surface.
const LINKS_MAX: usize = 20_000;
/// How much nearer than what is seen a place may be, as a share of the distance, and still be on it.
const ON_SURFACE: f64 = 0.01;

/// Elements and links around some bodies, over a pale picture of what hides them.
pub(crate) struct Around<'a> {
    session: &'a Session,
    outlines: Outlines,
    view: &'a View,
    size: (u32, u32),
    /// Distances along the view of what is seen, row by row.
    depths: Vec<f32>,
    ground: Image,
}

impl<'a> Around<'a> {
    pub(crate) fn new(
        session: &'a Session,
        (view, settings): (&'a View, &Settings),
        layers: &Layers,
    ) -> Self {
        let (width, height) = (settings.width, settings.height);
        let back = view.world_from_camera.rotation.z_axis;
        let shade = |seen: &picture::Seen| {
            let facing = DVec3::from_array(seen.normal.map(f64::from)).dot(back).clamp(0.0, 1.0);
            let light = if seen.body == 0 { 1.0 } else { 0.8 + 0.15 * facing };
            [(255.0 * light).round() as u8; 3]
        };
        Around {
            session,
            outlines: Outlines::new(view, width, height),
            view,
            size: (width, height),
            depths: layers.pixels.iter().map(|seen| seen.depth_m).collect(),
            ground: Image { width, height, pixels: layers.pixels.iter().map(shade).collect() },
        }
    }

    fn sheet(&self) -> Drawing {
        let mut sheet = Drawing::new(self.size.0, self.size.1);
        sheet.picture([0, 0], self.ground.clone());
        sheet
    }

    /// The body of an element; `None` for clusters of several.
    fn body(&self, id: ElementId) -> Option<BodyId> {
        let (_, forest) = solved(self.session).pairs();
        let patch: PatchId = forest.patch(id)?;
        Some(self.session.scene().patches[patch.0 as usize].body)
    }

    /// Corners of an element in the world; `None` for groups, and where its body is absent.
    fn corners(&self, id: ElementId) -> Option<Vec<DVec3>> {
        let (_, forest) = solved(self.session).pairs();
        let scene = self.session.scene();
        let patch = &scene.patches[forest.patch(id)?.0 as usize];
        let pose = self.session.world().pose(patch.body)?;
        let shape = forest.shape(id);
        Some(shape.corners[..shape.len].iter().map(|&p| pose.point(patch.frame.point(p))).collect())
    }

    /// The links between some bodies and others: the end on them, and the other.
    fn ends(&self, bodies: &BTreeSet<BodyId>) -> Vec<[ElementId; 2]> {
        let (tree, _) = solved(self.session).pairs();
        let is_of = |id| self.body(id).is_some_and(|body| bodies.contains(&body));
        let ends = tree.links().filter_map(|link| match (is_of(link.a), is_of(link.b)) {
            (true, false) => Some([link.a, link.b]),
            (false, true) => Some([link.b, link.a]),
            _ => None,
        });
        ends.collect()
    }

    /// Whether nothing stands before a point.
    fn is_in_sight(&self, point: DVec3) -> bool {
        let Some(pixel) = self.view.project(point, self.size.0, self.size.1) else { return false };
        let DVec2 { x, y } = pixel.floor();
        if x < 0.0 || y < 0.0 || x >= f64::from(self.size.0) || y >= f64::from(self.size.1) {
            return false;
        }
        let depth = -self.view.world_from_camera.inverse_point(point).z;
        let seen = self.depths[y as usize * self.size.0 as usize + x as usize];
        depth <= f64::from(seen) * (1.0 + ON_SURFACE)
    }

    /// Outlines of the elements with links to some bodies, and of these in pink.
    pub(crate) fn linked(&self, bodies: &BTreeSet<BodyId>) -> Image {
        let mut sheet = self.sheet();
        let linked: BTreeSet<ElementId> = self.ends(bodies).into_iter().map(|[_, it]| it).collect();
        let outline = |sheet: &mut Drawing, polygon: &[DVec3], pen: Pen| {
            let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
            if self.outlines.faces(polygon) && self.is_in_sight(middle) {
                for [from, to] in self.outlines.edges(polygon) {
                    sheet.stroke(from.to_array(), to.to_array(), pen);
                }
            }
        };
        for polygon in linked.iter().filter_map(|&id| self.corners(id)) {
            outline(&mut sheet, &polygon, Pen::new(0.7, BLACK));
        }
        let (_, forest) = solved(self.session).pairs();
        for &facet in forest.facets() {
            if let (true, Some(polygon)) =
                (self.body(facet).is_some_and(|b| bodies.contains(&b)), self.corners(facet))
            {
                for [from, to] in self.outlines.edges(&polygon) {
                    sheet.stroke(from.to_array(), to.to_array(), Pen::new(2.0, PINK));
                }
            }
        }
        sheet.to_image(1)
    }

    /// Links of some bodies from middle to middle, the strongest last.
    pub(crate) fn links(&self, bodies: &BTreeSet<BodyId>) -> Image {
        let mut sheet = self.sheet();
        let middle = |id: ElementId| {
            let corners = self.corners(id)?;
            Some(corners.iter().sum::<DVec3>() / corners.len() as f64)
        };
        let ends = self.ends(bodies);
        let step = ends.len().div_ceil(LINKS_MAX).max(1);
        let pen = Pen { width: 0.6, colour: PINK, opacity: opacity(ends.len()) };
        for [own, other] in ends.into_iter().step_by(step) {
            let (Some(from), Some(to)) = (middle(own), middle(other)) else { continue };
            if !self.is_in_sight(to) {
                continue;
            }
            let place = |p: DVec3| self.view.project(p, self.size.0, self.size.1);
            if let (Some(from), Some(to)) = (place(from), place(to)) {
                sheet.stroke(from.to_array(), to.to_array(), pen);
                sheet.disc(to.to_array(), 1.2, PINK);
            }
        }
        sheet.to_image(1)
    }

    /// Middle of an element in the world, of the elements in a group, or of a light; `None` for what is absent or distant.
    fn middle(&self, id: ElementId) -> Option<DVec3> {
        let (_, forest) = solved(self.session).pairs();
        if let Some(k) = forest.light(id) {
            let light = LightId(k as u32);
            let kind = self.session.scene().lights[k].kind;
            let pose = self.session.world().light_pose(light)?;
            return (kind != LightKind::Directional).then_some(pose.translation);
        }
        if forest.is_distant(id) {
            return None;
        }
        let middle = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
        if forest.patch(id).is_some() {
            return self.corners(id).map(|corners| middle(&corners));
        }
        let below = forest.children(id).filter_map(|child| self.middle(ElementId(child)));
        let below: Vec<DVec3> = below.collect();
        (!below.is_empty()).then(|| middle(&below))
    }

    /// The element of a name; where there is none any more, the least one that it was a part of.
    fn named(&self, key: ElementKey) -> ElementId {
        let (_, forest) = solved(self.session).pairs();
        let levels = key.path.ilog2() / 2;
        (0..levels).rev().fold(forest.named(key.facet), |id, level| {
            let child = (key.path >> (2 * level) & 3) as usize;
            forest.children(id).nth(child).map_or(id, ElementId)
        })
    }

    /// Places on the picture of the middles of links of which an end is in sight, from those whose ends are known.
    fn places<T>(&self, links: impl Iterator<Item = ([ElementId; 2], T)>) -> Vec<([DVec2; 2], T)> {
        let mut known = BTreeMap::new();
        let mut place = |id: ElementId| {
            *known.entry(id.0).or_insert_with(|| {
                let middle = self.middle(id)?;
                let at = self.view.project(middle, self.size.0, self.size.1)?;
                Some((at, self.is_in_sight(middle)))
            })
        };
        let placed = links.filter_map(|(ends, what)| {
            let [(one, sees_one), (other, sees_other)] = [place(ends[0])?, place(ends[1])?];
            (sees_one || sees_other).then_some(([one, other], what))
        });
        let placed: Vec<_> = placed.collect();
        let step = placed.len().div_ceil(LINKS_MAX).max(1);
        placed.into_iter().step_by(step).collect()
    }

    /// Whether a link is of some bodies; all are of none.
    fn is_of(&self, bodies: Option<&BTreeSet<BodyId>>, ends: [ElementId; 2]) -> bool {
        bodies.is_none_or(|bodies| {
            ends.iter().any(|&id| self.body(id).is_some_and(|body| bodies.contains(&body)))
        })
    }

    /// What happened to links since the frame before: each link pale from middle to middle, and half way in the colour of what happened; with
    /// the numbers of all that did, in sight or not.
    pub(crate) fn events(&self, bodies: Option<&BTreeSet<BodyId>>) -> Image {
        let events = solved(self.session).link_events().iter();
        let events = events.map(|e| ([self.named(e.ends.0), self.named(e.ends.1)], e.kind));
        let events: Vec<_> = events.filter(|(ends, _)| self.is_of(bodies, *ends)).collect();
        let number = |kind: EventKind| events.iter().filter(|(_, k)| *k == kind).count();
        let rows: Vec<(Colour, String)> =
            KINDS.map(|(kind, name)| (colour_of(kind), format!("{name} {}", number(kind)))).into();
        let mut placed = self.places(events.iter().copied());
        // What is rare, last.
        placed.sort_by_key(|&(_, kind)| std::cmp::Reverse(number(kind)));
        let mut sheet = self.sheet();
        let opacity = opacity(placed.len());
        for &([one, other], _) in &placed {
            let pen = Pen { width: 0.6, colour: PINK, opacity: 0.4 * opacity };
            sheet.stroke(one.to_array(), other.to_array(), pen);
        }
        for &([one, other], kind) in &placed {
            let [from, to] = [0.42, 0.58].map(|share| one.lerp(other, share).to_array());
            let pen =
                Pen { width: 1.2, colour: colour_of(kind), opacity: (2.0 * opacity).min(0.8) };
            sheet.stroke(from, to, pen);
        }
        with_key(sheet.to_image(1), "EVENTS", &rows)
    }

    /// Links of some bodies in the colours of how long nothing is certified to change what hides them, seconds; those that are looked at in
    /// the next frame in pink, last.
    pub(crate) fn certificates(
        &self,
        links: &[(Link, Option<f64>)],
        bodies: &BTreeSet<BodyId>,
        scale: &Scale,
    ) -> Image {
        let links = links.iter().map(|(link, left_s)| ([link.a, link.b], *left_s));
        let links: Vec<_> = links.filter(|(ends, _)| self.is_of(Some(bodies), *ends)).collect();
        let without = links.iter().filter(|(_, left_s)| left_s.is_none()).count();
        let mut placed = self.places(links.iter().copied());
        let left_s = |left_s: Option<f64>| left_s.unwrap_or(-1.0);
        placed.sort_by(|a, b| left_s(b.1).total_cmp(&left_s(a.1)));
        let mut sheet = self.sheet();
        let opacity = opacity(placed.len());
        for ([one, other], left_s) in placed {
            let share = |left_s: f64| (left_s - scale.low) / (scale.high - scale.low);
            let colour = left_s.map_or(PINK, |left_s| scale.map.colour(share(left_s)));
            sheet.stroke(
                one.to_array(),
                other.to_array(),
                Pen { width: 1.0, colour, opacity: opacity.max(0.3) },
            );
        }
        with_key(sheet.to_image(1), "LINKS", &[(PINK, format!("NOT CERTIFIED {without}"))])
    }
}

/// What a session has solved last.
pub(crate) fn solved(session: &Session) -> Frame<'_> {
    session.frame().expect("pictures are drawn of solutions")
}

/// Kinds of events, as legends name them.
const KINDS: [(EventKind, &str); 6] = [
    (EventKind::Promoted, "PROMOTED"),
    (EventKind::Demoted, "DEMOTED"),
    (EventKind::Occluded, "OCCLUDED"),
    (EventKind::Revealed, "REVEALED"),
    (EventKind::Culled, "CULLED"),
    (EventKind::Woken, "WOKEN"),
];

/// Of so many lines, so that they do not become one surface.
fn opacity(lines: usize) -> f64 {
    (600.0 / lines.max(1) as f64).clamp(0.08, 0.7)
}
