//! Files of images to texels: PNG, JPEG, WebP, BMP, TGA, and Basis Universal in KTX2.
//!
//! Must not know where files are, or what an image is used for.

use std::io::Cursor;

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use image::{DynamicImage, ImageDecoder, ImageFormat, RgbaImage};

use crate::guard::guarded;
use relume_core::scene::SceneError;
use relume_core::scene::pyramid::BYTES_A_PIXEL;

/// Bytes of the largest image file that is read.
pub(crate) const IMAGE_MAX: usize = 1 << 28;

/// The first bytes of a KTX2 file.
const KTX2: &[u8] = b"\xABKTX 20\xBB\r\n\x1A\n";

/// Whether so many bytes may be asked for.
pub(crate) type Fits<'a> = &'a dyn Fn(u64) -> Result<(), SceneError>;

/// The texels of an image file, rows from the top, or why it cannot be read. `name` tells the format where the first bytes
/// do not.
///
/// # Errors
/// Those of `fits`.
pub(crate) fn texels(
    bytes: &[u8],
    name: &str,
    fits: Fits<'_>,
) -> Result<Result<RgbaImage, String>, SceneError> {
    if bytes.starts_with(KTX2) {
        return basis(bytes, fits);
    }
    let by_name = || ImageFormat::from_path(name).ok().filter(|f| *f == ImageFormat::Tga);
    let format = match image::guess_format(bytes) {
        Ok(format) => format,
        Err(error) => match by_name() {
            Some(format) => format,
            None => return Ok(Err(error.to_string())),
        },
    };
    let reader = image::ImageReader::with_format(Cursor::new(bytes), format);
    let decoder = match reader.into_decoder() {
        Ok(decoder) => decoder,
        Err(error) => return Ok(Err(error.to_string())),
    };
    // As it is decoded, and as it is kept.
    let ((width, height), as_decoded) = (decoder.dimensions(), decoder.total_bytes());
    fits(as_decoded.saturating_add(kept(width, height)))?;
    Ok(DynamicImage::from_decoder(decoder).map(DynamicImage::into_rgba8).map_err(|e| e.to_string()))
}

fn kept(width: u32, height: u32) -> u64 {
    BYTES_A_PIXEL.saturating_mul(u64::from(width) * u64::from(height))
}

/// Texels a byte of a KTX2 file at most: below that of an even image in ETC1S, far above that of any other.
const BASIS_MOST: u64 = 1 << 14;

/// The largest level of a texture of Basis Universal.
fn basis(bytes: &[u8], fits: Fits<'_>) -> Result<Result<RgbaImage, String>, SceneError> {
    const REMEDY: &str = "convert it to PNG, for example with `ktx extract --transcode rgba8`";
    let word = |at: usize| {
        bytes.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    };
    let (width, height) = (word(20), word(24));
    if u64::from(width) * u64::from(height) / BASIS_MOST > bytes.len() as u64 {
        return Ok(Err(format!(
            "its KTX2 file declares {width} x {height} texels in {} bytes",
            bytes.len()
        )));
    }
    // The texels as they are decoded, what they are decoded from, and the texels as they are kept.
    fits(kept(width, height).saturating_mul(3))?;
    let decoded = guarded(|| {
        let texture = Transcoder::new(bytes)?;
        texture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE)
    });
    Ok(match decoded {
        Some(Ok(texels)) => RgbaImage::from_raw(width, height, texels)
            .ok_or_else(|| format!("its KTX2 file is damaged; {REMEDY}")),
        Some(Err(error)) => {
            Err(format!("of KTX2 files Basis Universal alone is read ({error:?}); {REMEDY}"))
        }
        None => Err(format!("its KTX2 file is damaged; {REMEDY}")),
    })
}
