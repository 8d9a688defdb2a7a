//! The forest as the solver sees it, and links as numbers.

use std::ops::Range;

use crate::element::{ElementId, Forest, Kind};
use crate::pair::Pair;
use crate::scene::Scene;
use crate::solver::{Link, Links, LinksBuilder, Lit, Place, Surfaces};

/// A forest with its materials.
pub(super) struct LitForest<'a> {
    forest: &'a Forest,
    patch_lit: Vec<Lit>,
    lights: Vec<Lit>,
    places: Vec<Place>,
}

impl<'a> LitForest<'a> {
    pub(super) fn new(scene: &Scene, forest: &'a Forest) -> LitForest<'a> {
        let single = |v: [f64; 3]| v.map(|x| x as f32);
        let of_patch = |patch: &crate::scene::Patch| {
            let material = &scene.materials[patch.material.0 as usize];
            Lit {
                reflectance: single(material.reflectance),
                exitance: single(material.exitance),
                counts: true,
            }
        };
        let of_light = |light: &crate::scene::Light| Lit {
            reflectance: [0.0; 3],
            exitance: single(light.intensity),
            counts: false,
        };
        LitForest {
            forest,
            patch_lit: scene.patches.iter().map(of_patch).collect(),
            lights: scene.lights.iter().map(of_light).collect(),
            places: (0..forest.len() as u32).map(|id| place_of(forest, ElementId(id))).collect(),
        }
    }
}

fn place_of(forest: &Forest, id: ElementId) -> Place {
    if forest.kind(id) != Kind::Element {
        return Place { centroid: [0.0; 2], radius: 1.0, moment: [1.0, 0.0, 1.0] };
    }
    let shape = forest.shape(id);
    let centroid = shape.centroid();
    Place {
        centroid: [centroid.x as f32, centroid.y as f32],
        radius: shape.radius() as f32,
        moment: shape.second_moment().map(|m| m as f32),
    }
}

impl Surfaces for LitForest<'_> {
    fn len(&self) -> usize {
        self.forest.len()
    }

    fn parent(&self, id: u32) -> Option<u32> {
        let parent = self.forest.parent(ElementId(id))?;
        let within = self.forest.kind(ElementId(id)) == Kind::Element
            && self.forest.kind(parent) == Kind::Element;
        within.then_some(parent.0)
    }

    fn children(&self, id: u32) -> Range<u32> {
        self.forest.children(ElementId(id))
    }

    fn area_m2(&self, id: u32) -> f64 {
        self.forest.area_m2(ElementId(id))
    }

    fn place(&self, id: u32) -> Place {
        self.places[id as usize]
    }

    fn lit(&self, id: u32) -> Option<&Lit> {
        let element = ElementId(id);
        match self.forest.kind(element) {
            Kind::Element => {
                let patch = self.forest.patch(element).expect("elements have patches");
                Some(&self.patch_lit[patch.0 as usize])
            }
            Kind::Light => self.forest.light(element).map(|k| &self.lights[k]),
            Kind::Cluster | Kind::Polygon => None,
        }
    }
}

/// Both directions of some pairs, by receiver. Pairs of visibility 0 couple nothing.
pub(super) fn links_of<'a>(
    forest: &Forest,
    pairs: impl Iterator<Item = &'a Pair> + Clone,
) -> Links {
    let carries = |p: &&Pair| p.visibility > 0.0 && p.exchange_area_m2 > 0.0;
    let receives = |id: ElementId| forest.kind(id) == Kind::Element;
    let mut builder = LinksBuilder::new(forest.len());
    for pair in pairs.clone().filter(carries) {
        for end in [pair.a, pair.b] {
            if receives(end) {
                builder.count(end.0);
            }
        }
    }
    builder.fill(|add| {
        for pair in pairs.filter(carries) {
            let exchange = pair.exchange_area_m2 * pair.visibility;
            let g = &pair.gradients;
            let ends = [(pair.a, pair.b, g.over_a, g.over_b), (pair.b, pair.a, g.over_b, g.over_a)];
            for (receiver, source, over_receiver, over_source) in ends {
                if receives(receiver) {
                    let coupling = exchange / forest.area_m2(receiver) as f32;
                    let source = source.0;
                    add(receiver.0, Link { source, coupling, over_receiver, over_source });
                }
            }
        }
    })
}
