//! The text of a `.vs3` file as lines with numbers. Knows no geometry beyond what the format's
//! own planes need.

use glam::{DVec2, DVec3};
use relume_core::scene::limits::{COORDINATE_MAX_M, is_place};

/// What is wrong with a line (0: with the whole), and what to do about it.
#[derive(Debug, PartialEq)]
pub(super) struct Wrong {
    pub(super) line: usize,
    pub(super) what: String,
    pub(super) remedy: String,
}

/// What a surface is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Factors are wanted (S).
    Radiating,
    /// A hole in its base (N).
    Null,
    /// Only in the way (O).
    Obstruction,
}

/// A surface as written.
#[derive(Clone, Debug)]
pub(super) struct RawSurface {
    pub(super) line: usize,
    pub(super) kind: Kind,
    /// Counter-clockwise seen from the active side.
    pub(super) corners: Vec<DVec3>,
    /// Index of the surface that it is a part of.
    pub(super) base: Option<usize>,
    /// Index of the surface that it is reported with.
    pub(super) combined_with: Option<usize>,
    pub(super) emittance: f64,
    pub(super) name: Option<String>,
}

/// What a file says.
#[derive(Debug, Default)]
pub(super) struct File {
    pub(super) title: String,
    /// Words of control lines with their values.
    pub(super) control: Vec<(String, String)>,
    pub(super) surfaces: Vec<RawSurface>,
    /// Lines that say nothing known.
    pub(super) ignored_lines: Vec<(usize, String)>,
}

/// How geometry is given.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Geometry {
    /// Vertices by number (F 3).
    Vertices,
    /// Shapes in planes (F 3a).
    Planes,
}

/// The words of a file, line by line, without comments.
struct Words<'a> {
    lines: std::iter::Peekable<std::vec::IntoIter<(usize, Vec<&'a str>)>>,
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Words<'a> {
        let code = |line: &'a str| line.split('!').next().unwrap_or("");
        let split = |line: &'a str| -> Vec<&'a str> {
            code(line)
                .split(|c: char| c.is_whitespace() || c == ',')
                .filter(|w| !w.is_empty())
                .collect()
        };
        let lines: Vec<_> = (1..).zip(text.lines().map(split)).collect();
        let said =
            |(_, words): &(usize, Vec<&str>)| !words.is_empty() && !words[0].starts_with('/');
        Words { lines: lines.into_iter().filter(said).collect::<Vec<_>>().into_iter().peekable() }
    }

    /// The next numbers, over as many lines as they fill.
    fn numbers(&mut self, count: usize, after: usize) -> Result<Vec<f64>, Wrong> {
        let mut out = Vec::with_capacity(count);
        while out.len() < count {
            let Some((line, words)) = self.lines.next() else {
                return wrong(after, format!("{} numbers are missing", count - out.len()), SHAPES);
            };
            for word in words {
                out.push(coordinate(line, word)?);
            }
        }
        if out.len() > count {
            return wrong(
                after,
                format!("there are {} numbers too many", out.len() - count),
                SHAPES,
            );
        }
        Ok(out)
    }
}

const SHAPES: &str = "after the surface's line give x y z azimuth tilt, then width height (R), three \
                      (T) or four (Q) pairs x y";
const SURFACE: &str = "write: S number v1 v2 v3 v4 base cmb emit name";
const PLANE_SURFACE: &str = "write: S number shape base cmb emit name";
const VERTEX: &str = "write: V number x y z";

fn wrong<T>(line: usize, what: String, remedy: &str) -> Result<T, Wrong> {
    Err(Wrong { line, what, remedy: remedy.to_owned() })
}

fn number(line: usize, word: &str) -> Result<f64, Wrong> {
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => wrong(line, format!("`{word}` is not a number"), "give finite decimal numbers"),
    }
}

/// A number that is, or leads to, a coordinate.
fn coordinate(line: usize, word: &str) -> Result<f64, Wrong> {
    let value = number(line, word)?;
    if !is_place(&[value]) {
        let what = format!("`{word}` is larger than {COORDINATE_MAX_M:e} m");
        return wrong(line, what, "give places in metres, nearer to the origin");
    }
    Ok(value)
}

fn whole(line: usize, word: Option<&&str>, what: &str, remedy: &str) -> Result<usize, Wrong> {
    match word {
        None => wrong(line, format!("the {what} is missing"), remedy),
        Some(word) => word.parse().or_else(|_| {
            wrong(line, format!("the {what} is `{word}`, not a whole number"), remedy)
        }),
    }
}

/// Reads a whole file.
pub(super) fn read(text: &str) -> Result<File, Wrong> {
    let mut file = File::default();
    let mut geometry = Geometry::Vertices;
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut words = Words::new(text.strip_prefix('\u{feff}').unwrap_or(text));
    // Corners by number, which may come later in the file.
    let mut corners: Vec<Vec<usize>> = Vec::new();
    while let Some((line, said)) = words.lines.next() {
        let rest = &said[1..];
        match said[0].chars().next().map(|c| c.to_ascii_uppercase()) {
            Some('T') => file.title = rest.join(" "),
            Some('E' | '*') => break,
            Some('C') => control(rest, &mut file.control),
            Some('F') => geometry = geometry_of(line, rest.first().copied())?,
            Some('V') => vertices.push(vertex(line, rest, vertices.len())?),
            Some('M') => {
                return wrong(
                    line,
                    "it is a masking surface".into(),
                    "Relume knows none: lay a surface of type S into the plane, facing its base",
                );
            }
            Some(letter @ ('S' | 'N' | 'O')) => {
                let kind = match letter {
                    'S' => Kind::Radiating,
                    'N' => Kind::Null,
                    _ => Kind::Obstruction,
                };
                let (surface, numbers) = match geometry {
                    Geometry::Vertices => surface(line, kind, rest, file.surfaces.len())?,
                    Geometry::Planes => (
                        plane_surface(line, kind, rest, file.surfaces.len(), &mut words)?,
                        Vec::new(),
                    ),
                };
                file.surfaces.push(surface);
                corners.push(numbers);
            }
            _ => file
                .ignored_lines
                .push((line, format!("`{}` says nothing known; it is ignored", said[0]))),
        }
    }
    refer(&mut file.surfaces, corners, &vertices)?;
    Ok(file)
}

/// Gives surfaces the corners of which they say the numbers, and checks what surfaces they refer to.
fn refer(
    surfaces: &mut [RawSurface],
    corners: Vec<Vec<usize>>,
    vertices: &[DVec3],
) -> Result<(), Wrong> {
    let count = surfaces.len();
    for (k, (surface, numbers)) in surfaces.iter_mut().zip(corners).enumerate() {
        for number in numbers {
            match number.checked_sub(1).and_then(|n| vertices.get(n)) {
                Some(&vertex) => surface.corners.push(vertex),
                None => {
                    let what = format!("surface {} refers to vertex {number}", k + 1);
                    return wrong(
                        surface.line,
                        what,
                        &format!("there are vertices 1 to {}", vertices.len()),
                    );
                }
            }
        }
        for other in [surface.base, surface.combined_with].into_iter().flatten() {
            if other >= count || other == k {
                let what = format!("surface {} refers to surface {}", k + 1, other + 1);
                return wrong(
                    surface.line,
                    what,
                    &format!("refer to another of the {count} surfaces, or write 0"),
                );
            }
        }
    }
    Ok(())
}

/// `name=value` pairs, with or without spaces about the sign.
fn control(words: &[&str], out: &mut Vec<(String, String)>) {
    let joined = words.join(" ");
    let mut pieces = joined.split(['=', ' ']).filter(|piece| !piece.is_empty());
    while let Some(name) = pieces.next() {
        out.push((name.to_owned(), pieces.next().unwrap_or("").to_owned()));
    }
}

fn geometry_of(line: usize, word: Option<&str>) -> Result<Geometry, Wrong> {
    match word.map(str::to_ascii_lowercase).as_deref() {
        Some("3") => Ok(Geometry::Vertices),
        Some("3a") => Ok(Geometry::Planes),
        other => wrong(
            line,
            format!("geometry `{}` is not known", other.unwrap_or("")),
            "three dimensions are F 3 (vertices) and F 3a (planes)",
        ),
    }
}

fn in_sequence(
    line: usize,
    what: &str,
    word: Option<&&str>,
    before: usize,
    remedy: &str,
) -> Result<(), Wrong> {
    let number = whole(line, word, &format!("number of the {what}"), remedy)?;
    if number != before + 1 {
        return wrong(
            line,
            format!("{what} {number} comes after {what} {before}"),
            &format!("number every {what} in order, from 1"),
        );
    }
    Ok(())
}

fn vertex(line: usize, words: &[&str], before: usize) -> Result<DVec3, Wrong> {
    in_sequence(line, "vertex", words.first(), before, VERTEX)?;
    let [x, y, z] = words
        .get(1..4)
        .and_then(|w| <[&str; 3]>::try_from(w).ok())
        .map_or_else(|| wrong(line, "a vertex has three coordinates".into(), VERTEX), Ok)?;
    Ok(DVec3::new(coordinate(line, x)?, coordinate(line, y)?, coordinate(line, z)?))
}

/// A surface by vertices, and the numbers of these.
fn surface(
    line: usize,
    kind: Kind,
    words: &[&str],
    before: usize,
) -> Result<(RawSurface, Vec<usize>), Wrong> {
    in_sequence(line, "surface", words.first(), before, SURFACE)?;
    let mut numbers = Vec::with_capacity(4);
    for k in 1..=4 {
        numbers.push(whole(line, words.get(k), "number of a vertex", SURFACE)?);
    }
    if numbers[3] == 0 {
        numbers.pop();
    }
    Ok((common(line, kind, words.get(5..).unwrap_or(&[]), SURFACE)?, numbers))
}

/// Base, combination, emittance and name.
fn common(line: usize, kind: Kind, words: &[&str], remedy: &str) -> Result<RawSurface, Wrong> {
    let mut out = RawSurface {
        line,
        kind,
        corners: Vec::new(),
        base: None,
        combined_with: None,
        emittance: 1.0,
        name: None,
    };
    if kind == Kind::Obstruction {
        // The rest of the line is free.
        return Ok(out);
    }
    out.base = whole(line, words.first(), "base surface", remedy)?.checked_sub(1);
    out.combined_with = whole(line, words.get(1), "combined surface", remedy)?.checked_sub(1);
    match words.get(2) {
        Some(word) => out.emittance = number(line, word)?,
        None => return wrong(line, "the emittance is missing".into(), remedy),
    }
    if !(0.0..=1.0).contains(&out.emittance) {
        return wrong(line, format!("the emittance is {}", out.emittance), "give 0.001 to 0.999");
    }
    out.name = words.get(3).map(|name| (*name).to_owned());
    if kind == Kind::Null && out.base.is_none() {
        return wrong(
            line,
            "a null surface needs a base".into(),
            "name the surface that it is a hole in",
        );
    }
    Ok(out)
}

/// A surface by a shape in a plane of its own: origin, azimuth (clockwise from +y) and tilt (0 faces
/// up, 90 is vertical) in degrees.
fn plane_surface(
    line: usize,
    kind: Kind,
    words: &[&str],
    before: usize,
    all: &mut Words<'_>,
) -> Result<RawSurface, Wrong> {
    in_sequence(line, "surface", words.first(), before, PLANE_SURFACE)?;
    let shape = words.get(1).map(|w| w.to_ascii_uppercase());
    let mut out = common(line, kind, words.get(2..).unwrap_or(&[]), PLANE_SURFACE)?;
    let count = match shape.as_deref() {
        Some("R") => 2,
        Some("T") => 6,
        Some("Q") => 8,
        other => {
            let what = format!("the shape is `{}`", other.unwrap_or(""));
            return wrong(
                line,
                what,
                "shapes are R (rectangle), T (triangle) and Q (quadrilateral)",
            );
        }
    };
    let n = all.numbers(5 + count, line)?;
    let (azimuth, tilt) = (n[3].to_radians(), n[4].to_radians());
    let (sa, ca) = libm::sincos(azimuth);
    let (st, ct) = libm::sincos(tilt);
    let (along, up) = (DVec3::new(-ca, sa, 0.0), DVec3::new(-ct * sa, -ct * ca, st));
    let flat: Vec<DVec2> = match n[5..] {
        [w, h] => [(0.0, h), (0.0, 0.0), (w, 0.0), (w, h)].map(DVec2::from).to_vec(),
        ref pairs => pairs.chunks(2).map(|p| DVec2::new(p[0], p[1])).collect(),
    };
    let origin = DVec3::new(n[0], n[1], n[2]);
    out.corners = flat.iter().map(|p| origin + along * p.x + up * p.y).collect();
    Ok(out)
}
