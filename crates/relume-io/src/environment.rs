//! Environments from files: Radiance .hdr and OpenEXR.
//!
//! Must not know how a sky of polygons is made of them.

use std::io::Cursor;
use std::path::Path;

use crate::regular::read_file;
use relume_core::scene::SceneError;
use relume_core::scene::outside::Environment;

/// Bytes that decoding takes for each pixel at most: as decoded, and as kept.
const BYTES_PER_PIXEL: u64 = 16 + 12;

/// Bytes that a picture may take where no limit is given: 32,768 x 16,384 pixels.
const PICTURE_MAX_BYTES: u64 = 16 << 30;

/// The radiance from all directions that a .hdr or .exr file holds; `max_memory_bytes` as [`ImportOptions::max_memory_bytes`](crate::ImportOptions::max_memory_bytes).
///
/// # Errors
/// A file that is missing, damaged, too large, or something else.
pub fn read_environment(
    path: &Path,
    max_memory_bytes: Option<u64>,
) -> Result<Environment, SceneError> {
    let file = path.display().to_string();
    let too_large = |what: &str, needs_bytes| SceneError::TooLarge {
        file: file.clone(),
        what: what.into(),
        needs_bytes,
        limit_bytes: max_memory_bytes.unwrap_or(u64::MAX),
        remedy: "raise `ImportOptions::max_memory_bytes`, or use a smaller picture".into(),
    };
    let damaged = |what: String| SceneError::Geometry {
        subject: format!("environment `{file}`"),
        what,
        remedy: "give an equirectangular picture of radiance, .hdr or .exr".into(),
    };
    let limit = max_memory_bytes.unwrap_or(u64::MAX);
    let bytes = read_file(path, max_memory_bytes)?;
    let len = bytes.len() as u64;
    let format = match bytes.get(..4) {
        Some(b"#?RA" | b"#?RG") => image::ImageFormat::Hdr,
        Some([0x76, 0x2f, 0x31, 0x01]) => image::ImageFormat::OpenExr,
        _ => return Err(damaged("it is neither Radiance's .hdr nor OpenEXR".into())),
    };
    let reader = || image::ImageReader::with_format(Cursor::new(&bytes), format);
    let said = |e: image::ImageError| damaged(format!("the picture cannot be decoded: {e}"));
    let (width, height) = reader().into_dimensions().map_err(said)?;
    let needs = u64::from(width) * u64::from(height) * BYTES_PER_PIXEL + len;
    // Without a limit, as much as the largest pictures that are sold.
    if needs > limit.min(PICTURE_MAX_BYTES) {
        return Err(too_large(&format!("the picture of {width} x {height}"), needs));
    }
    let decoded = reader().decode().map_err(said)?.into_rgb32f();
    let pixel = |p: &image::Rgb<f32>| p.0.map(|c| if c.is_nan() { 0.0 } else { c.max(0.0) });
    let pixels = decoded.pixels().map(pixel).collect();
    Environment::new(&file, (width, height), pixels)
}
