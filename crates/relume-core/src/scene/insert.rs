//! Bodies that come into a scene or leave it after it was made.
//!
//! Ids of other bodies, surfaces and materials stay; patches are numbered anew. What was taken out can be put back,
//! and the scene is then as before. Must not know who changes a scene, or what is solved on it.

use super::builder::SceneBuilder;
use super::{
    Body, BodyId, Frame, Material, MaterialId, Node, NodeId, Patch, PatchId, Scene, SceneError,
    Surface, SurfaceId,
};

/// A body to be inserted into a scene: meshes with materials of that scene.
#[derive(Clone, Debug, PartialEq)]
pub struct NewBody {
    name: String,
    meshes: Vec<NewMesh>,
}

/// Mesh of a [`NewBody`].
#[derive(Clone, Debug, PartialEq)]
pub struct NewMesh {
    /// Name of the surface.
    pub surface: String,
    /// A material of the scene.
    pub material: MaterialId,
    /// Corners in the body's frame, metres.
    pub positions: Vec<[f64; 3]>,
    /// Three indices into the positions each.
    pub triangles: Vec<[u32; 3]>,
}

/// A body that was taken out of a scene, to be put back.
#[derive(Clone, Debug)]
pub struct TakenBody(Taken);

#[derive(Clone, Debug)]
enum Taken {
    /// One that the scene was made with: it stays in it, absent.
    Made,
    /// One that was inserted.
    Inserted(Box<Inserted>),
}

#[derive(Clone, Debug)]
struct Inserted {
    body: Body,
    /// Twins counted from the body's first patch.
    patches: Vec<Patch>,
    /// Where it was the last body: what else went with it.
    ends: Option<Ends>,
}

#[derive(Clone, Debug)]
struct Ends {
    /// Number of the first surface.
    first: u32,
    surfaces: Vec<Surface>,
    node: Option<Node>,
}

impl NewBody {
    /// A body without polygons.
    pub fn new(name: &str) -> NewBody {
        NewBody { name: name.to_owned(), meshes: Vec::new() }
    }

    /// Its name; in a scene in which the name is taken, a number is added.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its meshes.
    pub fn meshes(&self) -> &[NewMesh] {
        &self.meshes
    }

    /// Adds a mesh: positions in the body's frame, metres, triangles counter-clockwise seen from the front, a material of the
    /// scene that it will be inserted into. See [`SceneBuilder::mesh`].
    pub fn with_mesh(
        mut self,
        surface_name: &str,
        material: MaterialId,
        positions: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) -> NewBody {
        self.meshes.push(NewMesh {
            surface: surface_name.to_owned(),
            material,
            positions: positions.to_vec(),
            triangles: triangles.to_vec(),
        });
        self
    }
}

impl Scene {
    /// The body of this name.
    pub fn body_named(&self, name: &str) -> Option<BodyId> {
        let mut ids = (0..self.bodies.len() as u32).map(BodyId);
        ids.find(|&id| self.bodies[id.0 as usize].name == name && self.has_body(id))
    }

    /// The same scene with one body more, at the origin of the world (of the file: [`Scene::origin`]), and the id of that body.
    ///
    /// # Errors
    /// What [`SceneBuilder::build`] would say of the body.
    pub(crate) fn with_body(&self, new: &NewBody) -> Result<(Scene, BodyId), SceneError> {
        if new.meshes.is_empty() {
            return Err(SceneError::Geometry {
                subject: format!("body `{}`", new.name),
                what: "it has no mesh".into(),
                remedy: "give it one by `NewBody::with_mesh`".into(),
            });
        }
        let mut alone = SceneBuilder::new(&self.name);
        for Material { name, reflectance, exitance, double_sided, .. } in &self.materials {
            if *double_sided {
                alone.double_sided_material(name, *reflectance, *exitance);
            } else {
                alone.material(name, *reflectance, *exitance);
            }
        }
        let body = alone.body(&new.name);
        for mesh in &new.meshes {
            alone.mesh(body, &mesh.surface, mesh.material, &mesh.positions, &mesh.triangles);
        }
        let alone = alone.build()?;
        let mut scene = self.clone();
        let id = BodyId(scene.bodies.len() as u32);
        let free = |wanted: &str, is_taken: &dyn Fn(&str) -> bool| {
            let numbered = (2u32..).map(|n| format!("{wanted} {n}"));
            let mut names = std::iter::once(wanted.to_owned()).chain(numbered);
            names.find(|name| !is_taken(name)).expect("there are more numbers than names")
        };
        let name = free(&new.name, &|name| scene.motion.nodes.iter().any(|n| n.name == name));
        let mut node = alone.motion.nodes[0].clone();
        node.name.clone_from(&name);
        scene.motion.nodes.push(node);
        let first_surface = scene.surfaces.len() as u32;
        for surface in &alone.surfaces {
            let name = free(&surface.name, &|name| scene.surfaces.iter().any(|s| s.name == name));
            let object = scene.motion.nodes[scene.motion.nodes.len() - 1].name.clone();
            scene.surfaces.push(Surface { name, object, body: id, material: surface.material });
        }
        let first = scene.patches.len() as u32;
        scene.patches.extend(alone.patches.into_iter().map(|patch| Patch {
            body: id,
            surface: SurfaceId(first_surface + patch.surface.0),
            twin: patch.twin.map(|twin| PatchId(first + twin.0)),
            frame: Frame { origin: patch.frame.origin - self.origin, ..patch.frame },
            ..patch
        }));
        scene.edited.insert(id, corners(&scene.patches[first as usize..]));
        scene.bodies.push(Body {
            name,
            node: NodeId(scene.motion.nodes.len() as u32 - 1),
            patches: first..scene.patches.len() as u32,
            distant: false,
            again: false,
        });
        Ok((scene, id))
    }

    /// The same scene without a body, and that body. One that the scene was made with stays in it, absent; the id of one that
    /// was inserted stays reserved, unless it was the last one.
    pub(crate) fn without_body(&self, id: BodyId) -> (Scene, TakenBody) {
        let mut scene = self.clone();
        if !self.is_inserted(id) {
            scene.edited.set_removed(id, true);
            return (scene, TakenBody(Taken::Made));
        }
        let range = self.bodies[id.0 as usize].patches.clone();
        let mut patches: Vec<Patch> =
            scene.patches.drain(range.start as usize..range.end as usize).collect();
        for patch in &mut patches {
            patch.twin = patch.twin.map(|twin| PatchId(twin.0 - range.start));
        }
        scene.renumber(id, range.start, -(patches.len() as i64));
        scene.bodies[id.0 as usize].patches = range.start..range.start;
        let body = self.bodies[id.0 as usize].clone();
        let mut taken = Inserted { body, patches, ends: None };
        if id.0 as usize + 1 == scene.bodies.len() {
            scene.edited.forget(id);
            scene.bodies.pop();
            let of_others = scene.surfaces.iter().rposition(|surface| surface.body != id);
            let first = of_others.map_or(0, |last| last + 1);
            let surfaces = scene.surfaces.split_off(first);
            let node = match taken.body.node.0 as usize + 1 == scene.motion.nodes.len() {
                true => scene.motion.nodes.pop(),
                false => None,
            };
            taken.ends = Some(Ends { first: first as u32, surfaces, node });
        }
        (scene, TakenBody(Taken::Inserted(Box::new(taken))))
    }

    /// Whether a body can be put back under an id: nothing is there.
    pub(crate) fn has_room_for(&self, id: BodyId, taken: &TakenBody) -> bool {
        let last = match &taken.0 {
            Taken::Made => return self.is_removed(id),
            Taken::Inserted(inserted) => inserted.ends.is_some(),
        };
        match self.bodies.get(id.0 as usize) {
            Some(body) => body.patches.is_empty() && !last && self.is_inserted(id),
            None => id.0 as usize == self.bodies.len() && last,
        }
    }

    /// The same scene with a body put back, where [`Scene::has_room_for`] it.
    pub(crate) fn with_body_back(&self, id: BodyId, taken: &TakenBody) -> Scene {
        let mut scene = self.clone();
        let Taken::Inserted(taken) = &taken.0 else {
            scene.edited.set_removed(id, false);
            return scene;
        };
        let mut body = taken.body.clone();
        let first = match scene.bodies.get(id.0 as usize) {
            Some(room) => room.patches.start,
            None => scene.patches.len() as u32,
        };
        scene.renumber(id, first, taken.patches.len() as i64);
        let mut patches = taken.patches.clone();
        for patch in &mut patches {
            patch.twin = patch.twin.map(|twin| PatchId(first + twin.0));
        }
        body.patches = first..first + patches.len() as u32;
        match &taken.ends {
            None => scene.bodies[id.0 as usize] = body,
            Some(Ends { first: was_first, surfaces, node }) => {
                let now_first = scene.surfaces.len() as u32;
                scene.surfaces.extend(surfaces.iter().cloned());
                for patch in &mut patches {
                    patch.surface.0 = patch.surface.0 - was_first + now_first;
                }
                if let Some(node) = node {
                    body.node = NodeId(scene.motion.nodes.len() as u32);
                    scene.motion.nodes.push(node.clone());
                }
                scene.edited.insert(id, corners(&patches));
                scene.bodies.push(body);
            }
        }
        scene.patches.splice(first as usize..first as usize, patches);
        scene
    }

    /// The same scene with inserted bodies of another one, taken out of it since, under new ids at the end: absent, with
    /// the names that they had, each with one surface. Returns the ids, too.
    pub(crate) fn with_remains(&self, of: &Scene, bodies: &[BodyId]) -> (Scene, Vec<BodyId>) {
        let mut scene = self.clone();
        let mut ids = Vec::new();
        for &was in bodies {
            let id = BodyId(scene.bodies.len() as u32);
            let old = &of.bodies[was.0 as usize];
            let (first, was_first) = (scene.patches.len() as u32, old.patches.start);
            // Its node and surfaces may have left with it.
            let surface = SurfaceId(scene.surfaces.len() as u32);
            let own = of.patches_of(was).next().map(|(_, patch)| patch.surface);
            let own = own.map(|own| of.surfaces[own.0 as usize].clone());
            scene.surfaces.extend(own.map(|own| Surface { body: id, ..own }));
            scene.patches.extend(of.patches_of(was).map(|(_, patch)| Patch {
                body: id,
                surface,
                twin: patch.twin.map(|twin| PatchId(twin.0 - was_first + first)),
                ..patch.clone()
            }));
            let node = NodeId(scene.motion.nodes.len() as u32);
            scene.motion.nodes.push(of.motion.nodes[old.node.0 as usize].clone());
            let patches = first..scene.patches.len() as u32;
            scene.bodies.push(Body { patches, node, ..old.clone() });
            let names = of.names_of(was).expect("it was inserted").clone();
            scene.edited.insert_named(id, names);
            scene.edited.set_removed(id, true);
            ids.push(id);
        }
        (scene, ids)
    }

    /// Numbers of patches as they are once `more` of body `id` begin at `first`, where none is now.
    fn renumber(&mut self, id: BodyId, first: u32, more: i64) {
        let moved = |k: u32| (i64::from(k) + more) as u32;
        for body in self.bodies.iter_mut().skip(id.0 as usize + 1) {
            body.patches = moved(body.patches.start)..moved(body.patches.end);
        }
        for patch in &mut self.patches {
            patch.twin = patch.twin.map(|t| if t.0 >= first { PatchId(moved(t.0)) } else { t });
        }
    }
}

/// How many corners some patches have.
fn corners(patches: &[Patch]) -> usize {
    patches.iter().map(|patch| patch.corners.len()).sum()
}
