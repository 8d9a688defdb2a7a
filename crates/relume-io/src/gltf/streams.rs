//! Which accessors' numbers are in compressed streams, noted when a file is opened.
//!
//! Must not know how streams are decoded.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use draco_core::Mesh;

use super::json;

/// The streams of a file, decoded when first asked for.
#[derive(Default)]
pub(super) struct Streams {
    /// What the numbers of an accessor are.
    pub(super) of_accessor: BTreeMap<usize, Stored>,
    /// By buffer view.
    pub(super) decoded: BTreeMap<usize, OnceCell<Mesh>>,
}

/// Where in the streams numbers are.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Stored {
    pub(super) view: usize,
    pub(super) what: Content,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Content {
    /// An attribute, by its unique id.
    Attribute(u32),
    /// Three vertices for each triangle.
    Corners,
}

impl Streams {
    /// Notes for each accessor of a compressed primitive where its numbers are. Primitives whose plain numbers are
    /// all in the file too are left as they are; the others become lists of triangles, which is what streams hold.
    pub(super) fn of(root: &mut json::Root) -> Streams {
        let mut streams = Streams::default();
        let json::Root { meshes, accessors, .. } = root;
        for primitive in meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
            let Some(draco) = primitive.extensions.draco.take() else { continue };
            let plain =
                |index: &usize| accessors.get(*index).is_none_or(|a| a.buffer_view.is_some());
            let attributes =
                || draco.attributes.keys().filter_map(|name| primitive.attributes.get(name));
            if attributes().chain(&primitive.indices).all(plain) {
                continue;
            }
            primitive.mode = Some(4);
            for (name, &id) in &draco.attributes {
                if let Some(index) = primitive.attributes.get_mut(name) {
                    let stored = Stored { view: draco.buffer_view, what: Content::Attribute(id) };
                    *index = streams.claim(*index, stored, accessors);
                }
            }
            let stored = Stored { view: draco.buffer_view, what: Content::Corners };
            let index = primitive.indices.unwrap_or_else(|| {
                accessors.push(json::Accessor::of_corners());
                accessors.len() - 1
            });
            primitive.indices = Some(streams.claim(index, stored, accessors));
        }
        streams
    }

    /// Says where the numbers of an accessor are; of a copy, if that one's are elsewhere already.
    fn claim(
        &mut self,
        index: usize,
        stored: Stored,
        accessors: &mut Vec<json::Accessor>,
    ) -> usize {
        let free = self.of_accessor.get(&index).is_none_or(|known| *known == stored);
        let index = match accessors.get(index) {
            Some(shared) if !free => {
                let copy = shared.clone();
                accessors.push(copy);
                accessors.len() - 1
            }
            _ => index,
        };
        self.of_accessor.insert(index, stored);
        self.decoded.entry(stored.view).or_default();
        index
    }
}
