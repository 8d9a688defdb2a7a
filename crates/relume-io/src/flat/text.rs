//! Scenes in the plane as text, a line for each thing.
//!
//! ```text
//! # comments begin like this
//! body room                             # what follows belongs to it and moves with it
//! segment floor 0 0 2 0 reflectance 0.6
//! body lamp
//! at 0  0.5 0.9                         # time, place of its origin, and by how many degrees it is turned
//! at 2  1.5 0.9 90
//! segment lamp 0.1 0 -0.1 0 emit 10     # in the body's frame; its front is on the left
//! polygon box 0 0 0 1 1 1 1 0 reflectance 0.5,0.2,0.2
//! ```
//!
//! `two-sided` makes the back of a segment like its front; otherwise it is black and blocks. A polygon is
//! closed; its fronts are outside if its corners go clockwise. Lengths are metres, times seconds.

use glam::DVec2;

use super::size::{self, SEGMENTS_MAX};
use relume_core::flat::{FlatScene, Key, Material, Motion, SceneError, Segment};
use relume_core::scene::limits::{COORDINATE_MAX_M, is_place};

/// Error in the text of a scene, with its line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct TextError {
    /// Number of the line, from 1.
    pub line: usize,
    /// What is wrong there.
    pub what: String,
}

/// A body whose keys are still being read.
struct Begun {
    name: String,
    keys: Vec<Key>,
    line: usize,
}

/// Reads a scene.
///
/// # Errors
/// The first line that is wrong.
pub fn parse(text: &str) -> Result<FlatScene, TextError> {
    let mut scene = FlatScene::new();
    let mut begun: Option<Begun> = None;
    let mut last = 1;
    for (k, line) in text.lines().enumerate() {
        let number = k + 1;
        let words: Vec<&str> = line.split('#').next().unwrap_or("").split_whitespace().collect();
        let Some((&first, rest)) = words.split_first() else { continue };
        last = number;
        match first {
            "body" => {
                settle(&mut scene, begun.take())?;
                let [name] = rest else { return Err(wrong(number, "write `body NAME`")) };
                begun = Some(Begun { name: (*name).to_owned(), keys: Vec::new(), line: number });
            }
            "at" => {
                let key = key(rest).map_err(|what| TextError { line: number, what })?;
                let body = begun.as_mut().ok_or_else(|| {
                    wrong(number, "`at` follows a line `body NAME`, before its segments")
                })?;
                body.keys.push(key);
            }
            "segment" | "polygon" => {
                settle(&mut scene, begun.take())?;
                shape(&mut scene, first, rest).map_err(|what| TextError { line: number, what })?;
                if scene.walls().len() > SEGMENTS_MAX {
                    return Err(TextError { line: number, what: size::said() });
                }
            }
            other => {
                let what = format!("`{other}` is not known: write body, at, segment or polygon");
                return Err(TextError { line: number, what });
            }
        }
    }
    settle(&mut scene, begun.take())?;
    scene.check().map_err(|error| at_line(last, &error))?;
    Ok(scene)
}

fn wrong(line: usize, what: &str) -> TextError {
    TextError { line, what: what.to_owned() }
}

fn at_line(line: usize, error: &SceneError) -> TextError {
    TextError { line, what: error.to_string() }
}

fn settle(scene: &mut FlatScene, begun: Option<Begun>) -> Result<(), TextError> {
    let Some(Begun { name, keys, line }) = begun else { return Ok(()) };
    scene.body(&name, Motion::new(keys)).map(|_| ()).map_err(|error| at_line(line, &error))
}

fn number(word: &str) -> Result<f64, String> {
    let value = word.parse::<f64>().ok().filter(|x| x.is_finite());
    value.ok_or_else(|| format!("`{word}` is not a number"))
}

/// A number that is a coordinate.
fn coordinate(word: &str) -> Result<f64, String> {
    let value = number(word)?;
    if !is_place(&[value]) {
        return Err(format!(
            "`{word}` is larger than {COORDINATE_MAX_M:e} m: give places nearer to the origin"
        ));
    }
    Ok(value)
}

fn key(words: &[&str]) -> Result<Key, String> {
    let numbers =
        words.iter().map(|word| coordinate(word)).collect::<Result<Vec<f64>, String>>()?;
    let (time_s, x, y, degrees) = match numbers[..] {
        [time_s, x, y] => (time_s, x, y, 0.0),
        [time_s, x, y, degrees] => (time_s, x, y, degrees),
        _ => return Err("write `at TIME X Y` or `at TIME X Y DEGREES`".into()),
    };
    Ok(Key { time_s, place: DVec2::new(x, y), angle: degrees.to_radians() })
}

fn shape(scene: &mut FlatScene, kind: &str, words: &[&str]) -> Result<(), String> {
    let Some((name, words)) = words.split_first() else {
        return Err(format!("write `{kind} NAME` and its corners"));
    };
    let is_number = |word: &&&str| word.parse::<f64>().is_ok();
    let count = words.iter().take_while(is_number).count();
    let (corners, options) = words.split_at(count);
    let numbers =
        corners.iter().map(|word| coordinate(word)).collect::<Result<Vec<f64>, String>>()?;
    let material = material(options)?;
    let points: Vec<DVec2> = numbers.chunks(2).map(|p| DVec2::new(p[0], p[p.len() - 1])).collect();
    let enough = count % 2 == 0
        && match kind {
            "segment" => points.len() == 2,
            _ => points.len() >= 3,
        };
    if !enough {
        return Err(match kind {
            "segment" => format!("segment `{name}` has {count} numbers: it needs x0 y0 x1 y1"),
            _ => format!(
                "polygon `{name}` has {count} numbers: it needs x y for each of three corners or more"
            ),
        });
    }
    let made = match kind {
        "segment" => scene.wall(name, Segment::new(points[0], points[1]), material).map(|_| ()),
        _ => scene.polygon(name, &points, material),
    };
    made.map_err(|error| error.to_string())
}

fn material(words: &[&str]) -> Result<Material, String> {
    let mut material = Material::grey(0.5);
    let mut words = words.iter();
    while let Some(&word) = words.next() {
        let mut value = || channels(word, words.next().copied());
        match word {
            "reflectance" => material.reflectance = value()?,
            "emit" => material.exitance = value()?,
            "two-sided" => material.two_sided = true,
            other => {
                return Err(format!(
                    "`{other}` is not known: write reflectance R, emit M or two-sided"
                ));
            }
        }
    }
    Ok(material)
}

/// `0.5` or `0.5,0.2,0.1`.
pub(super) fn channels(what: &str, word: Option<&str>) -> Result<[f64; 3], String> {
    let Some(word) = word else { return Err(format!("`{what}` needs a number")) };
    let parts = word.split(',').map(number).collect::<Result<Vec<f64>, String>>()?;
    match parts[..] {
        [grey] => Ok([grey; 3]),
        [red, green, blue] => Ok([red, green, blue]),
        _ => Err(format!("`{word}`: write one number, or three as 0.5,0.2,0.1")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_read() {
        let text = "segment floor 0 0 2 0 reflectance 0.6 # grey\n\nbody lamp\nat 0 0.5 0.9\n\
                    at 2 1.5 0.9 90\nsegment lamp 0.1 0 -0.1 0 emit 10,5,1 two-sided\n\
                    polygon box 0 0 0 1 1 1 1 0\n";
        let scene = parse(text).unwrap();
        assert_eq!((scene.bodies().len(), scene.walls().len()), (2, 6));
        assert_eq!(scene.bodies()[0].name, "scene");
        assert_eq!(scene.walls()[1].material.exitance, [10.0, 5.0, 1.0]);
        assert!(scene.walls()[1].material.two_sided);
        assert_eq!(scene.walls()[5].name, "box.4");
        assert_eq!(scene.bodies()[1].motion.pose(1.0).origin, DVec2::new(1.0, 0.9));
        assert_eq!(scene.duration_s(), 2.0);
    }

    #[test]
    fn what_is_too_large_is_refused_at_the_line_that_is_one_too_many() {
        let lines = |count: usize| -> String {
            (0..count).map(|k| format!("segment s{k} {k} 0 {k}.9 0\n")).collect()
        };
        assert!(parse(&lines(SEGMENTS_MAX)).is_ok());
        let error = parse(&lines(SEGMENTS_MAX + 9)).unwrap_err();
        assert_eq!(error.line, SEGMENTS_MAX + 1);
        assert!(error.what.contains("more than 8192 segments"), "{error}");
    }

    #[test]
    fn errors_name_the_line() {
        for (text, line, what) in [
            ("segment floor 0 0 2 0\nsegment wall 0 0 2", 2, "needs x0 y0 x1 y1"),
            ("segment floor 0 0 2 0 emitt 3", 1, "`emitt` is not known"),
            ("\nwall w 0 0 1 1", 2, "`wall` is not known"),
            ("segment p 0 0 0 0", 1, "no length"),
            ("segment p 0 0 1 0 reflectance 1", 1, "[0, 1)"),
            ("segment p 0 0 1 0 emit", 1, "needs a number"),
            ("at 0 0 0", 1, "follows a line"),
            ("body b\nat 1 0 0\nat 0 0 0\nsegment p 0 0 1 0", 1, "ascend"),
            ("body b\nat 0 0\nsegment p 0 0 1 0", 2, "write `at"),
            ("body b\nbody c\nsegment p 0 0 1 0", 3, "has no segments"),
            ("polygon p 0 0 1 0", 1, "three corners"),
            ("# nothing", 1, "no segments"),
            ("segment p 0 0 1e300 0", 1, "`1e300` is larger than 1e12 m"),
            ("segment p 0 0 nan 0", 1, "`nan` is not a number"),
            ("segment p 1e6 0 1e6 1e-10", 1, "no length"),
            ("segment p 0 0 1 0 emit 1e38", 1, "between 0 and 1e30"),
            ("body b\nat 0 1e300 0\nsegment p 0 0 1 0", 2, "`1e300` is larger than 1e12 m"),
        ] {
            let error = parse(text).unwrap_err();
            assert_eq!(error.line, line, "{text}: {error}");
            assert!(error.what.contains(what), "{text}: {error}");
        }
    }
}
