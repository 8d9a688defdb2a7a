//! A snapshot as an ordered list of things to draw.
//!
//! Must not know how pixels are made or how radiosity becomes a colour. Order: patches by
//! [area](relume_core::scene::Scene::lying_m2), the smallest first, then by id; leaves (or triangles) in order within, then their outlines. It
//! decides between equally near things: of surfaces in one plane the smaller is seen, as in the solution. It
//! must not depend on threads.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use relume_core::scene::{Patch, PatchId};
use relume_core::session::{Leaf, Snapshot};

use super::gouraud::{self, Triangle};
use super::lit::{Arriving, Lit};
use super::printed::Shown;
use super::project::{Projector, SeenPlane, clip_to_pixels};
use super::raster::{Fragment, Grid, Primitive};
use super::shading::Shading;
use super::smooth::Smooth;

/// Depth of the near plane as a share of the distance to the farthest point of the scene.
const NEAR: f64 = 1e-6;

/// Width of outlines, pixels.
const OUTLINE_WIDTH: f64 = 0.8;

/// Outlines are drawn this much nearer than the surface they lie on (relative).
const OUTLINE_LIFT: f64 = 1e-3;

/// What a primitive shows.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Fill {
    /// One radiosity, W/m2.
    Constant([f32; 3]),
    /// Radiosity that is linear in the plane of the patch.
    Linear(Linear),
    /// The outline of a leaf that has this radiosity, W/m2.
    Outline([f32; 3]),
    /// A leaf, by its index in the snapshot, in the light that [`Lit`] finds.
    Lit(u32),
}

/// What the light on surfaces is taken from.
#[derive(Clone, Copy)]
pub(crate) enum Light<'a> {
    /// Every leaf has one value.
    Flat,
    /// Linear over triangles.
    Gouraud,
    /// Found at every point.
    Smooth(&'a Lit<'a>),
}

impl<'a> Light<'a> {
    /// What a way of shading takes it from; smooth light is to be there for the one that shows it.
    pub(crate) fn of(shading: Shading, lit: Option<&'a Lit<'a>>) -> Light<'a> {
        match (shading, lit) {
            (Shading::Flat, _) => Light::Flat,
            (Shading::Smooth, Some(lit)) => Light::Smooth(lit),
            (Shading::Gouraud | Shading::Smooth, _) => Light::Gouraud,
        }
    }
}

/// Radiosity `value + along_u du + along_v dv` at plane coordinates `origin + (du, dv)`,
/// within the range of its corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear {
    plane: u32,
    origin: DVec2,
    value: [f64; 3],
    gradient: [DVec2; 3],
    range: [[f64; 2]; 3],
}

/// What is drawn of the light on surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Radiosity,
    Irradiance,
}

/// Everything that faces the camera, ready to be rasterised.
pub(crate) struct Drawing<'a> {
    pub(crate) primitives: Vec<Primitive>,
    /// What each primitive shows.
    pub(crate) fills: Vec<Fill>,
    /// Which patch each primitive belongs to.
    pub(crate) patches: Vec<PatchId>,
    planes: Vec<SeenPlane>,
    /// Which plane each primitive lies in.
    plane_of: Vec<u32>,
    /// Patches with images.
    shown: BTreeMap<PatchId, Shown>,
    snapshot: &'a Snapshot,
    lit: Option<&'a Lit<'a>>,
    quantity: Quantity,
}

/// Place of a patch among others in its plane, the first of which is seen: by area in single precision without its last digits, so that
/// areas that rounding sets apart are equal.
fn order(snapshot: &Snapshot, patch: usize) -> u32 {
    let scene = &snapshot.scene;
    (scene.lying_m2(&scene.patches[patch]) as f32).to_bits() >> 4
}

impl<'a> Drawing<'a> {
    /// All leaves of all patches whose front faces the camera; the backs of patches are left out.
    pub(crate) fn new(
        snapshot: &'a Snapshot,
        projector: &Projector,
        grid: &Grid,
        light: Light<'a>,
        outlines: bool,
    ) -> Drawing<'a> {
        Drawing::of(Quantity::Radiosity, snapshot, (projector, grid), light, outlines)
    }

    /// The same of a quantity; in [`Drawing::seen`] and [`Drawing::radiosity`] it takes the place of radiosity. The order of things
    /// is the same for all quantities.
    pub(crate) fn of(
        quantity: Quantity,
        snapshot: &'a Snapshot,
        (projector, grid): (&Projector, &Grid),
        light: Light<'a>,
        outlines: bool,
    ) -> Drawing<'a> {
        let near = NEAR * farthest(snapshot, projector.eye());
        let count = snapshot.scene.patches.len() as u32;
        let smooth = match light {
            Light::Flat | Light::Smooth(_) => Smooth::default(),
            Light::Gouraud => Smooth::new(snapshot),
        };
        let shown = Showing { light, smooth: &smooth, quantity };
        let of_patches: Vec<Option<PatchDrawing>> = (0..count)
            .into_par_iter()
            .map(|i| {
                PatchDrawing::new(snapshot, PatchId(i), projector, grid, near, &shown, outlines)
            })
            .collect();
        let mut seen: Vec<(usize, PatchDrawing)> = of_patches
            .into_iter()
            .enumerate()
            .filter_map(|(i, patch)| patch.map(|patch| (i, patch)))
            .collect();
        seen.sort_by_cached_key(|&(i, _)| order(snapshot, i));
        let mut drawing = Drawing {
            primitives: Vec::new(),
            fills: Vec::new(),
            patches: Vec::new(),
            planes: Vec::new(),
            plane_of: Vec::new(),
            shown: BTreeMap::new(),
            snapshot,
            lit: match light {
                Light::Smooth(lit) => Some(lit),
                Light::Flat | Light::Gouraud => None,
            },
            quantity,
        };
        for (i, patch) in seen {
            let plane = drawing.planes.len() as u32;
            drawing.planes.push(patch.plane);
            let id = PatchId(i as u32);
            drawing.shown.extend(Shown::new(snapshot, id, patch.plane).map(|shown| (id, shown)));
            for (primitive, mut fill) in patch.pieces {
                if let Fill::Linear(linear) = &mut fill {
                    linear.plane = plane;
                }
                drawing.primitives.push(primitive);
                drawing.fills.push(fill);
                drawing.patches.push(id);
                drawing.plane_of.push(plane);
            }
        }
        drawing
    }

    /// What is seen of a primitive at a position in pixels, W/m2: its radiosity with the image that is on the patch.
    pub(crate) fn seen(&self, primitive: usize, pixel: DVec2) -> [f32; 3] {
        let radiosity = self.radiosity(primitive, pixel);
        match (&self.fills[primitive], self.shown.get(&self.patches[primitive])) {
            (Fill::Outline(_), _) | (_, None) => radiosity,
            (_, Some(shown)) => shown.radiosity(pixel, radiosity),
        }
    }

    /// Diffuse reflectance that is seen of a primitive at a position in pixels, linear RGB, where its patch reflects as `mean` on the
    /// whole.
    pub(crate) fn reflectance(&self, primitive: usize, pixel: DVec2, mean: [f64; 3]) -> [f64; 3] {
        let shown = self.shown.get(&self.patches[primitive]);
        shown.map_or(mean, |shown| shown.reflectance_at(pixel))
    }

    /// Depth along the view of what is seen of a primitive at a position in pixels, metres.
    pub(crate) fn depth(&self, primitive: usize, pixel: DVec2) -> f64 {
        let plane = &self.planes[self.plane_of[primitive] as usize];
        plane.project(plane.unproject(pixel)).w
    }

    /// Radiosity of a primitive at a position in pixels, W/m2.
    pub(crate) fn radiosity(&self, primitive: usize, pixel: DVec2) -> [f32; 3] {
        match &self.fills[primitive] {
            Fill::Constant(b) | Fill::Outline(b) => *b,
            Fill::Lit(leaf) => self.lit_at(primitive, *leaf as usize, pixel),
            Fill::Linear(linear) => {
                let d = self.planes[linear.plane as usize].unproject(pixel) - linear.origin;
                [0, 1, 2].map(|c| {
                    let [low, high] = linear.range[c];
                    (linear.value[c] + linear.gradient[c].dot(d)).max(low).min(high) as f32
                })
            }
        }
    }
}

impl Drawing<'_> {
    /// What arrives at a primitive at a position in pixels, where its light is found at every point.
    pub(crate) fn arriving(&self, primitive: usize, pixel: DVec2) -> Option<Arriving> {
        let (lit, &Fill::Lit(leaf)) = (self.lit?, &self.fills[primitive]) else { return None };
        let plane = &self.planes[self.plane_of[primitive] as usize];
        Some(lit.at(self.patches[primitive], leaf as usize, plane.unproject(pixel)))
    }

    /// Whether something stands between a lamp and a primitive.
    pub(crate) fn is_shaded(&self, primitive: usize) -> bool {
        let (Some(lit), Fill::Lit(leaf)) = (self.lit, self.fills[primitive]) else { return false };
        lit.is_shaded(leaf as usize)
    }

    fn lit_at(&self, primitive: usize, leaf: usize, pixel: DVec2) -> [f32; 3] {
        let Some(arriving) = self.arriving(primitive, pixel) else {
            return self.snapshot.leaves[leaf].radiosity;
        };
        self.leaving(primitive, arriving.irradiance)
    }

    /// What is drawn where this much arrives, W/m2.
    pub(crate) fn leaving(&self, primitive: usize, irradiance: [f64; 3]) -> [f32; 3] {
        if self.quantity == Quantity::Irradiance {
            return irradiance.map(|h| h as f32);
        }
        let (scene, now) = (&self.snapshot.scene, &self.snapshot.world);
        let patch = &scene.patches[self.patches[primitive].0 as usize];
        let (exitance, reflectance) = (now.exitance(scene, patch), now.reflectance(scene, patch));
        [0, 1, 2].map(|c| (exitance[c] + reflectance[c] * irradiance[c]) as f32)
    }

    /// The fragments of a pixel with those that see leaves of one patch put together.
    pub(crate) fn merged(&self, fragments: &[Fragment], out: &mut Vec<Fragment>) {
        out.clear();
        let patch = |fragment: &Fragment| match fragment.primitive {
            Some(k) if matches!(self.fills[k], Fill::Lit(_)) => Some(self.patches[k]),
            _ => None,
        };
        for fragment in fragments {
            let own = patch(fragment);
            let same = out.iter_mut().find(|other| own.is_some() && patch(other) == own);
            match same {
                None => out.push(*fragment),
                Some(other) => {
                    let (n, m) = (f64::from(other.samples), f64::from(fragment.samples));
                    other.position = (other.position * n + fragment.position * m) / (n + m);
                    if fragment.samples > other.samples {
                        other.primitive = fragment.primitive;
                    }
                    other.samples += fragment.samples;
                }
            }
        }
    }
}

/// Distance from `eye` to the farthest corner of a patch that is present, metres.
fn farthest(snapshot: &Snapshot, eye: DVec3) -> f64 {
    let mut far = 0.0_f64;
    let near = |patch: &&Patch| !snapshot.scene.is_distant(patch.body);
    for patch in snapshot.scene.patches.iter().filter(near) {
        if let Some(pose) = snapshot.world.pose(patch.body) {
            far = patch.corners_in_body().fold(far, |far, p| far.max(pose.point(p).distance(eye)));
        }
    }
    far
}

/// What one patch adds to a drawing.
struct PatchDrawing {
    plane: SeenPlane,
    pieces: Vec<(Primitive, Fill)>,
}

/// What is shown of patches.
struct Showing<'a> {
    light: Light<'a>,
    /// Light at corners of smooth patches.
    smooth: &'a Smooth,
    quantity: Quantity,
}

impl PatchDrawing {
    fn new(
        snapshot: &Snapshot,
        id: PatchId,
        projector: &Projector,
        grid: &Grid,
        near: f64,
        &Showing { light, smooth, quantity }: &Showing<'_>,
        outlines: bool,
    ) -> Option<PatchDrawing> {
        let patch = &snapshot.scene.patches[id.0 as usize];
        let pose = snapshot.world.pose(patch.body)?;
        if snapshot.scene.is_distant(patch.body) {
            return None;
        }
        let origin = pose.point(patch.frame.origin);
        if !projector.faces(origin, pose.direction(patch.frame.normal)) {
            return None;
        }
        let (u, v) = (pose.direction(patch.frame.u), pose.direction(patch.frame.v));
        let plane = SeenPlane::new(projector, origin, u, v)?;
        let leaves: Cow<'_, [Leaf]> = match quantity {
            Quantity::Radiosity => snapshot.leaves_of(id).into(),
            Quantity::Irradiance => {
                let arriving = |leaf: &Leaf| Leaf { radiosity: leaf.irradiance, ..*leaf };
                snapshot.leaves_of(id).iter().map(arriving).collect()
            }
        };
        let mut pen = Pen { plane: &plane, grid, near, corners: Vec::new() };
        let triangles = match light {
            Light::Flat | Light::Smooth(_) => Vec::new(),
            Light::Gouraud => {
                let at_corners = at_corners(snapshot, patch, smooth.of(id), quantity);
                gouraud::triangulate(&patch.corners, &leaves, at_corners.as_deref())
            }
        };
        let first = snapshot.leaf_offsets[id.0 as usize];
        let mut pieces: Vec<(Primitive, Fill)> = if let Light::Smooth(_) = light {
            let lit =
                |(index, leaf): (u32, &Leaf)| Some((pen.polygon(&leaf.corners)?, Fill::Lit(index)));
            (first..).zip(leaves.iter()).filter_map(lit).collect()
        } else if triangles.is_empty() {
            leaves.iter().filter_map(|leaf| pen.leaf(leaf)).collect()
        } else {
            triangles.iter().filter_map(|triangle| pen.triangle(triangle)).collect()
        };
        if outlines {
            leaves.iter().for_each(|leaf| pen.outline(leaf, &mut pieces));
        }
        Some(PatchDrawing { plane, pieces })
    }
}

/// What the corners of a patch are to have, where neighbours have their say: of a quantity, from their irradiance.
fn at_corners(
    snapshot: &Snapshot,
    patch: &Patch,
    irradiance: Option<&[[f64; 3]]>,
    quantity: Quantity,
) -> Option<Vec<[f64; 3]>> {
    let irradiance = irradiance?;
    if quantity == Quantity::Irradiance {
        return Some(irradiance.to_vec());
    }
    let now = &snapshot.world;
    let (exitance, reflectance) =
        (now.exitance(&snapshot.scene, patch), now.reflectance(&snapshot.scene, patch));
    let radiosity = |h: &[f64; 3]| [0, 1, 2].map(|c| exitance[c] + reflectance[c] * h[c]);
    Some(irradiance.iter().map(radiosity).collect())
}

/// Puts polygons of one plane on the screen.
struct Pen<'a> {
    plane: &'a SeenPlane,
    grid: &'a Grid,
    near: f64,
    corners: Vec<DVec2>,
}

impl Pen<'_> {
    fn polygon(&mut self, corners: &[DVec2]) -> Option<Primitive> {
        self.clip(corners);
        Primitive::new(self.grid, &self.corners, self.plane.nearness)
    }

    fn clip(&mut self, corners: &[DVec2]) {
        let mut projected = [glam::DVec4::ZERO; 4];
        for (projected, &corner) in projected.iter_mut().zip(corners) {
            *projected = self.plane.project(corner);
        }
        clip_to_pixels(&projected[..corners.len()], self.near, &mut self.corners);
    }

    fn leaf(&mut self, leaf: &Leaf) -> Option<(Primitive, Fill)> {
        Some((self.polygon(&leaf.corners)?, Fill::Constant(leaf.radiosity)))
    }

    fn triangle(&mut self, triangle: &Triangle) -> Option<(Primitive, Fill)> {
        let primitive = self.polygon(&triangle.corners)?;
        Some((
            primitive,
            Linear::new(triangle).map_or(Fill::Constant(triangle.radiosity[0]), Fill::Linear),
        ))
    }

    fn outline(&mut self, leaf: &Leaf, pieces: &mut Vec<(Primitive, Fill)>) {
        self.clip(&leaf.corners);
        for (i, &a) in self.corners.iter().enumerate() {
            let b = self.corners[(i + 1) % self.corners.len()];
            let Some(across) = (b - a).perp().try_normalize() else { continue };
            let across = across * (OUTLINE_WIDTH / 2.0);
            let line = [a - across, b - across, b + across, a + across];
            let primitive = Primitive::new(self.grid, &line, self.plane.nearness);
            pieces.extend(primitive.map(|p| (p.lift(OUTLINE_LIFT), Fill::Outline(leaf.radiosity))));
        }
    }
}

impl Linear {
    /// `None` for a triangle without area.
    fn new(triangle: &Triangle) -> Option<Linear> {
        let [a, b, c] = triangle.corners;
        let (ab, ac) = (b - a, c - a);
        let twice_area = ab.perp_dot(ac);
        if twice_area.abs() <= 1e-12 * ab.length() * ac.length() {
            return None;
        }
        let [at_a, at_b, at_c] = triangle.radiosity.map(|b| b.map(f64::from));
        Some(Linear {
            plane: 0,
            origin: a,
            value: at_a,
            gradient: [0, 1, 2].map(|i| {
                let (to_b, to_c) = (at_b[i] - at_a[i], at_c[i] - at_a[i]);
                (ab.perp() * to_c - ac.perp() * to_b) / twice_area
            }),
            range: [0, 1, 2]
                .map(|i| [at_a[i].min(at_b[i]).min(at_c[i]), at_a[i].max(at_b[i]).max(at_c[i])]),
        })
    }
}
