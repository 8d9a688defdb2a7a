//! Images of a file, decoded when asked for and let go where memory is short.
//!
//! Must not know what an image is used for.

use std::sync::Arc;

use super::document::Document;
use crate::surface::image_file::{IMAGE_MAX, texels};
use relume_core::scene::SceneError;
use relume_core::scene::pyramid::Pyramid;

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
        match encoded(document, index)? {
            Ok(bytes) => self.decoded(&bytes, &owner, least_alpha),
            Err(why) => Ok(Err(why)),
        }
    }

    fn decoded(
        &self,
        bytes: &[u8],
        owner: &str,
        least_alpha: u16,
    ) -> Result<Result<Pyramid, String>, SceneError> {
        let found = texels(bytes, "", &|needs_bytes| self.document.fits(owner, needs_bytes))?;
        Ok(found.and_then(|image| {
            let size = [image.width() as usize, image.height() as usize];
            Pyramid::new(size, image.into_raw(), least_alpha)
                .ok_or_else(|| "the image is empty".to_owned())
        }))
    }
}

/// The bytes of the file of an image, or why they cannot be had.
///
/// # Errors
/// Those of [`Images::get`].
pub(super) fn encoded(
    document: &Document,
    index: usize,
) -> Result<Result<Vec<u8>, String>, SceneError> {
    let owner = format!("image {index}");
    let Some(image) = document.root.images.get(index) else {
        return Err(document.out_of_range("image", index));
    };
    let bytes = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => document.uri(uri, &owner, IMAGE_MAX),
        (None, Some(view)) => document.view(view).map(|(bytes, _)| bytes.to_vec()),
        (None, None) => return Ok(Err(format!("{owner} names neither a file nor a buffer view"))),
    };
    match bytes {
        Ok(bytes) => Ok(Ok(bytes)),
        Err(error @ (SceneError::TooLarge { .. } | SceneError::Outside { .. })) => Err(error),
        Err(error) => Ok(Err(error.to_string())),
    }
}
