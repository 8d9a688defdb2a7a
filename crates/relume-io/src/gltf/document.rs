//! A glTF file opened: its JSON, its binary chunk, and the files it refers to, read when asked for.
//!
//! Must not know what is in the JSON beyond buffers, views and required extensions.

use std::cell::OnceCell;
use std::path::Path;

use super::json;
use super::streams::Streams;
use crate::ImportOptions;
use crate::data_uri;
use crate::folder::{Folder, read_scene};
use crate::regular::unless_fits;
use relume_core::scene::SceneError;

/// Extensions that may be required: handled, or without effect on diffuse light.
const KNOWN: [&str; 44] = [
    "CESIUM_RTC",
    "CESIUM_primitive_outline",
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "GODOT_single_root",
    "KHR_audio_emitter",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_materials_volume_scatter",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics_rigid_bodies",
    "MSFT_lod",
    "VRM",
    "EXT_lights_image_based",
    "EXT_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_meshopt_compression",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_animation_pointer",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_texture_basisu",
];

/// An opened glTF file.
pub(super) struct Document {
    /// As the user named it.
    pub(super) file: String,
    folder: Folder,
    pub(super) root: json::Root,
    binary: Option<Vec<u8>>,
    buffers: Vec<OnceCell<Vec<u8>>>,
    /// The plain bytes of compressed buffer views.
    views: Vec<OnceCell<Vec<u8>>>,
    pub(super) streams: Streams,
}

impl Document {
    /// Reads the file and checks that it is glTF 2.0 and needs nothing that is not supported.
    pub(super) fn open(path: &Path, options: &ImportOptions) -> Result<Document, SceneError> {
        let file = path.display().to_string();
        let (bytes, _) = read_scene(path, options.max_memory_bytes)?;
        let (text, binary) = split_glb(&file, bytes)?;
        let mut root = parse(&file, &text)?;
        let streams = Streams::of(&mut root);
        let buffers = root.buffers.iter().map(|_| OnceCell::new()).collect();
        let views = root.buffer_views.iter().map(|_| OnceCell::new()).collect();
        let folder = Folder {
            file: file.clone(),
            directory: path.parent().unwrap_or(Path::new("")).to_owned(),
            allow_outside: options.allow_outside,
            max_memory_bytes: options.max_memory_bytes,
        };
        let document = Document { file, folder, root, binary, buffers, views, streams };
        document.check_version()?;
        document.check_extensions()?;
        Ok(document)
    }

    /// An error about the content of the file.
    pub(super) fn malformed(&self, what: impl Into<String>) -> SceneError {
        format_error(&self.file, what.into(), "repair the file or export it again")
    }

    /// An error if something needs more memory by itself than is allowed.
    pub(super) fn fits(
        &self,
        what: impl std::fmt::Display,
        needs_bytes: u64,
    ) -> Result<(), SceneError> {
        unless_fits(&self.file, what, needs_bytes, self.folder.max_memory_bytes)
    }

    fn check_version(&self) -> Result<(), SceneError> {
        let wanted = self.root.asset.min_version.as_ref().unwrap_or(&self.root.asset.version);
        if wanted.split('.').next() == Some("2") {
            return Ok(());
        }
        let what = match wanted.as_str() {
            "" => "it does not say its version (asset.version is missing)".to_owned(),
            other => format!("its version is {other}"),
        };
        Err(format_error(&self.file, what, "export the scene as glTF 2.0"))
    }

    fn check_extensions(&self) -> Result<(), SceneError> {
        let unknown = self.root.extensions_required.iter().find(|e| !KNOWN.contains(&e.as_str()));
        unknown.map_or(Ok(()), |e| Err(self.extension(e)))
    }

    /// The error for an extension without which the file cannot be read.
    fn extension(&self, extension: &str) -> SceneError {
        SceneError::Extension {
            file: self.file.clone(),
            extension: extension.to_owned(),
            remedy:
                "it is not supported, but the file says that nobody can read the scene without it; \
                     export the scene again without it"
                    .to_owned(),
        }
    }

    /// Bytes that something may need by itself, if there is a limit.
    pub(super) fn limit_bytes(&self) -> Option<u64> {
        self.folder.max_memory_bytes
    }

    /// The bytes of a buffer, read when first asked for.
    fn buffer(&self, index: usize) -> Result<&[u8], SceneError> {
        let declared =
            self.root.buffers.get(index).ok_or_else(|| self.out_of_range("buffer", index))?;
        let cell = &self.buffers[index];
        if cell.get().is_none() {
            let bytes = match &declared.uri {
                Some(uri) => self.uri(uri, &format!("buffer {index}"), declared.byte_length)?,
                None => self.binary.clone().filter(|_| index == 0).ok_or_else(|| {
                    self.malformed(format!(
                        "buffer {index} names no file, and there is no binary chunk for it"
                    ))
                })?,
            };
            if bytes.len() < declared.byte_length {
                let (have, want) = (bytes.len(), declared.byte_length);
                return Err(self
                    .malformed(format!("buffer {index} should hold {want} bytes but has {have}")));
            }
            cell.set(bytes).ok();
        }
        Ok(cell.get().map_or(&[], |bytes| &bytes[..declared.byte_length]))
    }

    /// The bytes of a buffer view and the stride it declares.
    pub(super) fn view(&self, index: usize) -> Result<(&[u8], Option<usize>), SceneError> {
        let view = self.root.buffer_views.get(index);
        let view = view.ok_or_else(|| self.out_of_range("buffer view", index))?;
        if let Some(packed) = view.extensions.meshopt() {
            let cell = &self.views[index];
            let bytes = match cell.get() {
                Some(bytes) => bytes,
                None => {
                    let bytes = self.decompressed(index, packed)?;
                    cell.get_or_init(|| bytes)
                }
            };
            return Ok((bytes, Some(packed.byte_stride)));
        }
        let place = (view.byte_offset, view.byte_length);
        Ok((self.slice(view.buffer, place, &format!("buffer view {index}"))?, view.byte_stride))
    }

    /// A part of a buffer, by offset and length; `owner` names whose it is.
    pub(super) fn slice(
        &self,
        buffer: usize,
        (offset, length): (usize, usize),
        owner: &str,
    ) -> Result<&[u8], SceneError> {
        let bytes = self.buffer(buffer)?;
        let end = offset.checked_add(length).filter(|&end| end <= bytes.len());
        let end = end.ok_or_else(|| {
            let have = bytes.len();
            self.malformed(format!(
                "{owner} reaches to byte {offset} + {length} of a buffer of {have} bytes"
            ))
        })?;
        Ok(&bytes[offset..end])
    }

    /// An error about an index that points nowhere.
    pub(super) fn out_of_range(&self, kind: &str, index: usize) -> SceneError {
        self.malformed(format!("{kind} {index} is referred to but does not exist"))
    }

    /// The bytes that a URI names: embedded in it, or in a file beside the document.
    /// No more than `at_most` bytes.
    pub(super) fn uri(
        &self,
        uri: &str,
        owner: &str,
        at_most: usize,
    ) -> Result<Vec<u8>, SceneError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(";base64,").map(|(_, e)| e);
            let bytes = encoded.and_then(data_uri::decode);
            return bytes.ok_or_else(|| {
                self.malformed(format!("the data embedded in {owner} is not valid base64"))
            });
        }
        self.folder.read(&self.inside(uri, owner)?, owner, at_most)
    }

    /// The path that a URI names, if it may be opened.
    pub(super) fn inside(&self, uri: &str, owner: &str) -> Result<String, SceneError> {
        if let Some(rest) = after_scheme(uri, "file") {
            let name = percent_decoded(local_path(rest));
            if !self.folder.allow_outside {
                let what =
                    format!("{owner} is an absolute path, outside the folder of the file ({uri})");
                return Err(self.folder.outside(what));
            }
            return Ok(name);
        }
        if uri.contains("://") {
            return Err(format_error(
                &self.file,
                format!("{owner} is on the network ({uri})"),
                "download it and put it beside the scene file",
            ));
        }
        let name = percent_decoded(uri);
        self.folder.check(&name, owner)?;
        Ok(name)
    }
}

fn format_error(file: &str, what: String, remedy: &str) -> SceneError {
    SceneError::Format { file: file.to_owned(), what, remedy: remedy.to_owned() }
}

/// The JSON text, and the binary chunk of a .glb file.
fn split_glb(file: &str, bytes: Vec<u8>) -> Result<(Vec<u8>, Option<Vec<u8>>), SceneError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let word = |at: usize| {
        bytes
            .get(at..at + 4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .ok_or_else(|| truncated(file, &bytes))
    };
    let (version, length) = (word(4)?, word(8)? as usize);
    if version != 2 {
        return Err(format_error(
            file,
            format!("its version is {version}"),
            "export the scene as glTF 2.0",
        ));
    }
    if length > bytes.len() {
        return Err(truncated(file, &bytes));
    }
    let (mut text, mut binary, mut at) = (None, None, 12);
    while at + 8 <= length {
        let (size, kind) = (word(at)? as usize, word(at + 4)?);
        let chunk = bytes
            .get(at + 8..(at + 8).saturating_add(size))
            .ok_or_else(|| truncated(file, &bytes))?;
        match kind {
            0x4E4F_534A if text.is_none() => text = Some(chunk.to_vec()),
            0x004E_4942 if binary.is_none() => binary = Some(chunk.to_vec()),
            _ => {}
        }
        at += 8 + size;
    }
    let no_json = || format_error(file, "it holds no JSON chunk".into(), "export it again");
    Ok((text.ok_or_else(no_json)?, binary))
}

fn truncated(file: &str, bytes: &[u8]) -> SceneError {
    let what = format!("it is cut off after {} bytes", bytes.len());
    format_error(file, what, "copy or export it again")
}

/// The document, or where in it a value is missing or of the wrong type.
fn parse(file: &str, text: &[u8]) -> Result<json::Root, SceneError> {
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    let fail = |what: String| Err(format_error(file, what, "repair the file or export it again"));
    if text.iter().all(u8::is_ascii_whitespace) {
        return fail("it is empty".into());
    }
    if text.iter().find(|b| !b.is_ascii_whitespace()) != Some(&b'{') {
        return fail("it starts neither like a .glb file nor like JSON".into());
    }
    // First for its grammar and its version: an old file should be told its age, not its types.
    let value: serde_json::Value = match serde_json::from_slice(text) {
        Ok(value) => value,
        Err(e) if e.is_eof() => return fail(format!("its JSON is cut off ({e})")),
        Err(e) => return fail(format!("its JSON does not parse ({e})")),
    };
    if let Some(old) = old_version(&value) {
        return Err(format_error(
            file,
            format!("its version is {old}"),
            "export the scene as glTF 2.0",
        ));
    }
    if let Some((list, count)) = too_long(&value) {
        return fail(format!("its list of {list} has {count} entries, more than {LIST_MAX}"));
    }
    serde_path_to_error::deserialize(value)
        .or_else(|e| fail(format!("at {}: {}", e.path(), in_json_words(&e.inner().to_string()))))
}

/// Entries of a list of a file at most: each takes up to a few hundred bytes, and as little as three in the file.
const LIST_MAX: usize = 1 << 19;

/// The first list of a document, among those that it is made of, that is too long.
fn too_long(document: &serde_json::Value) -> Option<(&str, usize)> {
    let lists = document.as_object()?.iter();
    let lengths = lists.filter_map(|(name, list)| Some((name.as_str(), list.as_array()?.len())));
    lengths.into_iter().find(|(_, length)| *length > LIST_MAX)
}

/// The version of a glTF 1 file: as it says, or 1.0 where its nodes are listed by name.
fn old_version(document: &serde_json::Value) -> Option<&str> {
    let stated = document.pointer("/asset/version").and_then(serde_json::Value::as_str);
    let by_name = document.get("nodes").is_some_and(serde_json::Value::is_object);
    stated.filter(|v| v.starts_with("1.") || v.starts_with("0.")).or(by_name.then_some("1.0"))
}

/// What the JSON reader says about types, in the words of JSON instead of Rust's.
fn in_json_words(message: &str) -> String {
    let words = [
        ("usize", "a whole number of 0 or more"),
        ("u32", "a whole number of 0 or more"),
        ("f64", "a number"),
    ];
    let words = words.into_iter().chain([
        ("map", "object"),
        ("a sequence", "an array"),
        ("struct ", "an object like "),
    ]);
    words.fold(message.to_owned(), |m, (from, to)| m.replace(from, to))
}

/// What follows the scheme of a URI, if it has this one.
fn after_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let (of_uri, rest) = uri.split_once(':')?;
    of_uri.eq_ignore_ascii_case(scheme).then_some(rest)
}

/// The path of a URI of this machine: what follows the host, of which `file:///a`, `file://localhost/a` and `file:/a` have none.
fn local_path(rest: &str) -> &str {
    match rest.strip_prefix("//") {
        Some(with_host) => with_host.find('/').map_or(with_host, |at| &with_host[at..]),
        None => rest,
    }
}

/// `%20` and its like, undone.
fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let code = uri.get(i + 1..i + 3).and_then(|hex| u8::from_str_radix(hex, 16).ok());
        match (bytes[i], code) {
            (b'%', Some(byte)) => {
                out.push(byte);
                i += 3;
            }
            (byte, _) => {
                out.push(byte);
                i += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_this_machine_are_told_from_the_network() {
        for uri in ["file:///a/b%20c", "FILE://localhost/a/b%20c", "file:/a/b%20c"] {
            let rest = after_scheme(uri, "file").unwrap();
            assert_eq!(percent_decoded(local_path(rest)), "/a/b c", "{uri}");
        }
        for uri in ["http://a/b", "files/a.bin", "file", "a/file:b"] {
            assert_eq!(after_scheme(uri, "file"), None, "{uri}");
        }
    }

    #[test]
    fn percent_signs_are_undone_where_they_mean_something() {
        assert_eq!(percent_decoded("my%20box.bin"), "my box.bin");
        assert_eq!(percent_decoded("100%.bin"), "100%.bin");
        assert_eq!(percent_decoded("%C3%A4.bin"), "ä.bin");
        assert_eq!(percent_decoded("%2e%2e%2Fa"), "../a");
    }
}
