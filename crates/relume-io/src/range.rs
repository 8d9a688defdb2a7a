//! What nothing can be computed with, in words: coordinates, where a text has them, and meshes without area.
//!
//! Must not know formats beyond what begins a line.

use glam::DVec3;

use relume_core::scene::SceneError;
use relume_core::scene::limits::{COORDINATE_MAX_M, is_place};

/// A place that is none, and why.
pub(crate) fn out_of_range(at: DVec3) -> String {
    match at.is_finite() {
        true => {
            format!("({:e}, {:e}, {:e}), further out than {COORDINATE_MAX_M:e} m", at.x, at.y, at.z)
        }
        false => format!("({}, {}, {}), which is no place", at.x, at.y, at.z),
    }
}

/// The first of the three numbers after a word that begins a line of text which is out of range: the line, from 1, and the number
/// as it is written.
pub(crate) fn first_out_of_range<'a>(text: &'a [u8], word: &str) -> Option<(usize, &'a str)> {
    let lines = text.split(|&b| b == b'\n');
    let numbered = (1..).zip(lines);
    let mut found = numbered.filter_map(|(line, bytes)| {
        let mut words = std::str::from_utf8(bytes).ok()?.split_ascii_whitespace();
        if !words.next()?.eq_ignore_ascii_case(word) {
            return None;
        }
        let bad = words.take(3).find(|w| w.parse().is_ok_and(|value: f64| !is_place(&[value])))?;
        Some((line, bad))
    });
    found.next()
}

/// The same of rows of numbers that begin at a line, in some columns.
pub(crate) fn first_row_out_of_range<'a>(
    text: &'a [u8],
    (first, count): (usize, usize),
    columns: &[usize],
) -> Option<(usize, &'a str)> {
    let lines = (1..).zip(text.split(|&b| b == b'\n')).skip(first).take(count);
    let mut found = lines.filter_map(|(line, bytes)| {
        let words: Vec<&str> = std::str::from_utf8(bytes).ok()?.split_ascii_whitespace().collect();
        let bad = |word: &&&str| word.parse().is_ok_and(|value: f64| !is_place(&[value]));
        let word = columns.iter().filter_map(|&c| words.get(c)).find(bad)?;
        Some((line, *word))
    });
    found.next()
}

/// What is said of it.
pub(crate) fn said((line, word): (usize, &str)) -> String {
    format!("line {line}: the coordinate `{word}` is out of range: {COORDINATE_MAX_M:e} m at most")
}

/// The error of a scene all of whose meshes are points or lines.
pub(crate) fn of_points(scene: String) -> SceneError {
    SceneError::Empty {
        scene,
        what: "it has points or lines alone, and these have no area".into(),
        remedy: "make surfaces of them in a program for meshes (of a cloud of points by reconstruction, of lines by giving \
                 them a thickness), and export these as triangles"
            .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_number_out_of_range_is_found_with_its_line() {
        let text = b"v 1 2 3\nvn 1e39 0 0\r\nv 0 1e12 0\nv 0 -1e39 4\r\nv inf 0 0\n";
        assert_eq!(first_out_of_range(text, "v"), Some((4, "-1e39")));
        assert_eq!(first_out_of_range(&text[..30], "v"), None);
        assert_eq!(first_out_of_range(b"\xff\nVertex 0 0 1e40", "vertex"), Some((2, "1e40")));
        let rows = b"end_header\n1e39 0 0 0\n0 0 0 1e40\n1e41 1\n";
        assert_eq!(first_row_out_of_range(rows, (1, 2), &[1, 2, 3]), Some((3, "1e40")));
        assert_eq!(first_row_out_of_range(rows, (1, 2), &[1, 2]), None);
    }
}
