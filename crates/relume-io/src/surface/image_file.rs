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

#[cfg(test)]
mod tests {
    use super::*;

    fn words(words: &[u32]) -> Vec<u8> {
        words.iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    /// A KTX2 file of 4 x 4 texels of one colour: a block of UASTC without supercompression (KTX 2.0; UASTC, solid colour).
    fn ktx2(colour: [u8; 4]) -> Vec<u8> {
        // From the start: identifier, header, index, the one level's index, data format descriptor.
        let (dfd, level) = (104_u32, 148_u32);
        let mut file = KTX2.to_vec();
        // Format (none of Vulkan's), size of its type, width, height, depth, layers, faces, levels, supercompression.
        file.extend(words(&[0, 1, 4, 4, 0, 0, 1, 1, 0]));
        // Descriptor, key values, global data (64-bit words).
        file.extend(words(&[dfd, 44, 0, 0, 0, 0, 0, 0]));
        file.extend(words(&[level + 4, 0, 16, 0, 16, 0]));
        // A basic block: UASTC (166), BT.709, sRGB; texel blocks of 4 x 4 in one plane of 16 bytes, one sample with alpha.
        file.extend(words(&[44, 0, 2 | 40 << 16, 166 | 1 << 8 | 2 << 16, 3 | 3 << 8, 16, 0]));
        file.extend(words(&[127 << 16 | 3 << 24, 0, 0, u32::MAX]));
        file.extend([0; 4]);
        // Five bits of the mode, then the colour, 8 bits a channel.
        let packed = u128::from(SOLID) | u128::from(u32::from_le_bytes(colour)) << 5;
        file.extend(packed.to_le_bytes());
        file
    }

    /// The code of the mode for blocks of one colour.
    const SOLID: u32 = 0b10111;

    fn read(bytes: &[u8]) -> Result<RgbaImage, String> {
        texels(bytes, "", &|_| Ok(())).unwrap()
    }

    #[test]
    fn basis_universal_in_ktx2_is_read() {
        let colour = [200, 100, 50, 255];
        let image = read(&ktx2(colour)).unwrap();
        assert_eq!(image.dimensions(), (4, 4));
        assert!(image.pixels().all(|texel| texel.0 == colour), "{:?}", image.get_pixel(0, 0));
    }

    #[test]
    fn damaged_ktx2_is_said_and_asks_for_no_memory() {
        let whole = ktx2([1, 2, 3, 4]);
        for place in 12..whole.len() {
            for flip in [1, 0x40, 0xff] {
                let mut damaged = whole.clone();
                damaged[place] ^= flip;
                // Whatever it says.
                let _ = texels(&damaged, "", &|bytes| {
                    assert!(bytes < 1 << 24, "{bytes}");
                    Ok(())
                });
            }
            let _ = read(&whole[..place]);
        }
        // 2^20 x 2^20 texels.
        let mut large = whole;
        (large[22], large[26]) = (16, 16);
        assert!(read(&large).unwrap_err().contains("declares"));
    }
}
