//! Files whose meshes are stored compressed, as other programs wrote them (`data/packed`), whole and damaged.

use glam::DVec3;
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{VertexEncoding, encode_vertex_buffer};
use serde_json::json;

use super::gltf::Gltf;
use super::{data, read, scene_of};
use relume_core::geometry::Aabb;
use relume_core::scene::{BodyId, Scene, SceneError};
use relume_io::{ImportOptions, import};

const FILES: [&str; 6] = [
    "ring-draco-sequential.glb",
    "ring-draco-standard.glb",
    "ring-draco-valence.glb",
    "ring-meshopt-ext.glb",
    "ring-meshopt-khr.glb",
    "ring-meshopt-float.glb",
];

fn ring(file: &str) -> Scene {
    read(&data("packed").join(file)).unwrap()
}

/// Where the middle of the ring is, and from there the corner that was furthest along x at first.
fn middle_and_rim(scene: &Scene, time_s: f64) -> [DVec3; 2] {
    let pose = |time_s: f64| scene.pose(BodyId(0), time_s).unwrap();
    let corners = scene.patches.iter().flat_map(|p| p.corners_in_body());
    let x = |c: &DVec3| pose(0.0).point(*c).x;
    let rim = corners.max_by(|a, b| x(a).total_cmp(&x(b))).unwrap();
    let middle = scene.bounds(time_s).unwrap().centre();
    [middle, pose(time_s).point(rim) - middle]
}

#[test]
fn the_ring_is_where_it_was_and_turns_as_it_did() {
    for file in FILES {
        let scene = ring(file);
        let area = if file == "ring-draco-valence.glb" { 39.1 } else { 35.9 };
        assert!((scene.area_m2() - area).abs() < 0.1, "{file}: {} m2", scene.area_m2());
        assert_eq!(scene.motion.duration_s, 1.0, "{file}");
        let Aabb { lo: min, hi: max } = scene.bounds(0.0).unwrap();
        assert!((min.x + 2.5).abs() < 1e-3 && (max.x - 2.5).abs() < 1e-3, "{file}: {min} to {max}");
        let h = std::f64::consts::FRAC_1_SQRT_2;
        for (time_s, turned) in [(0.0, DVec3::X), (0.5, DVec3::new(h, 0.0, -h)), (1.0, -DVec3::Z)] {
            let [middle, rim] = middle_and_rim(&scene, time_s);
            let (at, out) = (DVec3::new(1.0, 2.0, 3.0) * time_s, turned * 2.5);
            assert!(middle.distance(at) < 1e-3, "{file} at {time_s}: {middle}");
            assert!(rim.distance(out) < 3e-3, "{file} at {time_s}: {rim}");
        }
    }
}

/// The cube with its positions in a view that says how it is compressed.
fn cube_in(extension: &str, change: &[(&str, serde_json::Value)], bytes: &[u8]) -> Gltf {
    let mut g = Gltf::cube();
    let view = g.view(bytes);
    let mut packed = json!({"buffer": 0, "byteOffset": g.json["bufferViews"][view]["byteOffset"],
        "byteLength": bytes.len(), "byteStride": 12, "count": 24, "mode": "ATTRIBUTES"});
    for (key, value) in change {
        packed[key] = value.clone();
    }
    let plain = g.push("bufferViews", json!({"buffer": 1, "byteLength": 288}));
    g.json["bufferViews"][plain]["extensions"] = json!({extension: packed});
    g.json["accessors"][0]["bufferView"] = json!(plain);
    g.json["extensionsRequired"] = json!([extension]);
    g
}

/// The cube's positions as the vertex codec has them.
fn stream() -> Vec<u8> {
    let plain: Vec<u8> =
        super::gltf::cube_positions().into_iter().flat_map(f32::to_le_bytes).collect();
    let (encoding, mut work) = (VertexEncoding::default(), Workspace::default());
    encode_vertex_buffer(&plain, 24, 12, encoding, &mut work).unwrap()
}

#[test]
fn what_is_wrong_with_a_compressed_view_is_said() {
    let stream = stream();
    let said = |change: &[(&str, serde_json::Value)], bytes: &[u8]| {
        scene_of(&cube_in("EXT_meshopt_compression", change, bytes)).unwrap_err().to_string()
    };
    assert_eq!(
        scene_of(&cube_in("KHR_meshopt_compression", &[], &stream)).unwrap().patches.len(),
        6
    );
    for (change, words) in [
        (("mode", json!("WORDS")), "the mode `WORDS` does not exist"),
        (("filter", json!("SEPIA")), "the filter `SEPIA` does not exist"),
        (("byteStride", json!(10)), "byteStride"),
        (("count", json!(1_u64 << 40)), "more than the"),
        (("byteLength", json!(u64::MAX)), "the compressed data of buffer view"),
        (("buffer", json!(7)), "buffer 7"),
    ] {
        let message = said(&[change], &stream);
        assert!(message.contains(words), "{message}");
    }
    for cut in 0..stream.len() {
        let message = said(&[], &stream[..cut]);
        assert!(message.contains("compressed"), "{cut}: {message}");
    }
}

#[test]
fn damage_anywhere_in_a_stream_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.glb");
    for file in ["ring-draco-sequential.glb", "ring-draco-standard.glb", "ring-meshopt-khr.glb"] {
        let whole = std::fs::read(data("packed").join(file)).unwrap();
        let json = u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize + 28;
        for place in (json..whole.len()).step_by(2) {
            let mut damaged = whole.clone();
            damaged[place] ^= [1, 0x80, 0xff][place / 2 % 3];
            std::fs::write(&path, &damaged).unwrap();
            // Whatever it says.
            let _ = read(&path);
        }
    }
}

#[test]
fn compressed_meshes_keep_the_limit_of_memory() {
    let limited = |file: &str, bytes: u64| {
        let options = ImportOptions { max_memory_bytes: Some(bytes), ..ImportOptions::default() };
        import(data("packed").join(file), &options)
    };
    for file in FILES {
        assert!(limited(file, 1 << 20).is_ok(), "{file}");
    }
    // The file itself fits.
    let error = limited("ring-draco-valence.glb", 6_000).unwrap_err();
    assert!(matches!(error, SceneError::TooLarge { .. }), "{error}");
}
