//! What a user calls the elements of a scene.

use std::fmt;
use std::ops::Range;

use crate::element::{ElementKey, Forest};
use crate::scene::Scene;

/// An element or a punctual light as a user knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ElementName {
    /// A punctual light.
    Light(String),
    /// A group of patches.
    Group {
        /// How many facets it has.
        facets: u32,
        /// The first of them.
        first: Box<ElementName>,
    },
    /// An element of a patch.
    Element {
        /// Its body.
        body: String,
        /// Its surface.
        surface: String,
        /// Number of its patch within the surface from 1, where there are several.
        patch: Option<u32>,
        /// Number of its facet within the patch from 1, where there are several (a polygon of more
        /// than four corners).
        facet: Option<u32>,
        /// Which child at each level below the facet, from 0; empty for the facet itself.
        path: Vec<u8>,
    },
}

/// The name of an element or light by its key.
pub(super) fn name_of(scene: &Scene, forest: &Forest, key: ElementKey) -> ElementName {
    let facet = forest.named(key.facet);
    if let Some(group) = forest.group(facet) {
        let leaves = forest.groups().leaves_of(group);
        let first = name_of(scene, forest, forest.key(leaves[0].facet));
        return ElementName::Group { facets: leaves.len() as u32, first: Box::new(first) };
    }
    let Some(id) = forest.patch(facet) else {
        let light = forest.light(facet).expect("links end on elements and lights");
        return ElementName::Light(scene.lights[light].name.clone());
    };
    let patch = &scene.patches[id.0 as usize];
    let body = &scene.bodies[patch.body.0 as usize];
    let siblings =
        |range: Range<u32>| range.filter(|&p| scene.patches[p as usize].surface == patch.surface);
    let facets: Vec<_> = forest.facets().iter().filter(|&&f| forest.patch(f) == Some(id)).collect();
    let several = |count: usize, before: usize| (count > 1).then_some(before as u32 + 1);
    ElementName::Element {
        body: body.name.clone(),
        surface: scene.surfaces[patch.surface.0 as usize].name.clone(),
        patch: several(
            siblings(body.patches.clone()).count(),
            siblings(body.patches.start..id.0).count(),
        ),
        facet: several(facets.len(), facets.iter().take_while(|&&&f| f < facet).count()),
        path: steps(key.path),
    }
}

/// A path's steps: below its leading one bit, two bits a level.
fn steps(path: u32) -> Vec<u8> {
    let levels = (31 - path.leading_zeros().min(31)) / 2;
    (0..levels).rev().map(|level| (path >> (2 * level) & 3) as u8).collect()
}

impl ElementName {
    /// The element at a path below this facet.
    pub(crate) fn at(&self, below: u32) -> ElementName {
        let mut out = self.clone();
        if let ElementName::Element { path, .. } = &mut out {
            *path = steps(below);
        }
        out
    }

    /// The name in one short word, for tables: `surface`, with `#patch` and `/facet` where there are
    /// several, and `:0.2.3` for the children taken from the facet downwards.
    pub fn short(&self) -> String {
        match self {
            ElementName::Light(name) => name.clone(),
            ElementName::Group { facets, first } => format!("{}+{}", first.short(), facets - 1),
            ElementName::Element { surface, patch, facet, path, .. } => {
                let mut out = surface.clone();
                for (mark, number) in [('#', patch), ('/', facet)] {
                    if let Some(number) = number {
                        out += &format!("{mark}{number}");
                    }
                }
                let steps: Vec<String> = path.iter().map(ToString::to_string).collect();
                if steps.is_empty() { out } else { out + ":" + &steps.join(".") }
            }
        }
    }
}

impl fmt::Display for ElementName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (body, surface, patch, facet, path) = match self {
            ElementName::Light(name) => return write!(f, "light `{name}`"),
            ElementName::Group { facets, first } => {
                return write!(f, "group of {facets} facets from {first} on");
            }
            ElementName::Element { body, surface, patch, facet, path } => {
                (body, surface, patch, facet, path)
            }
        };
        write!(f, "surface `{surface}` of body `{body}`")?;
        for (what, number) in [("patch", patch), ("facet", facet)] {
            if let Some(number) = number {
                write!(f, ", {what} {number}")?;
            }
        }
        let steps: Vec<String> = path.iter().map(ToString::to_string).collect();
        match steps.is_empty() {
            true => f.write_str(", undivided"),
            false => write!(f, ", element {}", steps.join(".")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_read_from_the_top() {
        assert!(steps(1).is_empty());
        assert_eq!(steps(0b1_00), [0]);
        assert_eq!(steps(0b1_00_11_01), [0, 3, 1]);
    }
}
