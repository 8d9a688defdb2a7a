//! PLY: vertices and polygons, in text or binary of either order, one object.

use std::io::Cursor;

use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::paint::linear;
use super::{CORNERS_MAX, Contents, Format, Object, Part, damaged, info, polygon};
use crate::folder::Folder;
use crate::range::first_row_out_of_range;
use relume_core::scene::SceneError;

/// A vertex: its place and its colour.
struct Vertex(DVec3, [f64; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Vertex(DVec3::ZERO, [1.0; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let coordinate = match name {
            "x" => &mut self.0.x,
            "y" => &mut self.0.y,
            "z" => &mut self.0.z,
            "red" | "diffuse_red" | "r" => return self.colour(0, property),
            "green" | "diffuse_green" | "g" => return self.colour(1, property),
            "blue" | "diffuse_blue" | "b" => return self.colour(2, property),
            _ => return PropertyAccessResult::Ignored,
        };
        *coordinate = match property {
            Property::Char(v) => v.into(),
            Property::UChar(v) => v.into(),
            Property::Short(v) => v.into(),
            Property::UShort(v) => v.into(),
            Property::Int(v) => v.into(),
            Property::UInt(v) => v.into(),
            Property::Float(v) => v.into(),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

impl Vertex {
    /// Sets a channel of the colour, sRGB: integers are shares of their largest.
    fn colour(&mut self, channel: usize, property: Property) -> PropertyAccessResult {
        self.1[channel] = match property {
            Property::UChar(v) => f64::from(v) / 255.0,
            Property::UShort(v) => f64::from(v) / 65_535.0,
            Property::Float(v) => v.into(),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

/// A polygon: indices of vertices, negative ones being nowhere.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Face(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index" | "tristrip") {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// An element that is not used.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Other
    }
}

/// The first coordinate of a vertex of a text that is out of range: its line and how it is written. `None` too where the header is
/// none that can be followed line by line.
pub(super) fn vertex_out_of_range(bytes: &[u8]) -> Option<(usize, &str)> {
    // Far longer than any header.
    const HEADER_LINES: usize = 1_000;
    let mut is_text = false;
    let mut rows = 0;
    // Of the element of vertices: where its rows begin, how many there are, and its properties.
    let mut vertices: Option<(usize, usize, Vec<&str>)> = None;
    let mut in_vertices = false;
    for (number, line) in bytes.split(|&b| b == b'\n').enumerate().take(HEADER_LINES) {
        let words: Vec<&str> = std::str::from_utf8(line).ok()?.split_ascii_whitespace().collect();
        match words[..] {
            ["format", format, ..] => is_text = format == "ascii",
            ["element", name, count] => {
                let count: usize = count.parse().ok()?;
                in_vertices = name == "vertex";
                if in_vertices {
                    vertices = Some((rows, count, Vec::new()));
                }
                rows = usize::checked_add(rows, count)?;
            }
            ["property", "list", ..] if in_vertices => return None,
            ["property", _, name] if in_vertices => {
                if let Some((_, _, names)) = &mut vertices {
                    names.push(name);
                }
            }
            ["end_header"] => {
                let (before, count, names) = vertices.filter(|_| is_text)?;
                let columns: Vec<usize> =
                    (0..names.len()).filter(|&k| matches!(names[k], "x" | "y" | "z")).collect();
                return first_row_out_of_range(bytes, (number + 1 + before, count), &columns);
            }
            _ => {}
        }
    }
    None
}

pub(super) fn read(bytes: &[u8], stem: &str, folder: &Folder) -> Result<Contents, SceneError> {
    let wrong = |what: &dyn std::fmt::Display| damaged(folder, Format::Ply, first_line(what));
    let bytes = &plain_lines(bytes)[..];
    let mut reader = Reader::new(Cursor::new(bytes));
    let header = Parser::<Other>::new().read_header(&mut reader).map_err(|e| wrong(&e))?;
    let (mut points, mut faces, mut unused) = (Vec::new(), Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        // Each takes a byte at least, but for those without properties.
        if element.count > bytes.len() {
            let count = element.count;
            return Err(wrong(&format_args!(
                "it declares {count} of `{name}`, more than it has bytes"
            )));
        }
        match name.as_str() {
            "vertex" => {
                let read = Parser::<Vertex>::new();
                points = read
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| wrong(&e))?;
            }
            "face" => {
                let read = Parser::<Face>::new();
                let read = read
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| wrong(&e))?;
                faces.extend(read);
            }
            "tristrips" => {
                let read = Parser::<Face>::new();
                let strips = read
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| wrong(&e))?;
                faces.extend(strips.iter().flat_map(of_strip));
            }
            _ => {
                unused.push(name.as_str());
                let read = Parser::<Other>::new();
                read.read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| wrong(&e))?;
            }
        }
    }
    let is_known = |v: &Vertex| v.1.iter().all(|c| c.is_finite());
    let colours = points.iter().any(|v| v.1 != [1.0; 3]) && points.iter().all(is_known);
    let colours = colours.then(|| points.iter().map(|v| linear(v.1)).collect());
    let points: Vec<DVec3> = points.into_iter().map(|v| v.0).collect();
    let triangles = triangles(&points, &faces).map_err(|what| wrong(&what))?;
    let mut contents = Contents::default();
    if !unused.is_empty() {
        let message = format!("elements that are not read: {}", unused.join(", "));
        contents.notes.push(info("ply", stem, unused.len(), message));
    }
    contents.has_vertices = !points.is_empty();
    let parts = vec![Part { material: None, points, triangles, places: None, colours }];
    contents.objects = vec![Object { name: stem.to_owned(), parts }];
    Ok(contents)
}

/// The triangles of a strip: each index makes one with the two before it, every second turned round; negative ones begin
/// anew.
fn of_strip(strip: &Face) -> impl Iterator<Item = Face> {
    let runs = strip.0.split(|&index| index < 0);
    let of_run = |run: &[i64]| {
        let turned = |(k, t): (usize, &[i64])| match k % 2 {
            0 => Face(vec![t[0], t[1], t[2]]),
            _ => Face(vec![t[1], t[0], t[2]]),
        };
        run.windows(3).enumerate().map(turned).collect::<Vec<Face>>()
    };
    runs.flat_map(of_run)
        .filter(|f| f.0[0] != f.0[1] && f.0[1] != f.0[2] && f.0[0] != f.0[2])
        .collect::<Vec<_>>()
        .into_iter()
}

/// The file with a header, and a body if that is text, whose lines end with line feeds and have single spaces:
/// programs also write carriage returns, alone or before line feeds, and tabs.
fn plain_lines(bytes: &[u8]) -> Vec<u8> {
    const LAST: &[u8] = b"end_header";
    let last = bytes.windows(LAST.len()).position(|w| w == LAST);
    let (Some(last), Some(b"ply\r")) = (last, bytes.get(..4)) else {
        return single_spaces(bytes, last.unwrap_or(0));
    };
    let both = bytes.get(4) == Some(&b'\n');
    let end = (last + LAST.len() + 1 + usize::from(both)).min(bytes.len());
    let is_text = bytes[..end].windows(5).any(|w| w == b"ascii");
    let ended = |part: &[u8]| match both {
        true => part.iter().copied().filter(|&b| b != b'\r').collect::<Vec<u8>>(),
        false => part.iter().map(|&b| if b == b'\r' { b'\n' } else { b }).collect(),
    };
    let body = if is_text { ended(&bytes[end..]) } else { bytes[end..].to_vec() };
    let header = ended(&bytes[..end]);
    let last = header.len().saturating_sub(LAST.len() + 1);
    single_spaces(&[header, body].concat(), last)
}

/// The same with single spaces between the words of its first `header` bytes, and none around its lines.
fn single_spaces(bytes: &[u8], header: usize) -> Vec<u8> {
    let (header, rest) = bytes.split_at(header.min(bytes.len()));
    let words = |line: &[u8]| {
        let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        words.collect::<Vec<&[u8]>>().join(&b' ')
    };
    let lines: Vec<Vec<u8>> = header.split(|&b| b == b'\n').map(words).collect();
    [&lines.join(&b'\n'), rest].concat()
}

/// The parser's messages show the line that it could not read below.
fn first_line(what: &dyn std::fmt::Display) -> String {
    what.to_string().lines().next().unwrap_or_default().to_owned()
}

fn triangles(points: &[DVec3], faces: &[Face]) -> Result<Vec<[u32; 3]>, String> {
    let mut triangles = Vec::new();
    for (number, Face(corners)) in faces.iter().enumerate() {
        let index = |&c: &i64| u32::try_from(c).ok().filter(|&c| (c as usize) < points.len());
        let corners: Option<Vec<u32>> = corners.iter().map(index).collect();
        let corners = corners.ok_or_else(|| {
            format!("face {number} has a corner that is none of its {} vertices", points.len())
        })?;
        let cut = polygon::triangles(points, &corners).ok_or_else(|| {
            format!("face {number} is not convex and has {} corners", corners.len())
        })?;
        triangles.extend(cut);
        if 3 * triangles.len() > CORNERS_MAX {
            return Err(format!("it has more than {} triangles", CORNERS_MAX / 3));
        }
    }
    Ok(triangles)
}
