//! Primitives that are stored compressed: KHR_draco_mesh_compression.
//!
//! An accessor of such a primitive has no bytes of its own: its numbers are an attribute of what a stream
//! holds, or its corners. Which, is noted when the file is opened, so that whoever reads an accessor need not know.
//! Must not know what the numbers mean.

use draco_core::{
    DataType, DecodeLimits, DecoderBuffer, DracoError, ErrorKind, Mesh, MeshDecoder,
    PointAttribute, PointIndex,
};

use super::component::Component;
use super::document::Document;
use super::streams::{Content, Stored};
use crate::guard::guarded;
use relume_core::scene::SceneError;

/// Triangles and vertices of one stream at most: above any mesh that can be solved, and few bytes can stand for
/// many of them.
const COUNT_MAX: u64 = 1 << 24;

/// Bytes of the numbers of one stream at most, if no limit of memory says less.
const BYTES_MAX: u64 = 1 << 30;

impl Document {
    /// The elements of an accessor that are in a compressed stream, if they are.
    pub(super) fn streamed<const N: usize>(
        &self,
        index: usize,
        owner: &str,
    ) -> Result<Option<Vec<[f64; N]>>, SceneError> {
        let Some(&Stored { view, what }) = self.streams.of_accessor.get(&index) else {
            return Ok(None);
        };
        let mesh = self.stream(view, owner)?;
        let count = match what {
            Content::Attribute(_) => mesh.num_points(),
            Content::Corners => 3 * mesh.num_faces(),
        };
        self.numbers_fit::<N>(count, index, owner)?;
        let Content::Attribute(id) = what else {
            let corners = mesh.faces().iter().flatten();
            return Ok(Some(corners.map(|corner| [f64::from(corner.0); N]).collect()));
        };
        let read = mesh.attribute_by_unique_id(id).and_then(|attribute| {
            let normalized = self.root.accessors.get(index).is_some_and(|a| a.normalized);
            elements(attribute, count, normalized)
        });
        let wrong = || {
            format!(
                "{owner}: the compressed data in buffer view {view} has no attribute {id} of {N} numbers"
            )
        };
        read.map(Some).ok_or_else(|| self.malformed(wrong()))
    }

    /// What the stream in a buffer view holds.
    fn stream(&self, view: usize, owner: &str) -> Result<&Mesh, SceneError> {
        let cell = self.streams.decoded.get(&view);
        let cell = cell.ok_or_else(|| self.out_of_range("buffer view", view))?;
        if let Some(known) = cell.get() {
            return Ok(known);
        }
        let (bytes, _) = self.view(view)?;
        let bytes_max = self.limit_bytes().map_or(BYTES_MAX, |limit| limit.min(BYTES_MAX));
        let limits = DecodeLimits::default()
            .with_max_points(COUNT_MAX)
            .with_max_faces(COUNT_MAX)
            .with_max_decoded_bytes(bytes_max);
        let decoded = guarded(|| {
            let mut mesh = Mesh::new();
            let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
            MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh)
        });
        match decoded {
            Some(Ok(mesh)) => Ok(cell.get_or_init(|| mesh)),
            Some(Err(error)) => Err(self.undecoded(&error, view, owner, bytes_max)),
            None => Err(self.malformed(format!(
                "{owner}: the compressed data in buffer view {view} cannot be read: its bytes are damaged"
            ))),
        }
    }

    /// Why a stream is not decoded.
    fn undecoded(
        &self,
        error: &DracoError,
        view: usize,
        owner: &str,
        bytes_max: u64,
    ) -> SceneError {
        let what = format!("{owner}: the compressed data in buffer view {view}");
        if error.kind() != ErrorKind::LimitExceeded {
            return self.malformed(format!("{what} cannot be read: {}", error.message()));
        }
        // How much more it needs is not known.
        match self.fits(&what, bytes_max + 1) {
            Err(too_large) => too_large,
            Ok(()) => self.malformed(format!("{what} holds more than can be solved")),
        }
    }
}

/// The numbers of an attribute, one element for each vertex; `None` if it has not N components or not all elements.
fn elements<const N: usize>(
    attribute: &PointAttribute,
    count: usize,
    normalized: bool,
) -> Option<Vec<[f64; N]>> {
    let component = match attribute.data_type() {
        DataType::Int8 => Component::I8,
        DataType::Uint8 => Component::U8,
        DataType::Int16 => Component::I16,
        DataType::Uint16 => Component::U16,
        DataType::Uint32 => Component::U32,
        DataType::Float32 => Component::F32,
        _ => return None,
    };
    if usize::from(attribute.num_components()) != N {
        return None;
    }
    let data = attribute.buffer().data();
    let size = component.size();
    let stride = usize::try_from(attribute.byte_stride()).ok()?.max(N * size);
    let element = |point: usize| {
        let value = attribute.mapped_index(PointIndex(point as u32)).0 as usize;
        let bytes = data.get(value.checked_mul(stride)?..)?.get(..N * size)?;
        Some(std::array::from_fn(|k| component.read(&bytes[k * size..(k + 1) * size], normalized)))
    };
    (0..count).map(element).collect()
}
