//! From a draft to a [`Scene`]: objects are grouped into bodies, scales baked into vertices, names
//! made unique, everything checked.
//!
//! The one way in for files and code alike; must not know which of the two it was.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};

use super::draft::{Draft, DraftNode, DraftSurface};
use super::edit;
use super::flatten::{Flaw, flatten, seen_from_behind};
use super::limits::{
    COORDINATE_MAX_M, EMISSION_MAX, EMISSION_MIN, EXTENT_MIN_M, SPECK, emission, is_place,
};
use super::names::Names;
use super::origin;
use super::rigid::{Rigid, check_track, without_scales};
use super::{
    Body, BodyId, Frame, Glow, Interpolation, Material, MaterialId, Motion, NodeId, Note, Patch,
    PatchId, Print, Scene, SceneError, Severity, Surface, SurfaceId, TintId,
};
use crate::geometry::{Aabb, Pose};

impl Scene {
    /// The scene of a draft: objects grouped into bodies, scales baked into corners, names made unique, everything checked.
    ///
    /// # Errors
    /// [`SceneError`] for numbers of which no scene can be made, each with the node, surface or material and the remedy.
    pub fn from_draft(draft: Draft) -> Result<Scene, SceneError> {
        assemble(draft)
    }
}

/// Checks the draft and makes the scene of it.
pub(super) fn assemble(mut draft: Draft) -> Result<Scene, SceneError> {
    let mut notes = std::mem::take(&mut draft.notes);
    unique_names(&mut draft, &mut notes);
    let edits = std::mem::take(&mut draft.edits);
    edit::apply(&mut draft, &edits)?;
    let origin = origin::bring_near(&mut draft, &mut notes);
    check_materials(&draft.materials)?;
    check_glows(&draft)?;
    check_lights(&draft)?;
    start_glows(&mut draft, &mut notes);
    let Rigid { nodes, residuals, held } = without_scales(&draft)?;
    let duration_s = duration_s(&draft);
    let motion = Motion { duration_s, nodes, animation: draft.animation.clone() };
    notes.extend(misdirected(&draft, &residuals));
    notes.extend(held.into_iter().map(|node| held_note(&draft.nodes[node].name)));
    let mut parts = Parts::default();
    for (node, members) in bodies_of(&draft, &motion) {
        parts.add_body(&draft, node, &members, &|member| Placement {
            pose: pose_in_body(&motion, member),
            shape: residuals[member],
        })?;
    }
    parts.leave_out_specks(&motion)?;
    notes.append(&mut parts.notes);
    notes.extend(parts.names.notes("surface"));
    if parts.patches.is_empty() {
        return Err(empty(&draft));
    }
    check_declared(&draft, &parts.bodies)?;
    Ok(Scene {
        name: draft.name,
        bodies: parts.bodies,
        surfaces: parts.surfaces,
        obstructions: BTreeSet::new(),
        patches: parts.patches,
        materials: draft.materials,
        tints: draft.tints,
        lights: draft.lights,
        cameras: draft.cameras,
        motion,
        origin,
        outside: None,
        outside_m: 0.0,
        environment: draft.environment,
        notes,
        edited: super::Edited::default(),
    })
}

/// What has been assembled so far.
#[derive(Default)]
struct Parts {
    bodies: Vec<Body>,
    surfaces: Vec<Surface>,
    patches: Vec<Patch>,
    notes: Vec<Note>,
    names: Names,
}

/// How a node's own points get into the frame of its body.
struct Placement {
    pose: Pose,
    shape: DMat3,
}

/// What a patch belongs to, and how it differs from its material.
type Of = (BodyId, SurfaceId, MaterialId, Option<TintId>, Option<Arc<Print>>);

impl Placement {
    /// An image on a polygon in the body's frame.
    fn print(&self, print: &Print) -> Print {
        let mut placed = print.clone();
        for triangle in &mut placed.triangles {
            triangle.corners = triangle.corners.map(|p| self.pose.point(self.shape * p));
        }
        placed
    }

    /// The loop in the body's frame; a mirroring shape turns it round, so that the front stays the
    /// front (glTF 2.0, section 3.7.4: a negative determinant flips the winding).
    fn place(&self, polygon: &[DVec3]) -> Vec<DVec3> {
        let shaped = |&p: &DVec3| if self.shape == DMat3::IDENTITY { p } else { self.shape * p };
        let mut points: Vec<DVec3> = polygon.iter().map(|p| self.pose.point(shaped(p))).collect();
        if self.shape.determinant() < 0.0 {
            points.reverse();
        }
        points
    }
}

impl Parts {
    fn add_surface(
        &mut self,
        body: BodyId,
        (object, name): (&str, &str),
        surface: &DraftSurface,
        place: &Placement,
        materials: &[Material],
    ) -> Result<(), SceneError> {
        let id = SurfaceId(self.surfaces.len() as u32);
        let before = self.patches.len();
        let mut degenerate = 0;
        let double_sided = materials[surface.material.0 as usize].double_sided;
        for (number, polygon) in surface.polygons.iter().enumerate() {
            let tint = surface.tints.get(number).copied().flatten();
            let print = surface.prints.get(number).cloned().flatten();
            let print = print.map(|print| Arc::new(place.print(&print)));
            let points = place.place(polygon);
            if let Some(bad) = points.iter().find(|p| !is_place(&p.to_array())) {
                return Err(no_place(name, object, *bad));
            }
            for piece in flat_pieces(&points) {
                match piece {
                    Ok((frame, corners)) => {
                        let of = (body, id, surface.material, tint, print.clone());
                        self.add_patch(of, double_sided, frame, corners);
                    }
                    Err(_) => degenerate += 1,
                }
            }
        }
        if self.patches.len() > before {
            let name = self.names.unique(name);
            self.surfaces.push(Surface {
                name,
                object: object.to_owned(),
                body,
                material: surface.material,
            });
        }
        if degenerate > 0 {
            self.notes.push(degenerate_note(name, degenerate));
        }
        Ok(())
    }

    /// Adds the surfaces of some nodes, which are a body, if they have any.
    fn add_body(
        &mut self,
        draft: &Draft,
        node: usize,
        members: &[usize],
        placement: &dyn Fn(usize) -> Placement,
    ) -> Result<(), SceneError> {
        let first = self.patches.len() as u32;
        let body = BodyId(self.bodies.len() as u32);
        for &member in members {
            let place = placement(member);
            let object = &draft.nodes[member];
            for surface in &object.surfaces {
                let name = surface_name(object, surface, &draft.materials);
                let names = (&*object.name, &*name);
                self.add_surface(body, names, surface, &place, &draft.materials)?;
            }
        }
        let patches = Range { start: first, end: self.patches.len() as u32 };
        if !patches.is_empty() {
            let DraftNode { name, again, .. } = &draft.nodes[node];
            let (name, again, node) = (name.clone(), *again, NodeId(node as u32));
            self.bodies.push(Body { name, node, patches, distant: false, again });
        }
        Ok(())
    }

    /// Leaves out polygons that are too small for the scene, with a note for each surface.
    fn leave_out_specks(&mut self, motion: &Motion) -> Result<(), SceneError> {
        let Some(extent) = self.extent_m(motion) else { return Ok(()) };
        if extent < EXTENT_MIN_M {
            return Err(SceneError::Geometry {
                subject: format!("surface `{}`", self.surfaces[0].name),
                what: format!("it and the whole scene are {extent:e} m large"),
                remedy: format!("scale the scene to metres: {EXTENT_MIN_M:e} m at least"),
            });
        }
        // Length, and width as of a triangle of this area: what is as thin is left out, however long.
        let is_speck = |p: &Patch| {
            let far = |c: &DVec2| c.distance(p.corners[0]);
            let length = p.corners.iter().map(far).fold(0.0, f64::max);
            2.0 * p.area_m2() < SPECK * extent * length || length < SPECK * extent
        };
        let is_speck: Vec<bool> = self.patches.iter().map(is_speck).collect();
        if !is_speck.contains(&true) {
            return Ok(());
        }
        if !is_speck.contains(&false) {
            return Err(self.all_specks(extent, motion));
        }
        let mut counts = vec![(0, 0); self.surfaces.len()];
        for (patch, &speck) in self.patches.iter().zip(&is_speck) {
            let count = &mut counts[patch.surface.0 as usize];
            *count = (count.0 + usize::from(speck), count.1 + usize::from(!speck));
        }
        for (surface, &(specks, others)) in self.surfaces.iter().zip(&counts) {
            if specks > 0 {
                self.notes.push(speck_note(&surface.name, specks, others == 0));
            }
        }
        self.leave_out(&is_speck, |surface| counts[surface].1 > 0);
        Ok(())
    }

    /// Leaves out some polygons, and what nothing is left of: surfaces that do not `stay`, bodies without polygons. The others
    /// move up.
    fn leave_out(&mut self, is_out: &[bool], stays: impl Fn(usize) -> bool) {
        let mut new_of_surface = vec![SurfaceId(0); self.surfaces.len()];
        let mut kept = 0;
        for (k, new) in new_of_surface.iter_mut().enumerate() {
            *new = SurfaceId(kept);
            kept += u32::from(stays(k));
        }
        // The number of patches kept before each one, and before the end.
        let mut new_of_patch = vec![0];
        for &out in is_out {
            new_of_patch.push(new_of_patch[new_of_patch.len() - 1] + u32::from(!out));
        }
        let new = |k: u32| new_of_patch[k as usize];
        for body in &mut self.bodies {
            body.patches = new(body.patches.start)..new(body.patches.end);
        }
        let mut new_of_body = vec![BodyId(0); self.bodies.len()];
        let mut kept = 0;
        for (id, body) in new_of_body.iter_mut().zip(&self.bodies) {
            *id = BodyId(kept);
            kept += u32::from(!body.patches.is_empty());
        }
        self.bodies.retain(|body| !body.patches.is_empty());
        let mut number = 0..;
        self.surfaces.retain(|_| number.next().is_some_and(&stays));
        for surface in &mut self.surfaces {
            surface.body = new_of_body[surface.body.0 as usize];
        }
        let mut out = is_out.iter();
        self.patches.retain(|_| !*out.next().unwrap_or(&false));
        for patch in &mut self.patches {
            patch.surface = new_of_surface[patch.surface.0 as usize];
            patch.body = new_of_body[patch.body.0 as usize];
            patch.twin = patch.twin.map(|twin| PatchId(new(twin.0)));
        }
    }

    /// The scene's extent at the start, or what it would be if all were present.
    fn extent_m(&self, motion: &Motion) -> Option<f64> {
        let points = self.bodies.iter().flat_map(|body| self.points_at_start(body, motion));
        let bounds = Aabb::of(points);
        (!bounds.is_empty()).then(|| bounds.diagonal())
    }

    /// Corners of a body's patches in the world at time 0.
    fn points_at_start<'a>(
        &'a self,
        body: &'a Body,
        motion: &Motion,
    ) -> impl Iterator<Item = DVec3> + 'a {
        let moves = motion.moves(body.node);
        let pose = if moves { motion.pose(body.node, 0.0) } else { None };
        let pose = pose.unwrap_or(Pose::IDENTITY);
        let range = body.patches.start as usize..body.patches.end as usize;
        self.patches[range].iter().flat_map(Patch::corners_in_body).map(move |p| pose.point(p))
    }

    /// The error where nothing is as large as a millionth of the scene, since its bodies are so far apart.
    fn all_specks(&self, extent_m: f64, motion: &Motion) -> SceneError {
        let place = |body: &Body| self.points_at_start(body, motion).next().unwrap_or(DVec3::ZERO);
        let first = place(&self.bodies[0]);
        let distance_m = |body: &Body| place(body).distance(first);
        let furthest = self.bodies.iter().max_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        let apart = match furthest {
            Some(body) if distance_m(body) > 0.0 => format!(
                ": `{}` and `{}` are {:.3e} m apart",
                self.bodies[0].name,
                body.name,
                distance_m(body)
            ),
            _ => String::new(),
        };
        SceneError::Geometry {
            subject: format!("surface `{}`", self.surfaces[0].name),
            what: format!(
                "it and all others are smaller or thinner than a millionth of the scene, which is {extent_m:.3e} m large{apart}"
            ),
            remedy: "move what stands far out near the rest, or leave it out".into(),
        }
    }

    fn add_patch(
        &mut self,
        (body, surface, material, tint, print): Of,
        double_sided: bool,
        frame: Frame,
        corners: Vec<DVec2>,
    ) {
        let front = PatchId(self.patches.len() as u32);
        let back = PatchId(front.0 + 1);
        let (behind, behind_corners) = seen_from_behind(&frame, &corners);
        let twin = double_sided.then_some(back);
        self.patches.push(Patch {
            body,
            surface,
            material,
            tint,
            print: print.clone(),
            frame,
            corners,
            twin,
        });
        if double_sided {
            let twin = Some(front);
            self.patches.push(Patch {
                body,
                surface,
                material,
                tint,
                print,
                frame: behind,
                corners: behind_corners,
                twin,
            });
        }
    }
}

/// The surface's own name, or one made of its object's and, among several, its material's.
fn surface_name(object: &DraftNode, surface: &DraftSurface, materials: &[Material]) -> String {
    match &surface.name {
        Some(name) => name.clone(),
        None if object.surfaces.len() == 1 => object.name.clone(),
        None => format!("{}/{}", object.name, materials[surface.material.0 as usize].name),
    }
}

/// The loop as one polygon, or as triangles where an uneven scale made it leave its plane by more
/// than rounding.
fn flat_pieces(points: &[DVec3]) -> Vec<Result<(Frame, Vec<DVec2>), Flaw>> {
    match flatten(points) {
        Err(Flaw::NonPlanar | Flaw::NotConvex) => {
            (1..points.len() - 1).map(|i| flatten(&[points[0], points[i], points[i + 1]])).collect()
        }
        one => vec![one],
    }
}

/// The nodes that carry a body, those declared as bodies first, then in node order, each with the nodes whose surfaces it
/// groups.
fn bodies_of(draft: &Draft, motion: &Motion) -> Vec<(usize, Vec<usize>)> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); draft.nodes.len()];
    for (index, node) in draft.nodes.iter().enumerate() {
        if !node.surfaces.is_empty() {
            let carrier = motion.anchor(NodeId(index as u32)).map_or(index, |a| a.0 as usize);
            members[carrier].push(index);
        }
    }
    let mut bodies: Vec<(usize, Vec<usize>)> =
        members.into_iter().enumerate().filter(|(_, m)| !m.is_empty()).collect();
    bodies.sort_by_key(|&(node, _)| draft.nodes[node].body.unwrap_or(u32::MAX));
    bodies
}

/// Bodies that were declared have the numbers that were given out for them.
fn check_declared(draft: &Draft, bodies: &[Body]) -> Result<(), SceneError> {
    let declared = draft.nodes.iter().enumerate().filter_map(|(k, n)| Some((k, n, n.body?)));
    for (k, node, number) in declared {
        if bodies.get(number as usize).is_none_or(|body| body.node.0 as usize != k) {
            return Err(SceneError::Geometry {
                subject: format!("body `{}`", node.name),
                what: "it has no polygons, or none of any size".into(),
                remedy: "give it a mesh that is not flat to a line, in metres".into(),
            });
        }
    }
    Ok(())
}

/// Where a node sits in the frame of the body it rides on: in the world, if it never moves.
fn pose_in_body(motion: &Motion, node: usize) -> Pose {
    let still = motion.upward(NodeId(node as u32)).take_while(|n| !n.animated());
    still.fold(Pose::IDENTITY, |pose, n| n.local_pose(0.0) * pose)
}

/// The time of the last key, whether anything still changes there or not: a clip lasts as long as its file says.
fn duration_s(draft: &Draft) -> f64 {
    let last = |n: &DraftNode| {
        let translation = n.translation_track.as_ref().and_then(|t| t.times_s.last().copied());
        let rotation = n.rotation_track.as_ref().and_then(|t| t.times_s.last().copied());
        let presence = n.presence.last().map(|k| k.0);
        [translation, rotation, presence].into_iter().flatten().fold(0.0, f64::max)
    };
    let glowing = glows(draft).map(|(_, glow)| glow.end_s());
    // Keys of files begin to count a little before their time: the end is told of its own.
    match draft.end_s {
        0.0 => glowing.chain(draft.nodes.iter().map(last)).fold(0.0, f64::max),
        end_s => end_s,
    }
}

/// All emissions that change, with what they are of.
fn glows(draft: &Draft) -> impl Iterator<Item = (String, &Glow)> {
    let materials = draft.materials.iter().map(|m| (format!("of material {}", m.name), &m.glow));
    let lights = draft.lights.iter().map(|l| (format!("of light {}", l.name), &l.glow));
    materials.chain(lights).filter_map(|(of, glow)| Some((of, glow.as_ref()?)))
}

/// By how much baked keys may swing below nothing, where they count as that.
const OVERSHOT: f64 = 1e-6;

/// Keys in order, values finite and not negative.
fn check_glows(draft: &Draft) -> Result<(), SceneError> {
    for (of, glow) in glows(draft) {
        let finite = glow.scale.iter().all(|s| s.is_finite() && *s >= 0.0);
        for track in &glow.tracks {
            check_track(&of, &track.times_s, track.values.len(), track.interpolation)?;
            let cubic = track.interpolation == Interpolation::CubicSpline;
            let is_good = |(k, v): (usize, &DVec3)| {
                v.is_finite() && (v.min_element() >= -OVERSHOT || (cubic && k % 3 != 1))
            };
            if let Some(bad) = (0..).zip(&track.values).find(|&key| !(finite && is_good(key))) {
                let at_s = track.times_s[bad.0 / if cubic { 3 } else { 1 }];
                return Err(SceneError::Animation {
                    animation: of,
                    what: format!("the emission at {at_s} s has the value {}", bad.1),
                    remedy: "choose finite values of 0 or more".into(),
                });
            }
        }
        if glow.most().iter().any(|&m| m.is_nan() || m > EMISSION_MAX) {
            return Err(SceneError::Animation {
                animation: of,
                what: format!("the emission grows beyond {EMISSION_MAX:e}"),
                remedy: "choose smaller values".into(),
            });
        }
    }
    Ok(())
}

/// What is stated without a time is stated of time 0; what is too little to count is none, with a note.
fn start_glows(draft: &mut Draft, notes: &mut Vec<Note>) {
    let mut start = |name: &str, of: &mut [f64; 3]| {
        let counts = emission(*of);
        if counts == [0.0; 3] && *of != counts {
            notes.push(dim_note(name));
        }
        *of = counts;
    };
    for material in &mut draft.materials {
        material.exitance = material.exitance_at(0.0);
        start(&material.name, &mut material.exitance);
    }
    for light in &mut draft.lights {
        light.intensity = light.intensity_at(0.0);
        start(&light.name, &mut light.intensity);
    }
}

/// Makes names unique within their kind.
fn unique_names(draft: &mut Draft, notes: &mut Vec<Note>) {
    fn each<'a>(kind: &str, names: impl Iterator<Item = &'a mut String>, notes: &mut Vec<Note>) {
        let mut unique = Names::default();
        for name in names {
            *name = unique.unique(name);
        }
        notes.extend(unique.notes(kind));
    }
    each("node", draft.nodes.iter_mut().map(|n| &mut n.name), notes);
    each("material", draft.materials.iter_mut().map(|m| &mut m.name), notes);
    each("light", draft.lights.iter_mut().map(|l| &mut l.name), notes);
    each("camera", draft.cameras.iter_mut().map(|c| &mut c.name), notes);
}

/// Lights and cameras below a scale that mirrors or bends the direction they look in: the scale is
/// taken out of rigid motion, so they look where the node's rotation says.
fn misdirected(draft: &Draft, residuals: &[DMat3]) -> Vec<Note> {
    let lights = draft.lights.iter().map(|l| (l.node, &l.name));
    let hanging = lights.chain(draft.cameras.iter().map(|c| (c.node, &c.name)));
    let bent = |node: NodeId| {
        let axis = residuals[node.0 as usize].z_axis;
        axis.z <= 0.0 || axis.truncate().length() > 1e-6 * axis.z
    };
    let bent = hanging.filter(|(node, _)| bent(*node));
    let message = "a scale above it mirrors or bends its direction; the scale is ignored for it: \
                   apply the scale before export";
    bent.map(|(_, name)| Note {
        severity: Severity::Warning,
        code: "direction",
        subject: name.clone(),
        count: 1,
        message: message.to_owned(),
    })
    .collect()
}

/// Reflectance in [0, 1), exitance finite and not negative.
fn check_materials(materials: &[Material]) -> Result<(), SceneError> {
    for material in materials {
        let fail = |what: String, remedy: &str| {
            Err(SceneError::Material {
                material: material.name.clone(),
                what,
                remedy: remedy.to_owned(),
            })
        };
        if let Some(bad) = material.reflectance.iter().find(|r| !(**r >= 0.0 && (**r as f32) < 1.0))
        {
            return fail(
                format!("its reflectance is {bad}"),
                "choose each channel from 0 up to, but not including, 1",
            );
        }
        if let Some(bad) = material.exitance.iter().find(|m| !(0.0..=EMISSION_MAX).contains(*m)) {
            return fail(
                format!("its exitance is {bad:e} W/m2"),
                &format!("choose values from 0 to {EMISSION_MAX:e}"),
            );
        }
    }
    Ok(())
}

/// Intensities from 0 to what can be computed with.
fn check_lights(draft: &Draft) -> Result<(), SceneError> {
    for light in &draft.lights {
        if let Some(bad) = light.intensity.iter().find(|m| !(0.0..=EMISSION_MAX).contains(*m)) {
            return Err(SceneError::Geometry {
                subject: format!("light `{}`", light.name),
                what: format!("its intensity is {bad:e}"),
                remedy: format!("choose values from 0 to {EMISSION_MAX:e}"),
            });
        }
    }
    Ok(())
}

fn held_note(node: &str) -> Note {
    Note {
        severity: Severity::Warning,
        code: "held-shape",
        subject: node.to_owned(),
        count: 1,
        message: "it rotates below a parent of non-uniform scale, which would shear it in time: it keeps its shape \
                  at the start; apply the parent's scale to its mesh"
            .into(),
    }
}

fn degenerate_note(surface: &str, count: usize) -> Note {
    Note {
        severity: Severity::Info,
        code: "degenerate",
        subject: surface.to_owned(),
        count,
        message: format!("{count} polygons without area were left out"),
    }
}

fn dim_note(name: &str) -> Note {
    let message = format!(
        "what it emits is below {EMISSION_MIN:e} W/m2 (a light: W/sr) and counts as nothing"
    );
    Note {
        severity: Severity::Warning,
        code: "too-dim",
        subject: name.to_owned(),
        count: 1,
        message,
    }
}

fn speck_note(surface: &str, count: usize, whole: bool) -> Note {
    let of_it = if whole { "all of it was" } else { "they were" };
    Note {
        severity: if whole { Severity::Warning } else { Severity::Info },
        code: "speck",
        subject: surface.to_owned(),
        count,
        message: format!(
            "{count} polygons are smaller or thinner than a millionth of the scene; {of_it} left out: scale it, or what is around it"
        ),
    }
}

fn no_place(surface: &str, object: &str, at: DVec3) -> SceneError {
    let what = match at.is_finite() {
        false => "a vertex has a coordinate that is not finite".to_owned(),
        true => format!(
            "a vertex is at ({:e}, {:e}, {:e}) m, further out than {COORDINATE_MAX_M:e} m",
            at.x, at.y, at.z
        ),
    };
    SceneError::Geometry {
        subject: format!("surface `{surface}` of node `{object}`"),
        what,
        remedy: "repair the mesh or the scales above it and export it again".into(),
    }
}

fn empty(draft: &Draft) -> SceneError {
    let with_mesh = draft.nodes.iter().filter(|n| !n.surfaces.is_empty()).count();
    let what = match (draft.nodes.len(), with_mesh) {
        (0, _) => "there are no nodes".to_owned(),
        (n, 0) => format!("none of its {n} nodes has a mesh of triangles"),
        (_, m) => format!("the meshes of its {m} nodes have no area"),
    };
    let remedy = "export the objects' meshes as triangles, visible and in the active scene".into();
    SceneError::Empty { scene: draft.name.clone(), what, remedy }
}
