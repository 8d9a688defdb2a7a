//! Scenes made in code: for tests, for the demonstration scenes, and for users with geometry of
//! their own.
//!
//! Must not know how a scene is checked and grouped; that is `assemble`'s.

use glam::{DMat3, DQuat, DVec3};

use super::assemble::assemble;
use super::draft::{Draft, DraftNode, DraftSurface};
use super::flatten::{Flaw, flatten};
use super::limits::is_place;
use super::merge::merge;
use super::{
    BodyId, Camera, Glow, Light, LightKind, Material, MaterialId, NodeId, Projection,
    RotationTrack, Scene, SceneError, Track,
};

/// Builds a [`Scene`] from code, checked as a file would be.
///
/// Mistakes (a polygon that is not planar and convex, an id of another builder) are kept and
/// returned by [`SceneBuilder::build`], the first one first.
///
/// ```
/// # use glam::{DQuat, DVec3};
/// # use relume_core::scene::SceneBuilder;
/// let mut b = SceneBuilder::new("furnace");
/// let wall = b.material("wall", [0.5; 3], [1.0; 3]);
/// let room = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
/// b.cuboid_inward(room, "walls", wall, DVec3::ZERO, DVec3::ONE);
/// let scene = b.build()?;
/// assert_eq!(scene.patches.len(), 6);
/// # Ok::<(), relume_core::scene::SceneError>(())
/// ```
pub struct SceneBuilder {
    draft: Draft,
    mistake: Option<SceneError>,
}

impl SceneBuilder {
    /// An empty scene of this name.
    pub fn new(name: &str) -> SceneBuilder {
        SceneBuilder { draft: Draft { name: name.to_owned(), ..Draft::default() }, mistake: None }
    }

    /// Adds a single-sided material: reflectance in [0, 1) and exitance in W/m2, linear RGB.
    pub fn material(
        &mut self,
        name: &str,
        reflectance: [f64; 3],
        exitance: [f64; 3],
    ) -> MaterialId {
        self.add_material(Material {
            name: name.to_owned(),
            reflectance,
            exitance,
            glow: None,
            double_sided: false,
        })
    }

    /// Adds a material whose polygons reflect and emit on both sides.
    pub fn double_sided_material(
        &mut self,
        name: &str,
        reflectance: [f64; 3],
        exitance: [f64; 3],
    ) -> MaterialId {
        self.add_material(Material {
            name: name.to_owned(),
            reflectance,
            exitance,
            glow: None,
            double_sided: true,
        })
    }

    fn add_material(&mut self, material: Material) -> MaterialId {
        self.draft.materials.push(material);
        MaterialId(self.draft.materials.len() as u32 - 1)
    }

    /// Adds a node placed relative to its parent (to the world without one).
    pub fn node(
        &mut self,
        name: &str,
        parent: Option<NodeId>,
        translation: DVec3,
        rotation: DQuat,
    ) -> NodeId {
        if let Some(parent) = parent {
            self.check_node(parent, name);
        }
        let parent = parent.map(|p| p.0 as usize).filter(|&p| p < self.draft.nodes.len());
        self.draft.nodes.push(DraftNode::still(name, parent, translation, rotation));
        NodeId(self.draft.nodes.len() as u32 - 1)
    }

    /// Adds a body at the origin of the world: to be moved by commands, if at all. Its id is the one that it has in the scene.
    pub fn body(&mut self, name: &str) -> BodyId {
        let number = self.draft.nodes.iter().filter(|n| n.body.is_some()).count() as u32;
        let mut node = DraftNode::still(name, None, DVec3::ZERO, DQuat::IDENTITY);
        node.body = Some(number);
        self.draft.nodes.push(node);
        BodyId(number)
    }

    /// Adds a mesh to a body: positions in the body's frame, metres, and triangles as indices into them,
    /// counter-clockwise seen from the front. Neighbouring triangles in one plane become one polygon; triangles without
    /// area are left out.
    ///
    /// Meshes of one body, surface name and material form one surface.
    pub fn mesh(
        &mut self,
        body: BodyId,
        surface_name: &str,
        material: MaterialId,
        positions: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) {
        let Some(node) = self.draft.nodes.iter().position(|n| n.body == Some(body.0)) else {
            return self.fail(SceneError::Hierarchy {
                node: format!("body {}", body.0),
                what: format!("it does not exist, but surface `{surface_name}` is to be on it"),
                remedy: "use a body of the same builder".into(),
            });
        };
        match polygons_of(surface_name, positions, triangles) {
            Ok(polygons) => {
                for polygon in polygons {
                    self.polygon(NodeId(node as u32), surface_name, material, &polygon);
                }
            }
            Err(flaw) => self.fail(flaw),
        }
    }

    /// Scales what hangs on a node, along the node's own axes; constant in time. A product of
    /// negative sign mirrors; fronts stay fronts.
    pub fn scale(&mut self, node: NodeId, scale: DVec3) {
        self.change(node, |n| n.shape = DMat3::from_diagonal(scale));
    }

    /// Animates the translation of a node.
    pub fn animate_translation(&mut self, node: NodeId, track: Track) {
        self.change(node, |n| n.translation_track = Some(track));
    }

    /// Animates the rotation of a node.
    pub fn animate_rotation(&mut self, node: NodeId, track: RotationTrack) {
        self.change(node, |n| n.rotation_track = Some(track));
    }

    /// Makes a node and all below it come and go: present or not from each time (seconds) on;
    /// before the first key as the first key says.
    pub fn animate_presence(&mut self, node: NodeId, keys: Vec<(f64, bool)>) {
        self.change(node, |n| n.presence = keys);
    }

    /// Animates the exitance of a material, W/m2, linear RGB.
    pub fn animate_exitance(&mut self, material: MaterialId, track: Track) {
        match self.draft.materials.get_mut(material.0 as usize) {
            Some(m) => m.glow = Some(Glow { scale: [1.0; 3], tracks: vec![track] }),
            None => self.fail(no_material(material, "an animation")),
        }
    }

    /// Animates the intensity of the punctual lights of this name, in the unit that they have.
    pub fn animate_intensity(&mut self, light: &str, track: Track) {
        let glow = Glow { scale: [1.0; 3], tracks: vec![track] };
        let mut named = self.draft.lights.iter_mut().filter(|l| l.name == light).peekable();
        if named.peek().is_none() {
            return self.fail(SceneError::Geometry {
                subject: format!("light `{light}`"),
                what: "it does not exist, but is to be animated".into(),
                remedy: "add the light first".into(),
            });
        }
        named.for_each(|l| l.glow = Some(glow.clone()));
    }

    /// Adds a convex planar polygon, corners in the node's frame, counter-clockwise seen from its
    /// front. Polygons of one node, surface name and material form one surface.
    pub fn polygon(
        &mut self,
        node: NodeId,
        surface_name: &str,
        material: MaterialId,
        corners: &[DVec3],
    ) {
        if let Some(flaw) = flaw_of(corners) {
            self.fail(SceneError::Geometry {
                subject: format!("a polygon of surface `{surface_name}`"),
                what: flaw.to_owned(),
                remedy: "give three or more finite corners of a planar convex polygon".into(),
            });
        }
        if self.draft.materials.len() <= material.0 as usize {
            self.fail(no_material(material, &format!("surface `{surface_name}`")));
        }
        let polygon = corners.to_vec();
        self.change(node, |n| {
            match n
                .surfaces
                .iter_mut()
                .find(|s| s.name.as_deref() == Some(surface_name) && s.material == material)
            {
                Some(surface) => surface.polygons.push(polygon),
                None => n.surfaces.push(DraftSurface {
                    name: Some(surface_name.to_owned()),
                    material,
                    polygons: vec![polygon],
                    tints: Vec::new(),
                    prints: Vec::new(),
                }),
            }
        });
    }

    /// Adds the six sides of a box, seen from outside; order -x, +x, -y, +y, -z, +z.
    pub fn cuboid(
        &mut self,
        node: NodeId,
        surface_name: &str,
        material: MaterialId,
        min: DVec3,
        max: DVec3,
    ) {
        for side in cuboid_sides(min, max) {
            self.polygon(node, surface_name, material, &side);
        }
    }

    /// Adds the six sides of a box, seen from inside (a room); order -x, +x, -y, +y, -z, +z.
    pub fn cuboid_inward(
        &mut self,
        node: NodeId,
        surface_name: &str,
        material: MaterialId,
        min: DVec3,
        max: DVec3,
    ) {
        for mut side in cuboid_sides(min, max) {
            side.reverse();
            self.polygon(node, surface_name, material, &side);
        }
    }

    /// Adds a punctual light that shines along the node's -Z: W/sr, or W/m2 if directional.
    pub fn light(&mut self, name: &str, node: NodeId, kind: LightKind, intensity: [f64; 3]) {
        self.check_node(node, name);
        if intensity.iter().any(|i| !i.is_finite() || *i < 0.0) {
            self.fail(SceneError::Geometry {
                subject: format!("light `{name}`"),
                what: format!("its intensity is {intensity:?}"),
                remedy: "give finite values of 0 or more".into(),
            });
        }
        let conversion = "given in radiometric units, not converted".into();
        let name = name.to_owned();
        self.draft.lights.push(Light { name, node, kind, intensity, glow: None, conversion });
    }

    /// Adds a camera that looks along the node's -Z, +Y up.
    pub fn camera(&mut self, name: &str, node: NodeId, projection: Projection) {
        self.check_node(node, name);
        self.draft.cameras.push(Camera { name: name.to_owned(), node, projection });
    }

    /// Checks everything and makes the scene.
    pub fn build(self) -> Result<Scene, SceneError> {
        match self.mistake {
            Some(mistake) => Err(mistake),
            None => assemble(self.draft),
        }
    }

    fn change(&mut self, node: NodeId, change: impl FnOnce(&mut DraftNode)) {
        match self.draft.nodes.get_mut(node.0 as usize) {
            Some(n) => change(n),
            None => self.check_node(node, "what hangs on it"),
        }
    }

    fn check_node(&mut self, node: NodeId, wanted_by: &str) {
        if node.0 as usize >= self.draft.nodes.len() {
            self.fail(SceneError::Hierarchy {
                node: format!("{}", node.0),
                what: format!("it does not exist, but {wanted_by} refers to it"),
                remedy: "use a node of the same builder".into(),
            });
        }
    }

    fn fail(&mut self, mistake: SceneError) {
        self.mistake.get_or_insert(mistake);
    }
}

/// The convex polygons of a mesh.
fn polygons_of(
    surface_name: &str,
    positions: &[[f64; 3]],
    triangles: &[[u32; 3]],
) -> Result<Vec<Vec<DVec3>>, SceneError> {
    let fail = |what: String, remedy: &str| {
        let subject = format!("a mesh of surface `{surface_name}`");
        Err(SceneError::Geometry { subject, what, remedy: remedy.to_owned() })
    };
    if let Some(k) = positions.iter().position(|p| !is_place(p)) {
        return fail(
            format!("position {k} is {:?}", positions[k]),
            "give finite numbers, in metres",
        );
    }
    let count = positions.len();
    if let Some(k) = triangles.iter().position(|t| t.iter().any(|&i| i as usize >= count)) {
        let what = format!("triangle {k} is {:?}, but there are {count} positions", triangles[k]);
        return fail(what, "count positions from 0");
    }
    let points: Vec<DVec3> = positions.iter().map(|&p| DVec3::from_array(p)).collect();
    let merged = merge(&points, triangles);
    if merged.polygons.is_empty() {
        return fail("it has no triangle with an area".into(), "give triangles with an area");
    }
    Ok(merged.polygons)
}

fn no_material(material: MaterialId, subject: &str) -> SceneError {
    SceneError::Geometry {
        subject: subject.to_owned(),
        what: format!("material {} does not exist", material.0),
        remedy: "use a material of the same builder; for a body to be inserted, one of the session's scene".into(),
    }
}

/// What is wrong with a polygon, in words.
fn flaw_of(corners: &[DVec3]) -> Option<&'static str> {
    if corners.iter().any(|c| !c.is_finite()) {
        return Some("a corner is not finite");
    }
    match flatten(corners).err()? {
        Flaw::Degenerate => Some("it has no area"),
        Flaw::NonPlanar => Some("its corners are not in one plane"),
        Flaw::NotConvex => Some("it is not convex"),
    }
}

/// The sides of a box, counter-clockwise seen from outside.
pub(super) fn cuboid_sides(min: DVec3, max: DVec3) -> [[DVec3; 4]; 6] {
    let corner = |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { max[axis] } else { min[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let side = |bits: [usize; 4]| bits.map(corner);
    [
        side([0, 4, 6, 2]),
        side([1, 3, 7, 5]),
        side([0, 1, 5, 4]),
        side([2, 6, 7, 3]),
        side([0, 2, 3, 1]),
        side([4, 5, 7, 6]),
    ]
}

#[cfg(test)]
mod tests;
