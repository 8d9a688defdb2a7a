//! A lamp that is in no file, for scenes that no light gets into. Must not know why one is wanted.

use glam::{DQuat, DVec3};

use super::names::Names;
use super::{Light, LightKind, Node, NodeId, Scene};

impl Scene {
    /// The same scene with a point light at rest, at a place in the world (metres), of this radiant intensity (W/sr, linear
    /// RGB).
    pub fn with_point_light(&self, at: DVec3, intensity: [f64; 3]) -> Scene {
        let mut scene = self.clone();
        let mut names = Names::default();
        for node in &scene.motion.nodes {
            names.unique(&node.name);
        }
        for light in &scene.lights {
            names.unique(&light.name);
        }
        let name = names.unique("lamp");
        scene.motion.nodes.push(Node {
            name: name.clone(),
            parent: None,
            translation: at,
            rotation: DQuat::IDENTITY,
            translation_track: None,
            rotation_track: None,
            presence: Vec::new(),
        });
        let node = NodeId(scene.motion.nodes.len() as u32 - 1);
        let conversion = "in no file".to_owned();
        let kind = LightKind::Point;
        scene.lights.push(Light { name, node, kind, intensity, glow: None, conversion });
        scene
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::SceneBuilder;

    use super::*;

    #[test]
    fn a_lamp_is_where_it_is_put_under_a_name_of_its_own() {
        let mut b = SceneBuilder::new("s");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let n = b.node("lamp", None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid(n, "box", grey, DVec3::ZERO, DVec3::ONE);
        let scene = b.build().unwrap();
        let at = DVec3::new(1.0, 2.0, 3.0);
        let lit = scene.with_point_light(at, [1.0, 2.0, 3.0]);
        assert!(!scene.emits() && lit.emits());
        let light = &lit.lights[0];
        assert_eq!((light.name.as_str(), light.intensity), ("lamp 2", [1.0, 2.0, 3.0]));
        assert_eq!(lit.motion.pose(light.node, 0.5).unwrap().translation, at);
    }
}
