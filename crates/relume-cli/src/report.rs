//! The report of a run, `relume-report/1`: what was solved, how, and what every frame took.
//!
//! Knows the format and nothing of how frames are made. Finished frames are kept as the text they
//! were written in, so that a resumed run repeats them to the last digit.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use relume::export::write_atomically;
use relume::scene::Scene;
use relume::session::FrameReport;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::value::RawValue;

use crate::args::Shading;
use crate::failure::Failure;
use crate::interrupt;
use crate::scene_file;

/// Name of the format.
pub(crate) const SCHEMA: &str = "relume-report/1";

/// The whole file.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Report {
    /// [`SCHEMA`].
    pub(crate) schema: String,
    /// Version of the program.
    pub(crate) version: String,
    /// What was solved.
    pub(crate) scene: SceneSummary,
    /// How.
    pub(crate) options: RunOptions,
    /// Frame number to [`FrameReport`], written as a list in frame order.
    #[serde(serialize_with = "as_list", deserialize_with = "from_list")]
    pub(crate) frames: BTreeMap<u32, Box<RawValue>>,
    /// Most memory the process has held, bytes.
    pub(crate) peak_memory_bytes: u64,
}

/// What was solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SceneSummary {
    /// Name of the scene.
    pub(crate) name: String,
    /// Rigid groups.
    pub(crate) bodies: usize,
    /// Planar polygons; a double-sided one counts twice.
    pub(crate) patches: usize,
    /// Sum of the patches' areas, m2.
    pub(crate) area_m2: f64,
    /// World bounds at the start of the animation, metres; absent while nothing is present.
    pub(crate) bounds: Option<Bounds>,
    /// Hash over the bytes of the scene file and the files it refers to.
    pub(crate) content: String,
}

/// A box in the world, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bounds {
    /// Smallest coordinates.
    pub(crate) min: [f64; 3],
    /// Largest coordinates.
    pub(crate) max: [f64; 3],
}

/// How a scene was solved and drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RunOptions {
    /// Frames asked for, as on the command line; `all` without that.
    pub(crate) frames: String,
    /// Frames a second.
    pub(crate) fps: f64,
    /// Animation chosen by name.
    pub(crate) animation: Option<String>,
    /// What of the scene was changed, as on the command line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) edits: Vec<String>,
    /// Relative error of irradiance aimed at.
    pub(crate) tolerance: f64,
    /// The oracle, as on the command line.
    pub(crate) oracle: String,
    /// The update strategy, as on the command line.
    pub(crate) update: String,
    /// Threads used.
    pub(crate) threads: usize,
    /// Limit on the memory of the process.
    pub(crate) max_memory_bytes: Option<u64>,
    /// Light beside the scene's own, as on the command line: asked for, or chosen for pictures.
    #[serde(default)]
    pub(crate) outside: Option<String>,
    /// How pictures were drawn, if they were.
    pub(crate) picture: Option<PictureOptions>,
}

/// How pictures were drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PictureOptions {
    /// Width x height, pixels.
    pub(crate) size: String,
    /// Shading.
    pub(crate) shading: Shading,
    /// Camera chosen by name.
    pub(crate) camera: Option<String>,
    /// What else was said of the view, as on the command line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) view: Vec<String>,
    /// Exposure asked for: `auto` or stops.
    pub(crate) exposure: String,
    /// Exposure used, stops: display value = radiance (W/m2/sr) x 2^EV. `None` until it is known.
    pub(crate) exposure_ev: Option<f64>,
    /// Whether the elements' outlines were drawn.
    pub(crate) mesh: bool,
    /// Whether the light of every element was found anew from all links above it.
    #[serde(default)]
    pub(crate) reconstruct: bool,
    /// Whether the light of lamps was found exactly at every pixel.
    #[serde(default)]
    pub(crate) cleanup: bool,
}

/// A frame as it is written down.
#[derive(Serialize)]
struct Entry<'a> {
    #[serde(flatten)]
    frame: &'a FrameReport,
    /// Share of what is emitted that is unaccounted for: 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    unbalanced: Option<f64>,
    /// Digest of the bytes of its picture, 16 hexadecimal digits.
    #[serde(skip_serializing_if = "Option::is_none")]
    picture: Option<&'a str>,
}

/// What of an entry is asked for after it is written.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct Finished {
    /// Share of what is emitted that is unaccounted for: 1.
    #[serde(default)]
    pub(crate) unbalanced: f64,
    /// Surfaces that receive more than they can.
    #[serde(default)]
    pub(crate) suspects: Vec<String>,
    /// Digest of the bytes of its picture.
    #[serde(default)]
    pub(crate) picture: Option<String>,
}

/// The number of a frame, from its entry; an entry without a hash is none.
#[derive(Deserialize)]
struct Numbered {
    frame: u32,
    #[serde(rename = "hash")]
    _hash: String,
}

fn as_list<S: Serializer>(
    frames: &BTreeMap<u32, Box<RawValue>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(frames.values())
}

fn from_list<'de, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<u32, Box<RawValue>>, D::Error> {
    let list = Vec::<Box<RawValue>>::deserialize(deserializer)?;
    let number = |entry: &RawValue| serde_json::from_str::<Numbered>(entry.get()).map(|n| n.frame);
    list.into_iter()
        .map(|entry| Ok((number(&entry).map_err(serde::de::Error::custom)?, entry)))
        .collect()
}

impl SceneSummary {
    /// Measures a scene; `content` is the hash of its files.
    pub(crate) fn new(scene: &Scene, content: String) -> SceneSummary {
        SceneSummary {
            name: scene.name.clone(),
            bodies: scene.bodies.len(),
            patches: scene.patches.len(),
            area_m2: scene.area_m2(),
            bounds: scene.bounds(0.0).map(|bounds| {
                let (min, max) = (scene.origin + bounds.lo, scene.origin + bounds.hi);
                Bounds { min: min.to_array(), max: max.to_array() }
            }),
            content,
        }
    }
}

impl Report {
    /// A report without frames.
    pub(crate) fn new(scene: SceneSummary, options: RunOptions) -> Report {
        Report {
            schema: SCHEMA.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene,
            options,
            frames: BTreeMap::new(),
            peak_memory_bytes: 0,
        }
    }

    /// Adds a finished frame, with the digest of its picture if it has one.
    ///
    /// JSON has no infinities; a field that is not finite would be written as null, so it is an
    /// error that names the frame.
    pub(crate) fn add(
        &mut self,
        frame: &FrameReport,
        picture: Option<&str>,
    ) -> Result<(), Failure> {
        let broken = |what: &str| {
            Failure::new(format_args!("the report of frame {} {what}", frame.frame))
                .help("this is a defect of relume: please report it with the scene")
        };
        let unbalanced = frame.energy.map(|energy| energy.unbalanced());
        let entry = Entry { frame, unbalanced, picture };
        let value = serde_json::to_value(&entry).map_err(|_| broken("cannot be written"))?;
        if holds_null(&value) {
            return Err(broken("holds a number that is not finite"));
        }
        // Not `value`'s text: that would put the fields into another order.
        let text = serde_json::to_string(&entry).map_err(|_| broken("cannot be written"))?;
        let raw = RawValue::from_string(text).map_err(|_| broken("cannot be written"))?;
        self.frames.insert(frame.frame, raw);
        Ok(())
    }

    /// What is asked for of a finished frame; of one that is not, as if there were nothing to say.
    pub(crate) fn finished(&self, frame: u32) -> Finished {
        let entry = self.frames.get(&frame);
        entry.and_then(|raw| serde_json::from_str(raw.get()).ok()).unwrap_or_default()
    }

    /// Reads a report; `None` if there is no such file.
    pub(crate) fn read(path: &Path) -> Result<Option<Report>, Failure> {
        if fs::symlink_metadata(path).is_err_and(|e| e.kind() == std::io::ErrorKind::NotFound) {
            return Ok(None);
        }
        let bytes = scene_file::read(path)?;
        let text = String::from_utf8_lossy(&bytes);
        match serde_json::from_str::<Report>(&text) {
            Ok(report) if report.schema == SCHEMA => Ok(Some(report)),
            Ok(report) => Err(Failure::new(format_args!(
                "{} has the format {}, not {SCHEMA}",
                path.display(),
                report.schema
            ))
            .help("resume with the version of relume that wrote it, or leave out --resume")),
            Err(error) => Err(Failure::new(format_args!(
                "{} is not a report of relume: {error}",
                path.display()
            ))
            .help("delete it or leave out --resume to start anew")),
        }
    }

    /// Writes the report, whole or not at all.
    pub(crate) fn write(&self, path: &Path) -> Result<(), Failure> {
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|error| Failure::new(format_args!("cannot write the report: {error}")))?;
        text.push('\n');
        let _guard = interrupt::writing();
        write_atomically(path, text.as_bytes()).map_err(|error| Failure::write(path, &error))
    }
}

/// Whether there is a null anywhere in a value.
fn holds_null(value: &serde_json::Value) -> bool {
    match value {
        serde_json::Value::Null => true,
        serde_json::Value::Array(items) => items.iter().any(holds_null),
        serde_json::Value::Object(fields) => fields.values().any(holds_null),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use relume::session::Energy;

    use super::*;

    pub(crate) fn report() -> Report {
        let scene = SceneSummary {
            name: "room".into(),
            bodies: 2,
            patches: 7,
            area_m2: 54.49,
            bounds: Some(Bounds { min: [0.0; 3], max: [3.0; 3] }),
            content: "00ff".into(),
        };
        let options = RunOptions {
            frames: "0-4".into(),
            fps: 24.0,
            animation: None,
            edits: Vec::new(),
            tolerance: 0.02,
            oracle: "error".into(),
            update: "scratch".into(),
            threads: 2,
            max_memory_bytes: None,
            outside: None,
            picture: None,
        };
        Report::new(scene, options)
    }

    #[test]
    fn what_is_written_is_read_to_the_last_digit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("report.json");
        let mut report = report();
        let third = 1.0 / 3.0;
        for frame in [7, 2] {
            let mut entry = FrameReport::default();
            (entry.frame, entry.time_s) = (frame, third);
            report.add(&entry, None).unwrap();
        }
        report.write(&path).unwrap();
        let back = Report::read(&path).unwrap().unwrap();
        assert_eq!(back.frames.keys().copied().collect::<Vec<_>>(), [2, 7]);
        let first = fs::read(&path).unwrap();
        back.write(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), first);
    }

    #[test]
    fn an_entry_says_what_is_unaccounted_for_and_has_the_digest_of_its_picture() {
        let mut report = report();
        let energy = Energy { emitted_w: 50.0, absorbed_w: 48.0, escaped_w: 0.0 };
        let mut frame = FrameReport::default();
        (frame.frame, frame.energy, frame.suspects) = (3, Some(energy), vec!["shelf".to_owned()]);
        report.add(&frame, Some("00ff")).unwrap();
        let found = report.finished(3);
        assert_eq!((found.unbalanced, found.picture.as_deref()), (0.04, Some("00ff")));
        assert_eq!(found.suspects, ["shelf"]);
        assert_eq!(report.finished(4).picture, None);
    }

    #[test]
    fn a_number_that_is_not_finite_is_refused() {
        let mut frame = FrameReport::default();
        frame.residual = f64::INFINITY;
        assert!(report().add(&frame, None).is_err());
    }

    #[test]
    fn other_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("report.json");
        assert!(Report::read(&path).unwrap().is_none());
        for text in ["", "{}", "{\"schema\": 3", "[1, 2]"] {
            fs::write(&path, text).unwrap();
            assert!(Report::read(&path).is_err(), "{text}");
        }
        let mut other = report();
        other.schema = "relume-report/9".into();
        other.write(&path).unwrap();
        assert!(Report::read(&path).unwrap_err().to_string().contains("relume-report/9"));
    }
}
