//! Buffer views that are stored compressed: EXT_meshopt_compression and KHR_meshopt_compression.
//!
//! Both have the same streams; the second adds a newer version of the vertex codec and a filter for colours,
//! which are read in either. Must not know what is in the views.

use meshoptimizer_rs::Error;
use meshoptimizer_rs::codec::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
    decode_index_buffer, decode_index_sequence, decode_vertex_buffer,
};
use meshoptimizer_rs::{Limits, Workspace};

use super::document::Document;
use super::json;
use crate::guard::guarded;
use relume_core::scene::SceneError;

/// Bytes that one compressed byte can stand for, at most: a block of up to 256 vertices costs the vertex codec
/// (version 1) a byte for every four bytes of a vertex where nothing changes.
const EXPANSION_MAX: u64 = 1024;

/// What is stored besides: a vertex and its codec's control bytes at the end of a stream.
const TAIL_BYTES: u64 = 4096;

impl Document {
    /// The plain bytes of a compressed buffer view.
    pub(super) fn decompressed(
        &self,
        index: usize,
        packed: &json::Meshopt,
    ) -> Result<Vec<u8>, SceneError> {
        let what = format!("the compressed data of buffer view {index}");
        let source = self.slice(packed.buffer, (packed.byte_offset, packed.byte_length), &what)?;
        let bytes = (packed.count as u64).saturating_mul(packed.byte_stride as u64);
        let possible =
            (source.len() as u64).saturating_mul(EXPANSION_MAX).saturating_add(TAIL_BYTES);
        if bytes > possible {
            return Err(self.malformed(format!(
                "buffer view {index} declares {bytes} bytes, more than the {} compressed ones can hold",
                source.len()
            )));
        }
        self.fits(format_args!("buffer view {index}"), bytes)?;
        guarded(|| decoded(packed, source, bytes as usize))
            .unwrap_or_else(|| Err("its bytes are damaged".to_owned()))
            .map_err(|why| self.malformed(format!("{what} cannot be read: {why}")))
    }
}

/// The elements of a stream, their filter undone.
fn decoded(packed: &json::Meshopt, source: &[u8], bytes: usize) -> Result<Vec<u8>, String> {
    let (count, stride) = (packed.count, packed.byte_stride);
    let mut workspace = Workspace::new(Limits { max_bytes: bytes, ..Limits::default() });
    let fault = |error: Error| fault(error).to_owned();
    if count == 0 {
        return Ok(Vec::new());
    }
    let decode = match packed.mode.as_str() {
        "ATTRIBUTES" => decode_vertex_buffer,
        "TRIANGLES" => decode_index_buffer,
        "INDICES" => decode_index_sequence,
        other => return Err(format!("the mode `{other}` does not exist")),
    };
    let mut data = decode(count, stride, source, &mut workspace).map_err(fault)?;
    let filter = match packed.filter.as_deref() {
        None | Some("NONE") => return Ok(data),
        Some("OCTAHEDRAL") => decode_filter_oct,
        Some("QUATERNION") => decode_filter_quat,
        Some("EXPONENTIAL") => decode_filter_exp,
        Some("COLOR") => decode_filter_color,
        Some(other) => return Err(format!("the filter `{other}` does not exist")),
    };
    filter(&mut data, count, stride, &mut workspace).map_err(fault)?;
    Ok(data)
}

/// What is wrong, in words of the file.
fn fault(error: Error) -> &'static str {
    match error {
        Error::InvalidTopology => "its count is no multiple of 3",
        Error::InvalidLayout => "its byteStride does not go with its mode or its filter",
        Error::UnsupportedVersion => "it is of a version that is not known",
        Error::LimitExceeded | Error::AllocationFailed | Error::SizeOverflow => "it is too large",
        Error::NumericalFailure => "a direction in it has no length",
        _ => "its bytes are damaged",
    }
}
