//! STL: triangles, in text or binary, one object.

use std::io::Cursor;

use glam::DVec3;

use super::{CORNERS_MAX, Contents, Format, Object, Part, damaged};
use crate::folder::Folder;
use relume_core::scene::SceneError;

pub(super) fn read(
    mut bytes: Vec<u8>,
    stem: &str,
    folder: &Folder,
) -> Result<Contents, SceneError> {
    let wrong = |what: &dyn std::fmt::Display| damaged(folder, Format::Stl, what);
    hide_text_in_binary(&mut bytes);
    part_word_from_name(&mut bytes);
    let mut source = Cursor::new(bytes);
    let reader = stl_io::create_stl_reader(&mut source).map_err(|e| wrong(&e))?;
    let mut points = Vec::new();
    for triangle in reader {
        let triangle = triangle.map_err(|e| wrong(&e))?;
        points.extend(
            triangle.vertices.iter().map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())),
        );
        if points.len() > CORNERS_MAX {
            return Err(wrong(&format_args!("it has more than {} triangles", CORNERS_MAX / 3)));
        }
    }
    let triangles = (0..points.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let parts = vec![Part { material: None, points, triangles, places: None, colours: None }];
    let objects = vec![Object { name: stem.to_owned(), parts }];
    Ok(Contents { objects, ..Contents::default() })
}

/// A binary file may begin with the word that begins text: its length tells it.
fn hide_text_in_binary(bytes: &mut [u8]) {
    let Some(count) = bytes.get(80..84) else { return };
    let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]);
    if bytes.len() as u64 == 84 + 50 * u64::from(count) {
        bytes[..5].fill(b' ');
    }
}

/// The reader wants a space after the word that begins text; others write a tab, or the end of the line.
fn part_word_from_name(bytes: &mut Vec<u8>) {
    if bytes.starts_with(b"solid")
        && bytes.get(5).is_some_and(|b| *b != b' ' && b.is_ascii_whitespace())
    {
        bytes.insert(5, b' ');
    }
}
