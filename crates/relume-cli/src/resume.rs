//! Whether an earlier run may be continued: the same scene, the same options.
//!
//! What may differ: the frames asked for, the number of threads and the memory limit, since none
//! of them changes a bit of a frame that was finished.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::failure::Failure;
use crate::report::Report;
use crate::scene_file;

/// Fields that may differ between the runs.
const FREE: [&str; 4] = [
    "options.frames",
    "options.threads",
    "options.max_memory_bytes",
    // Taken from the earlier run; what was asked for is compared.
    "options.picture.exposure_ev",
];

/// Takes over what `earlier`, read from `path`, has finished, after checking that it belongs to
/// the same scene and options as `now`.
///
/// `is_whole` tells whether the files of a frame are there, as the earlier run left them.
pub(crate) fn take_over(
    now: &mut Report,
    earlier: Report,
    path: &Path,
    is_whole: impl Fn(u32, Option<&str>) -> bool,
) -> Result<(), Failure> {
    let differences = differences(&earlier, now);
    if !differences.is_empty() {
        return Err(Failure::new(format_args!(
            "cannot resume from {}: {}",
            path.display(),
            differences.join("; ")
        ))
        .help(
            "use the scene and options of the earlier run, or leave out --resume to start anew",
        ));
    }
    if let (Some(now), Some(then)) = (&mut now.options.picture, &earlier.options.picture) {
        now.exposure_ev = then.exposure_ev;
    }
    let whole: BTreeSet<u32> = earlier
        .frames
        .keys()
        .copied()
        .filter(|&frame| is_whole(frame, earlier.finished(frame).picture.as_deref()))
        .collect();
    now.frames = earlier.frames.into_iter().filter(|(frame, _)| whole.contains(frame)).collect();
    now.peak_memory_bytes = earlier.peak_memory_bytes;
    Ok(())
}

/// What differs, in words, one entry a field.
fn differences(then: &Report, now: &Report) -> Vec<String> {
    if then.scene.content != now.scene.content {
        return vec!["the scene file, a file it refers to or the environment has changed".into()];
    }
    let fields = |report: &Report| {
        let mut fields = Vec::new();
        let value = serde_json::json!({ "options": report.options, "version": report.version });
        flatten(String::new(), &value, &mut fields);
        fields
    };
    let (then, now) = (fields(then), fields(now));
    let value_of = |fields: &[(String, String)], key: &str| {
        fields.iter().find(|f| f.0 == key).map_or("nothing".to_owned(), |f| f.1.clone())
    };
    let mut keys: Vec<&String> = then.iter().chain(&now).map(|f| &f.0).collect();
    keys.sort();
    keys.dedup();
    keys.into_iter()
        .filter(|key| !FREE.contains(&key.as_str()))
        .filter_map(|key| {
            let (then, now) = (value_of(&then, key), value_of(&now, key));
            let name = key.trim_start_matches("options.").trim_start_matches("picture.");
            (then != now).then(|| format!("{name} was {then} and is {now} now"))
        })
        .collect()
}

/// Leaves of a JSON value with dotted names; null counts as not there.
fn flatten(name: String, value: &Value, into: &mut Vec<(String, String)>) {
    match value {
        Value::Null => {}
        Value::Object(map) => {
            for (key, value) in map {
                let inner = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                flatten(inner, value, into);
            }
        }
        Value::String(text) => into.push((name, text.clone())),
        other => into.push((name, other.to_string())),
    }
}

/// Hash over the bytes of a scene file, of the files it refers to and of the environment that lights it, 16 hexadecimal
/// digits.
///
/// FNV-1a over 64 bits: it tells an edited file from the same one, and is no protection against
/// somebody who wants to deceive.
pub(crate) fn content_hash(scene: &Path, environment: Option<&Path>) -> Result<String, Failure> {
    let bytes = scene_file::read(scene)?;
    let mut hash = Fnv::new();
    hash.add(&bytes);
    for file in referred_files(scene, &bytes).into_iter().chain(environment.map(Path::to_owned)) {
        // A file that is missing is the importer's to complain about. A device or a pipe has no content of its own, and
        // opening one may wait for ever.
        if fs::metadata(&file).is_ok_and(|known| known.is_file()) {
            let _ = File::open(&file).and_then(|file| hash.add_file(file));
        }
    }
    Ok(format!("{:016x}", hash.0))
}

/// Digest of the bytes of a finished file, 16 hexadecimal digits: [`content_hash`]'s, of one file.
pub(crate) fn digest(bytes: &[u8]) -> String {
    let mut hash = Fnv::new();
    hash.add(bytes);
    format!("{:016x}", hash.0)
}

/// The JSON of a `.glb`, its first chunk; the bytes themselves of other files.
fn document_of(bytes: &[u8]) -> &[u8] {
    const JSON_AT: usize = 20;
    let length = bytes.get(12..16).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    match length {
        Some(length) if bytes.starts_with(b"glTF") => {
            bytes.get(JSON_AT..JSON_AT.saturating_add(length as usize)).unwrap_or_default()
        }
        _ => bytes,
    }
}

/// Files that a `.gltf` or `.glb` names by `uri`, or an `.obj` as its materials and their images, in the order of the document; none
/// for other files.
fn referred_files(scene: &Path, bytes: &[u8]) -> Vec<PathBuf> {
    let directory = scene.parent().unwrap_or(Path::new(""));
    if scene.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("obj")) {
        return files_of_materials(directory, bytes);
    }
    let Ok(document) = serde_json::from_slice::<Value>(document_of(bytes)) else {
        return Vec::new();
    };
    ["buffers", "images"]
        .iter()
        .filter_map(|kind| document.get(kind)?.as_array())
        .flatten()
        .filter_map(|entry| entry.get("uri")?.as_str())
        .filter(|uri| !uri.starts_with("data:"))
        // An absolute path takes the place of the directory.
        .map(|uri| directory.join(percent_decoded(uri.strip_prefix("file://").unwrap_or(uri))))
        .collect()
}

/// Libraries of materials that an `.obj` names, and the images that these name.
fn files_of_materials(directory: &Path, obj: &[u8]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for names in values(obj, |key| key == "mtllib") {
        let all = std::iter::once(names.as_str()).chain(names.split_whitespace());
        for library in all.map(|name| directory.join(name)) {
            // A device or a pipe is no library, and opening one may wait for ever.
            if files.contains(&library) || !library.is_file() {
                continue;
            }
            let found = fs::read(&library).unwrap_or_default();
            files.push(library);
            let images = values(&found, |key| key.starts_with("map_"));
            let name = |image: &String| image.split_whitespace().last().map(|n| directory.join(n));
            files.extend(images.iter().filter_map(name));
            files.extend(images.iter().map(|image| directory.join(image)));
        }
    }
    files
}

/// What follows some key words at the beginnings of lines.
fn values(text: &[u8], is_wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let text = String::from_utf8_lossy(text);
    let lines = text.lines().filter_map(|line| line.trim().split_once(char::is_whitespace));
    lines.filter(|(key, _)| is_wanted(key)).map(|(_, value)| value.trim().to_owned()).collect()
}

/// `%20` and its like as the characters they stand for.
fn percent_decoded(uri: &str) -> String {
    let hex = |digit: u8| (digit as char).to_digit(16);
    let (bytes, mut decoded, mut at) = (uri.as_bytes(), Vec::new(), 0);
    while at < bytes.len() {
        let code = match bytes[at..] {
            [b'%', high, low, ..] => hex(high).zip(hex(low)).map(|(h, l)| (h * 16 + l) as u8),
            _ => None,
        };
        decoded.push(code.unwrap_or(bytes[at]));
        at += if code.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&decoded).into_owned()
}

/// FNV-1a, 64 bits.
struct Fnv(u64);

impl Fnv {
    fn new() -> Fnv {
        Fnv(0xcbf2_9ce4_8422_2325)
    }

    /// Adds a file: its length too, so that bytes cannot wander from one file to the next.
    fn add(&mut self, bytes: &[u8]) {
        self.add_bytes(&(bytes.len() as u64).to_le_bytes());
        self.add_bytes(bytes);
    }

    /// The same, read piece by piece.
    fn add_file(&mut self, mut file: File) -> io::Result<()> {
        self.add_bytes(&file.metadata()?.len().to_le_bytes());
        let mut piece = vec![0; 1 << 16];
        loop {
            match file.read(&mut piece)? {
                0 => return Ok(()),
                length => self.add_bytes(&piece[..length]),
            }
        }
    }

    fn add_bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

#[cfg(test)]
mod tests {
    use relume::session::FrameReport;

    use super::*;
    use crate::args::Shading;
    use crate::report::{PictureOptions, RunOptions, SceneSummary};

    fn report() -> Report {
        let scene = SceneSummary {
            name: "room".into(),
            bodies: 2,
            patches: 7,
            area_m2: 54.0,
            bounds: None,
            content: "00ff".into(),
        };
        let options = RunOptions {
            frames: "all".into(),
            fps: 24.0,
            animation: None,
            edits: Vec::new(),
            tolerance: 0.02,
            oracle: "error".into(),
            update: "scratch".into(),
            threads: 2,
            max_memory_bytes: None,
            outside: None,
            picture: Some(PictureOptions {
                size: "640x480".into(),
                shading: Shading::Flat,
                camera: None,
                view: Vec::new(),
                exposure: "auto".into(),
                exposure_ev: Some(1.25),
                mesh: false,
                reconstruct: false,
                cleanup: false,
            }),
        };
        Report::new(scene, options)
    }

    fn with(change: impl FnOnce(&mut Report)) -> Report {
        let mut report = report();
        change(&mut report);
        report
    }

    #[test]
    fn an_edited_material_or_image_of_an_obj_is_noticed() {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        file("room.obj", "mtllib the room.mtl\nusemtl a\n");
        file("the room.mtl", "newmtl a\nKd 1 1 1\n  map_Ke -clamp on glow.png\n");
        file("glow.png", "one");
        let hash = || content_hash(&dir.path().join("room.obj"), None).unwrap();
        let first = hash();
        file("glow.png", "two");
        let second = hash();
        file("the room.mtl", "newmtl a\nKd 1 0 1\n  map_Ke -clamp on glow.png\n");
        assert!(first != second && second != hash() && first != hash());
    }

    fn refusal(change: impl FnOnce(&mut Report)) -> String {
        let mut now = with(change);
        take_over(&mut now, report(), Path::new("report.json"), |_, _| true)
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn whole_frames_and_the_exposure_are_taken_over() {
        let mut earlier = report();
        for frame in [0, 1, 2] {
            let mut entry = FrameReport::default();
            entry.frame = frame;
            earlier.add(&entry, None).unwrap();
        }
        earlier.peak_memory_bytes = 77;
        let mut now = with(|r| {
            r.options.frames = "0-40".into();
            r.options.threads = 16;
            r.options.max_memory_bytes = Some(1);
            r.options.picture.as_mut().unwrap().exposure_ev = None;
        });
        take_over(&mut now, earlier, Path::new("report.json"), |frame, _| frame != 1).unwrap();
        assert_eq!(now.frames.keys().copied().collect::<Vec<_>>(), [0, 2]);
        assert_eq!(now.options.picture.unwrap().exposure_ev, Some(1.25));
        assert_eq!(now.peak_memory_bytes, 77);
    }

    #[test]
    fn what_differs_is_named() {
        let text = refusal(|r| r.options.tolerance = 0.01);
        assert!(text.contains("tolerance was 0.02 and is 0.01 now"), "{text}");
        let text = refusal(|r| r.options.picture.as_mut().unwrap().size = "320x240".into());
        assert!(text.contains("size was 640x480 and is 320x240 now"), "{text}");
        let text = refusal(|r| r.options.picture.as_mut().unwrap().camera = Some("top".into()));
        assert!(text.contains("camera was nothing and is top now"), "{text}");
        let text = refusal(|r| r.options.edits = vec!["--hide roof".into()]);
        assert!(text.contains(r#"edits was nothing and is ["--hide roof"] now"#), "{text}");
        let text = refusal(|r| r.options.picture = None);
        assert!(text.contains("shading was flat and is nothing now"), "{text}");
        let text = refusal(|r| r.version = "9.9.9".into());
        assert!(text.contains("and is 9.9.9 now"), "{text}");
        let text = refusal(|r| r.scene.content = "ff00".into());
        assert!(
            text.contains("the scene file, a file it refers to or the environment has changed"),
            "{text}"
        );
    }

    #[test]
    fn content_covers_the_files_a_scene_refers_to() {
        let dir = tempfile::tempdir().unwrap();
        let scene = dir.path().join("a.gltf");
        let buffer = dir.path().join("my buffer.bin");
        let text = r#"{"buffers": [{"uri": "my%20buffer.bin"}, {"uri": "data:,x"}]}"#;
        fs::write(&scene, text).unwrap();
        fs::write(&buffer, "one").unwrap();
        let first = content_hash(&scene, None).unwrap();
        assert_eq!(content_hash(&scene, None).unwrap(), first);
        fs::write(&buffer, "two").unwrap();
        assert_ne!(content_hash(&scene, None).unwrap(), first);
        assert!(content_hash(&dir.path().join("missing.glb"), None).is_err());
        let sky = dir.path().join("sky.hdr");
        fs::write(&sky, "blue").unwrap();
        let lit = content_hash(&scene, Some(&sky)).unwrap();
        assert_ne!(lit, content_hash(&scene, None).unwrap());
        fs::write(&sky, "grey").unwrap();
        assert_ne!(content_hash(&scene, Some(&sky)).unwrap(), lit);
    }

    #[test]
    fn a_file_beside_a_glb_that_changed_is_noticed() {
        let dir = tempfile::tempdir().unwrap();
        let (scene, image) = (dir.path().join("room.glb"), dir.path().join("wall.png"));
        let json = br#"{"images": [{"uri": "wall.png"}] }"#;
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((20 + json.len() as u32).to_le_bytes());
        glb.extend((json.len() as u32).to_le_bytes());
        glb.extend(b"JSON");
        glb.extend(json);
        fs::write(&scene, glb).unwrap();
        fs::write(&image, "red").unwrap();
        let first = content_hash(&scene, None).unwrap();
        fs::write(&image, "tan").unwrap();
        assert_ne!(content_hash(&scene, None).unwrap(), first);
    }

    #[test]
    fn percent_codes() {
        assert_eq!(percent_decoded("a%20b%2Fc%C3%A4"), "a b/cä");
        assert_eq!(percent_decoded("100%"), "100%");
        assert_eq!(percent_decoded("%zz%2"), "%zz%2");
    }
}
