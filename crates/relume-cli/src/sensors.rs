//! Sensors as users write them: text lines `x y z nx ny nz`, or CSV with those columns and, if
//! wanted, `name` and `body`. Knows no scene; whatever can be judged from the text alone is judged
//! here, with the number of the line.

use std::collections::BTreeSet;
use std::path::Path;

use glam::DVec3;
use relume::scene::limits::{COORDINATE_MAX_M, is_place};

use crate::failure::Failure;
use crate::scene_file;

/// A sensor as it is written down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    /// Line of the file, from 1.
    pub(crate) line: u64,
    /// Unique: the name given, or the number of the sensor from 0.
    pub(crate) name: String,
    /// The body that it rides on.
    pub(crate) body: Option<String>,
    /// Place in the world (for one that rides: where it is at the start of the animation), metres.
    pub(crate) at: DVec3,
    /// Unit normal, likewise.
    pub(crate) normal: DVec3,
}

/// What a file of sensors holds.
#[derive(Debug, PartialEq)]
pub(crate) struct Sensors {
    /// In the order of the file.
    pub(crate) entries: Vec<Entry>,
    /// Names that were given twice, and what the later ones are called.
    pub(crate) renamed: Vec<(String, String)>,
}

/// What is wrong with a line, and what to do about it.
type Flaw = (u64, String, &'static str);

/// The columns that every sensor has.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

const SIX: &str = "write six numbers a line, x y z nx ny nz, in metres; # begins a comment";

/// Reads a file of sensors.
pub(crate) fn read(path: &Path) -> Result<Sensors, Failure> {
    let bytes = scene_file::read(path)?;
    let text = String::from_utf8(bytes).map_err(|_| {
        Failure::new(format_args!("{} is not text", path.display()))
            .help("sensors are lines of text: x y z nx ny nz")
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    parse(text).map_err(|(line, what, remedy)| failure(path, line, &what).help(remedy))
}

/// An error about a line of a file.
pub(crate) fn failure(path: &Path, line: u64, what: &str) -> Failure {
    match line {
        0 => Failure::new(format_args!("{}: {what}", path.display())),
        _ => Failure::new(format_args!("{}, line {line}: {what}", path.display())),
    }
}

fn parse(text: &str) -> Result<Sensors, Flaw> {
    let code = |line: &str| line.split('#').next().unwrap_or("").trim().to_owned();
    let first = text.lines().map(code).find(|line| !line.is_empty());
    let raw = match first {
        // Numbers hold letters too: 1e-3, inf, nan. A heading has columns of other words.
        Some(line) if line.contains(',') || line.split_whitespace().any(|w| w == "x") => {
            table(text)?
        }
        _ => lines(text)?,
    };
    if raw.is_empty() {
        return Err((0, "there is no sensor in it".into(), SIX));
    }
    let mut taken = BTreeSet::new();
    let mut renamed = Vec::new();
    let mut entries = Vec::with_capacity(raw.len());
    for (number, raw) in raw.into_iter().enumerate() {
        let [x, y, z, nx, ny, nz] = raw.numbers;
        let (at, normal) = (DVec3::new(x, y, z), DVec3::new(nx, ny, nz));
        if let Some(k) = raw.numbers.iter().position(|v| !v.is_finite()) {
            let what = format!("{} is {}", COLUMNS[k], raw.numbers[k]);
            return Err((raw.line, what, "give finite numbers, in metres"));
        }
        if let Some(k) = raw.numbers[..3].iter().position(|&v| !is_place(&[v])) {
            let what =
                format!("{} is {:e}, more than {COORDINATE_MAX_M:e} m", COLUMNS[k], raw.numbers[k]);
            return Err((raw.line, what, "give places in metres, nearer to the scene"));
        }
        // Of a vector too long or too short to be squared the direction is still known.
        let scaled = normal / normal.abs().max_element();
        if !scaled.is_finite() {
            let remedy = "give the direction that the sensor faces: 0 0 1 is up along z";
            return Err((raw.line, "the normal is 0 0 0".into(), remedy));
        }
        let wanted = raw.name.unwrap_or_else(|| number.to_string());
        let name = unique(&mut taken, &wanted);
        if name != wanted {
            renamed.push((wanted, name.clone()));
        }
        entries.push(Entry {
            line: raw.line,
            name,
            body: raw.body,
            at,
            normal: scaled.normalize(),
        });
    }
    Ok(Sensors { entries, renamed })
}

/// `wanted`, or `wanted` with the first free number behind it.
fn unique(taken: &mut BTreeSet<String>, wanted: &str) -> String {
    let mut name = wanted.to_owned();
    let mut number = 1;
    while !taken.insert(name.clone()) {
        number += 1;
        name = format!("{wanted} {number}");
    }
    name
}

/// A line before its numbers are judged.
struct Raw {
    line: u64,
    numbers: [f64; 6],
    name: Option<String>,
    body: Option<String>,
}

fn number(line: u64, word: &str) -> Result<f64, Flaw> {
    word.parse().map_err(|_| (line, format!("`{word}` is not a number"), SIX))
}

/// `x y z nx ny nz`, one sensor a line.
fn lines(text: &str) -> Result<Vec<Raw>, Flaw> {
    let mut out = Vec::new();
    for (line, content) in (1..).zip(text.lines()) {
        let words: Vec<&str> = content.split('#').next().unwrap_or("").split_whitespace().collect();
        if words.is_empty() {
            continue;
        }
        if words.len() != 6 {
            return Err((line, format!("there are {} numbers instead of 6", words.len()), SIX));
        }
        let mut numbers = [0.0; 6];
        for (value, word) in numbers.iter_mut().zip(words) {
            *value = number(line, word)?;
        }
        out.push(Raw { line, numbers, name: None, body: None });
    }
    Ok(out)
}

/// CSV with a heading; columns in any order.
fn table(text: &str) -> Result<Vec<Raw>, Flaw> {
    let heading =
        "begin with a line that names the columns: x,y,z,nx,ny,nz, and name,body if wanted";
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let broken = |error: csv::Error| {
        let line = error.position().map_or(0, csv::Position::line);
        let what = match error.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("there are {len} columns instead of {expected_len}")
            }
            _ => "it is not CSV".to_owned(),
        };
        (line, what, "write as many columns as the heading has, text with commas in \"quotes\"")
    };
    let names = reader.headers().map_err(broken)?.clone();
    let place = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    let mut columns = [0; 6];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        *column = place(name).ok_or_else(|| (1, format!("there is no column {name}"), heading))?;
    }
    let (name, body) = (place("name"), place("body"));
    let mut out = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut numbers = [0.0; 6];
        for (value, column) in numbers.iter_mut().zip(columns) {
            *value = number(line, &record[column])?;
        }
        let text = |column: Option<usize>| {
            column.map(|c| record[c].to_owned()).filter(|text| !text.is_empty())
        };
        out.push(Raw { line, numbers, name: text(name), body: text(body) });
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(text: &str) -> Vec<Entry> {
        parse(text).unwrap().entries
    }

    #[test]
    fn lines_of_six_numbers_are_sensors() {
        let found = entries("# a grid\n0 1 2  0 0 2 # up\n\n\t1e-3 0 0 0 -1 0\r\n");
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].line, found[0].name.as_str()), (2, "0"));
        assert_eq!((found[0].at, found[0].normal), (DVec3::new(0.0, 1.0, 2.0), DVec3::Z));
        assert_eq!((found[1].line, found[1].name.as_str()), (4, "1"));
        assert_eq!((found[1].at.x, found[1].normal), (1e-3, DVec3::NEG_Y));
        assert_eq!(entries("0 0 0 0 1e-300 0")[0].normal, DVec3::Y);
        assert_eq!(entries("0 0 0 0 1e300 0")[0].normal, DVec3::Y);
    }

    #[test]
    fn tables_have_their_columns_in_any_order_and_may_name_sensors_and_bodies() {
        let found = parse(
            "# made by hand\nname, NX,ny,nz,x,y,z,body\n\"a, b\",0,0,1,1,2,3,\n,1,0,0,4,5,6,arm\n\
             \"a, b\",0,1,0,7,8,9,arm\n",
        )
        .unwrap();
        let names: Vec<&str> = found.entries.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["a, b", "1", "a, b 2"]);
        assert_eq!(found.renamed, [("a, b".to_owned(), "a, b 2".to_owned())]);
        assert_eq!(found.entries[0].at, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(found.entries[0].body, None);
        assert_eq!((found.entries[1].line, found.entries[1].body.as_deref()), (4, Some("arm")));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line_and_a_remedy() {
        for (text, line, what) in [
            ("", 0, "no sensor"),
            ("# nothing\n\n", 0, "no sensor"),
            ("x,y,z,nx,ny,nz\n", 0, "no sensor"),
            ("0 0 0 0 0 1\n\n0 0 0 0 1\n", 3, "5 numbers instead of 6"),
            ("0 0 0 0 0 up", 1, "`up` is not a number"),
            ("0 0 0 0 0 1\n0 nan 0 0 0 1", 2, "y is NaN"),
            ("0 0 0 0 0 inf", 1, "nz is inf"),
            ("#\n0 0 0 0 0 0", 2, "the normal is 0 0 0"),
            ("0,0,0,0,0,1", 1, "no column x"),
            ("x,y,z,nx,ny\n0,0,0,0,0", 1, "no column nz"),
            ("x,y,z,nx,ny,nz\n0,0,0,0,0,1\n0,0,0,0,1\n", 3, "5 columns instead of 6"),
            ("x,y,z,nx,ny,nz\n0,0,a,0,0,1\n", 2, "`a` is not a number"),
            ("0 0 0 0 0 1\n0 -1e300 0 0 0 1", 2, "y is -1e300"),
            ("x,y,z,nx,ny,nz\n0,0,0,0,0,0\n", 2, "the normal is 0 0 0"),
        ] {
            let (at, said, remedy) = parse(text).unwrap_err();
            assert!(at == line && said.contains(what) && !remedy.is_empty(), "{text}: {at} {said}");
        }
    }
}
