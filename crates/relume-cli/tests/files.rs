//! Files that are none, files that ask for too much, and files of an earlier run that are not its own any more.
#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::{self, Ran, relume, room, text};

/// Runs the command, which has to end by itself soon.
fn soon(arguments: &[&str]) -> Ran {
    let mut child = start(arguments);
    wait(&mut child, arguments);
    let output = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ran { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

fn start(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn wait(child: &mut Child, arguments: &[&str]) {
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > Duration::from_secs(30) {
            child.kill().unwrap();
            panic!("{arguments:?} does not end");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
fn what_is_no_regular_file_is_refused_by_name_wherever_a_file_is_named() {
    let (dir, scene) = room();
    let scene = text(&scene);
    let path = |name: &str| dir.path().join(name);
    let mut irregular: Vec<(PathBuf, &str)> = Vec::new();
    for name in
        ["a.glb", "a.gltf", "a.vs3", "a.obj", "a.stl", "a.ply", "a.flat", "a.svg", "a.hdr", "a.txt"]
    {
        pipe(&path(name));
        irregular.push((path(name), "a pipe"));
    }
    fs::create_dir(path("dir.glb")).unwrap();
    let _socket = std::os::unix::net::UnixListener::bind(path("socket.glb")).unwrap();
    irregular.push((path("dir.glb"), "a directory"));
    irregular.push((path("socket.glb"), "a socket"));
    irregular.push((PathBuf::from("/dev/zero"), "a device"));
    for (file, what) in &irregular {
        let file = text(file);
        let said = format!("{what}, not a regular file");
        for arguments in [
            &["info", file][..],
            &["check", file],
            &["solve", file],
            &["probe", scene, file],
            &["solve", scene, "--environment", file],
            &["flat", file],
            &["replay", file, scene],
        ] {
            soon(arguments).fails(1, &[file, &said]);
        }
    }
    // A report of an earlier run, and a picture of one.
    let out = path("out");
    let render = [
        "render",
        scene,
        "-o",
        text(&out),
        "--frames",
        "0",
        "--size",
        "32x24",
        "--tolerance",
        "0.5",
    ];
    relume(&render).succeeds();
    fs::remove_file(out.join("frame-0000.png")).unwrap();
    pipe(&out.join("frame-0000.png"));
    fs::remove_file(out.join("report.json")).unwrap();
    pipe(&out.join("report.json"));
    soon(&[&render[..], &["--resume"]].concat()).fails(1, &["frame-0000.png is not a file"]);
    fs::remove_file(out.join("frame-0000.png")).unwrap();
    soon(&[&render[..], &["--resume"]].concat()).fails(1, &["report.json is not a file"]);
}

/// What goes into a pipe that nobody reads.
#[test]
fn a_run_that_a_pipe_holds_up_can_be_stopped() {
    let (dir, scene) = room();
    let path = dir.path().join("pipe");
    pipe(&path);
    let scene = text(&scene);
    let arguments =
        ["solve", scene, "--tolerance", "0.5", "--frames", "0", "--report", text(&path)];
    let mut child = start(&arguments);
    std::thread::sleep(Duration::from_secs(3));
    let number = child.id().to_string();
    assert!(Command::new("kill").arg(number).status().unwrap().success());
    wait(&mut child, &arguments);
}

/// A glTF file with a triangle, changed.
fn triangle(dir: &Path, name: &str, change: impl FnOnce(&mut Value)) -> PathBuf {
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: Vec<u8> = corners.iter().flat_map(|c| c.to_le_bytes()).collect();
    fs::write(dir.join("triangle.bin"), bytes).unwrap();
    let mut gltf = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "field", "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "buffers": [{ "uri": "triangle.bin", "byteLength": 36 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }]
    });
    change(&mut gltf);
    let path = dir.join(name);
    fs::write(&path, gltf.to_string()).unwrap();
    path
}

#[test]
fn what_a_file_declares_is_counted_before_memory_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let instances = |gltf: &mut Value, count: usize| {
        gltf["accessors"]
            .as_array_mut()
            .unwrap()
            .push(json!({ "componentType": 5126, "count": count, "type": "VEC3" }));
        gltf["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
        gltf["nodes"][0]["extensions"] =
            json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 1 } } });
    };
    let many = triangle(dir.path(), "instances.gltf", |gltf| instances(gltf, 1 << 20));
    let large = triangle(dir.path(), "large.gltf", |gltf| {
        instances(gltf, 1 << 17);
        let primitive = gltf["meshes"][0]["primitives"][0].clone();
        gltf["meshes"][0]["primitives"] = Value::Array(vec![primitive; 40]);
    });
    let nodes = triangle(dir.path(), "nodes.gltf", |gltf| {
        let count = (1 << 17) + 1;
        gltf["nodes"] = Value::Array(vec![json!({ "mesh": 0 }); count]);
        gltf["scenes"][0]["nodes"] = (0..count).collect();
    });
    let empty = triangle(dir.path(), "empty.gltf", |gltf| {
        gltf["accessors"][0] = json!({ "componentType": 5126, "count": 1 << 20, "type": "VEC3" });
        let primitive = gltf["meshes"][0]["primitives"][0].clone();
        gltf["meshes"][0]["primitives"] = Value::Array(vec![primitive; 100]);
    });
    let keys = triangle(dir.path(), "keys.gltf", |gltf| {
        let accessors = gltf["accessors"].as_array_mut().unwrap();
        accessors.push(json!({ "componentType": 5126, "count": 1 << 20, "type": "SCALAR" }));
        accessors.push(json!({ "componentType": 5126, "count": 1 << 20, "type": "VEC3" }));
        let channel = json!({ "sampler": 0, "target": { "node": 0, "path": "translation" } });
        gltf["animations"] = json!([{
            "samplers": [{ "input": 1, "output": 2 }], "channels": vec![channel; 20],
        }]);
    });
    let entries = triangle(dir.path(), "entries.gltf", |gltf| {
        let nodes = gltf["nodes"].as_array_mut().unwrap();
        nodes.resize((1 << 19) + 1, json!({}));
    });
    let chain = dir.path().join("chain.svg");
    let path = format!("M 0 0{}", " L 1 1 L 0 1".repeat(5_000));
    let svg = format!("<svg xmlns=\"http://www.w3.org/2000/svg\"><path d=\"{path}\"/></svg>");
    fs::write(&chain, svg).unwrap();
    soon(&["flat", text(&chain)]).fails(1, &["path, line 1", "more than 8192 segments"]);
    for (scene, said) in [
        (entries, "list of nodes has 524289 entries"),
        (many, "1048576 objects"),
        (large, "4194304 polygons"),
        (nodes, "131073 objects"),
        (empty, "104857600 corners"),
        (keys, "20971520 keys"),
    ] {
        // The file itself is a few megabytes of text at most.
        soon(&["info", text(&scene), "--max-memory", "200M"]).fails(1, &[said]);
    }
}

#[test]
fn a_coordinate_that_is_out_of_range_is_named_with_its_line() {
    let dir = tempfile::tempdir().unwrap();
    let ply = |kind: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n0 0 0\n1e39 0 0\n0 1 0\n3 0 1 2\n"
        )
    };
    let vertex = "V 1 0 0 0\nV 2 1e39 0 0\nV 3 1 1 0\nV 4 0 1 0\nS 1 1 2 3 4 0 0 0.5 a\n";
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1e39 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    for (name, content, said) in [
        ("a.vs3", format!("T x\nF 3\n{vertex}"), "line 4: `1e39`"),
        ("b.vs3", "F 3a\nS 1 R 0 0 0.5 a\n0 0 1e39 0 0 1 1\n".to_owned(), "line 3: `1e39`"),
        (
            "a.obj",
            "v 0 0 0\nv 1e39 0 0\nv 1 1 0\nf 1 2 3\n".to_owned(),
            "line 2: the coordinate `1e39`",
        ),
        (
            "b.obj",
            "v 0 0 0\r\nv 1 0 -1e400\r\nv 1 1 0\r\nf 1 2 3\r\n".to_owned(),
            "line 2: the coordinate `-1e400`",
        ),
        ("a.stl", format!("solid a\n{facet}endsolid a\n"), "line 5: the coordinate `1e39`"),
        ("a.ply", ply("float"), "line 11: the coordinate `1e39`"),
        ("b.ply", ply("double"), "line 11: the coordinate `1e39`"),
    ] {
        let path = dir.path().join(name);
        fs::write(&path, content).unwrap();
        let ran = soon(&["info", text(&path)]);
        ran.fails(1, &[name, said, "help"]);
    }
    for (name, content, said) in [
        ("a.flat", "segment a 0 0 1 0\nsegment b 0 0 1e39 0\n", "line 2: `1e39`"),
        (
            "a.svg",
            "<svg xmlns=\"http://www.w3.org/2000/svg\">\n<line x1=\"0\" y1=\"0\" x2=\"1e39\" y2=\"0\"/></svg>",
            "line 2: it has a point at (1e39",
        ),
    ] {
        let path = dir.path().join(name);
        fs::write(&path, content).unwrap();
        soon(&["flat", text(&path)]).fails(1, &[name, said, "help"]);
    }
    let far: [f32; 9] = [0.0, 0.0, 0.0, 1e38, 0.0, 0.0, 0.0, 1.0, 0.0];
    let scene = triangle(dir.path(), "far.gltf", |_| {});
    let bytes: Vec<u8> = far.iter().flat_map(|c| c.to_le_bytes()).collect();
    fs::write(dir.path().join("triangle.bin"), bytes).unwrap();
    soon(&["info", text(&scene)]).fails(1, &["vertex 1 is at (9.9", "further out than 1e12 m"]);
}

#[test]
fn what_a_command_reads_it_does_not_write_over() {
    let (dir, scene) = room();
    let sensors = dir.path().join("sensors.txt");
    fs::write(&sensors, "0 0.5 0 0 1 0\n").unwrap();
    let before = (fs::read(&scene).unwrap(), fs::read(&sensors).unwrap());
    // By another way to the same file.
    let again = dir.path().join(".").join(scene.file_name().unwrap());
    let (scene_at, again, sensors_at) = (text(&scene), text(&again), text(&sensors));
    for arguments in [
        &["export", scene_at, "-o", again][..],
        &["solve", scene_at, "--report", again],
        &["solve", scene_at, "--events", scene_at],
        &["render", scene_at, "-o", text(&dir.path().join("out")), "--report", scene_at],
        &["factors", scene_at, "-o", scene_at],
        &["factors", scene_at, "--report", scene_at],
        &["bench", scene_at, "--json", scene_at],
        &["probe", scene_at, sensors_at, "-o", sensors_at],
        &["probe", scene_at, sensors_at, "-o", again],
    ] {
        soon(arguments).fails(1, &["is read by this command", "name another file"]);
    }
    assert!((fs::read(&scene).unwrap(), fs::read(&sensors).unwrap()) == before);
}

#[test]
fn files_by_absolute_address_are_told_from_the_network() {
    let dir = tempfile::tempdir().unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let local = triangle(dir.path(), "local.gltf", |gltf| {
        let uri = format!("file://{}/triangle.bin", text(elsewhere.path()));
        gltf["buffers"][0]["uri"] = json!(uri);
    });
    fs::rename(dir.path().join("triangle.bin"), elsewhere.path().join("triangle.bin")).unwrap();
    let said = ["absolute path, outside the folder", "--allow-outside"];
    soon(&["info", text(&local)]).fails(1, &said);
    soon(&["info", text(&local), "--allow-outside"]).says(&["1 patch"]);
    let network = triangle(dir.path(), "network.gltf", |gltf| {
        gltf["buffers"][0]["uri"] = json!("http://example.org/a.bin");
    });
    for more in [&[][..], &["--allow-outside"]] {
        soon(&[&["info", text(&network)], more].concat()).fails(1, &["on the network", "download"]);
    }
}

#[test]
fn a_picture_in_place_of_a_finished_one_is_made_anew() {
    let (dir, scene) = room();
    let out = dir.path().join("out");
    let render = |more: &[&str]| {
        let fixed =
            ["render", text(&scene), "-o", text(&out), "--frames", "0-2", "--size", "40x30"];
        relume(&[&fixed[..], &["--tolerance", "0.5"], more].concat()).succeeds()
    };
    render(&[]);
    let picture = |k: u32| out.join(format!("frame-{k:04}.png"));
    let report = common::json(&out.join("report.json"));
    assert_eq!(report["frames"][1]["picture"].as_str().unwrap().len(), 16);
    let (first, second) = (fs::read(picture(0)).unwrap(), fs::read(picture(1)).unwrap());
    assert!(first != second);
    fs::write(picture(1), &first).unwrap();
    let ran = render(&["--resume"]);
    assert!(ran.out.contains("3 frames (2 finished before)"), "{}", ran.out);
    assert!(fs::read(picture(1)).unwrap() != first);
    assert!(render(&["--resume"]).out.contains("3 frames (3 finished before)"));
}

#[test]
fn the_share_of_light_that_is_unaccounted_for_stands_in_the_report() {
    let (dir, scene) = room();
    let report = dir.path().join("report.json");
    let solve = ["solve", text(&scene), "--frames", "0", "--tolerance", "0.5", "--quiet"];
    relume(&[&solve[..], &["--report", text(&report)]].concat()).succeeds();
    let frame = &common::json(&report)["frames"][0];
    let watts = |name: &str| frame["energy"][name].as_f64().unwrap();
    let residual = (watts("emitted_w") - watts("absorbed_w") - watts("escaped_w")).abs();
    let off = residual.max(-watts("escaped_w")) / watts("emitted_w");
    assert!((frame["unbalanced"].as_f64().unwrap() - off).abs() < 1e-12);
}
