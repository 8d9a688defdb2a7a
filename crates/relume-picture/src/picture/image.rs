//! Pixels, and PNG files that are whole or not there.
//!
//! Must not know what the picture shows.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A picture: 8-bit sRGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// sRGB values, row by row from the top left; `width * height` of them.
    pub pixels: Vec<[u8; 3]>,
}

/// Why a picture could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {reason}", .path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// What happened.
    pub reason: String,
}

impl Image {
    /// The pixel in column `x` (from the left) and row `y` (from the top).
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        self.pixels[(y * self.width + x) as usize]
    }

    /// Writes a PNG file: under a temporary name in the same directory first, then renamed, so that
    /// `path` never holds half a picture. An existing file is replaced.
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        let path = path.as_ref();
        let fail = |reason: String| WriteError { path: path.into(), reason };
        let name = path.file_name().ok_or_else(|| fail("it has no file name".into()))?;
        let mut partial = std::ffi::OsString::from(".");
        partial.push(name);
        partial.push(".partial");
        let partial = path.with_file_name(partial);
        let written = self
            .write_to(&partial)
            .and_then(|()| fs::rename(&partial, path).map_err(|error| error.to_string()));
        written.map_err(|reason| {
            // Best effort: it may not even exist, and the first error is the one to report.
            let _ = fs::remove_file(&partial);
            fail(reason)
        })
    }

    fn write_to(&self, path: &Path) -> Result<(), String> {
        let text = |error: std::io::Error| error.to_string();
        let mut out = BufWriter::new(File::create(path).map_err(text)?);
        out.write_all(&self.to_png()?).map_err(text)?;
        out.into_inner().map_err(|error| error.to_string())?;
        Ok(())
    }

    /// The bytes of the PNG file.
    ///
    /// # Errors
    /// What the encoder says: pictures without pixels cannot be written.
    pub fn to_png(&self) -> Result<Vec<u8>, String> {
        let text = |error: png::EncodingError| error.to_string();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header().map_err(text)?;
        writer.write_image_data(self.pixels.as_flattened()).map_err(text)?;
        writer.finish().map_err(text)?;
        Ok(bytes)
    }
}

/// Whether `bytes` are a PNG file that can be decoded to its last pixel, with the checksums of all its
/// parts right.
pub fn is_whole_png(bytes: &[u8]) -> bool {
    if !bytes.ends_with(b"IEND\xaeB`\x82") {
        return false;
    }
    let Ok(mut reader) = png::Decoder::new(std::io::Cursor::new(bytes)).read_info() else {
        return false;
    };
    let Some(size) = reader.output_buffer_size() else { return false };
    reader.next_frame(&mut vec![0; size]).is_ok() && reader.finish().is_ok()
}
