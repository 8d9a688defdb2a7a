//! Images of a file, decoded when asked for and let go where memory is short.
//!
//! Must not know what an image is used for.

use std::io::Cursor;
use std::sync::Arc;

use image::{DynamicImage, ImageDecoder};

use super::document::Document;
use relume_core::scene::SceneError;
use relume_core::scene::pyramid::{BYTES_A_PIXEL, Pyramid};

/// Bytes of the largest image file that is read.
const IMAGE_MAX: usize = 1 << 28;

/// Bytes of decoded images that are kept beside the one in use.
const KEPT_MAX: usize = 128 << 20;

/// An image as it is asked for: its number in the file, and the least alpha of texels that count.
pub(super) type Key = (usize, u16);

/// Images by what they were asked for, those used last at the end.
pub(super) struct Images<'a> {
    document: &'a Document,
    kept: Vec<(Key, Arc<Pyramid>)>,
    /// Images that cannot be read, and why.
    unreadable: Vec<(usize, String)>,
}

impl<'a> Images<'a> {
    pub(super) fn new(document: &'a Document) -> Images<'a> {
        Images { document, kept: Vec::new(), unreadable: Vec::new() }
    }

    /// The image, or why it cannot be read.
    ///
    /// # Errors
    /// Where it does not exist, may not be opened, or needs more memory than is allowed (white instead would be another
    /// scene with less memory).
    pub(super) fn get(&mut self, key: Key) -> Result<Result<Arc<Pyramid>, String>, SceneError> {
        if let Some((_, why)) = self.unreadable.iter().find(|(image, _)| *image == key.0) {
            return Ok(Err(why.clone()));
        }
        if let Some(place) = self.kept.iter().position(|(kept, _)| *kept == key) {
            let found = self.kept.remove(place);
            self.kept.push(found.clone());
            return Ok(Ok(found.1));
        }
        match self.read(key)? {
            Ok(pyramid) => {
                let pyramid = Arc::new(pyramid);
                self.keep(key, pyramid.clone());
                Ok(Ok(pyramid))
            }
            Err(why) => {
                self.unreadable.push((key.0, why.clone()));
                Ok(Err(why))
            }
        }
    }

    fn keep(&mut self, key: Key, pyramid: Arc<Pyramid>) {
        self.kept.push((key, pyramid));
        let mut bytes: usize = self.kept.iter().map(|(_, p)| p.bytes()).sum();
        while bytes > KEPT_MAX && self.kept.len() > 1 {
            bytes -= self.kept.remove(0).1.bytes();
        }
    }

    fn read(&self, (index, least_alpha): Key) -> Result<Result<Pyramid, String>, SceneError> {
        let document = self.document;
        let owner = format!("image {index}");
        let Some(image) = document.root.images.get(index) else {
            return Err(document.out_of_range("image", index));
        };
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                if !uri.starts_with("data:") && !uri.contains("://") {
                    document.inside(uri, &owner)?;
                }
                document.uri(uri, &owner, IMAGE_MAX)
            }
            (None, Some(view)) => document.view(view).map(|(bytes, _)| bytes.to_vec()),
            (None, None) => {
                return Ok(Err(format!("{owner} names neither a file nor a buffer view")));
            }
        };
        match bytes {
            Ok(bytes) => self.decoded(&bytes, &owner, least_alpha),
            Err(error @ SceneError::TooLarge { .. }) => Err(error),
            Err(error) => Ok(Err(error.to_string())),
        }
    }

    fn decoded(
        &self,
        bytes: &[u8],
        owner: &str,
        least_alpha: u16,
    ) -> Result<Result<Pyramid, String>, SceneError> {
        if bytes.starts_with(KTX2) {
            return Ok(Err(
                "it is a KTX2 file; convert it to PNG, for example with `ktx extract --transcode rgba8`".to_owned()
            ));
        }
        let format = match image::guess_format(bytes) {
            Ok(format) => format,
            Err(error) => return Ok(Err(error.to_string())),
        };
        let reader = image::ImageReader::with_format(Cursor::new(bytes), format);
        let decoder = match reader.into_decoder() {
            Ok(decoder) => decoder,
            Err(error) => return Ok(Err(error.to_string())),
        };
        // As it is decoded, and as it is kept.
        let ((width, height), as_decoded) = (decoder.dimensions(), decoder.total_bytes());
        let kept = BYTES_A_PIXEL.saturating_mul(u64::from(width) * u64::from(height));
        self.document.fits(owner, as_decoded.saturating_add(kept))?;
        Ok(match DynamicImage::from_decoder(decoder) {
            Ok(pixels) => {
                let rgba = pixels.into_rgba8().into_raw();
                Pyramid::new([width as usize, height as usize], rgba, least_alpha)
                    .ok_or_else(|| "the image is empty".to_owned())
            }
            Err(error) => Err(error.to_string()),
        })
    }
}

/// The first bytes of a KTX2 file.
const KTX2: &[u8] = b"\xABKTX 20\xBB\r\n\x1A\n";
