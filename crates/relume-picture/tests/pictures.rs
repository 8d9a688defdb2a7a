//! Pictures of snapshots made by hand.

use crate::common::*;
use glam::{DQuat, DVec2, DVec3};
use relume_core::scene::{BodyId, Held, Projection};
use relume_core::session::Snapshot;
use relume_picture::picture::{
    Exposure, Image, Metered, Settings, Shading, Tone, View, Viewpoint, render,
};

const GREY: [f32; 3] = [0.5; 3];

fn settings(shading: Shading) -> Settings {
    let exposure = Exposure::Fixed(std::f64::consts::PI);
    Settings {
        width: 200,
        height: 150,
        shading,
        exposure,
        tone: Tone::Clip,
        background: [1.0, 0.0, 1.0],
        ..Settings::default()
    }
}

fn distinct(image: &Image) -> Vec<[u8; 3]> {
    let mut colours = image.pixels.clone();
    colours.sort();
    colours.dedup();
    colours
}

#[test]
fn a_known_point_projects_exactly() {
    let mut scene = empty();
    let yfov = 2.0 * 0.5_f64.atan(); // half a metre up at a metre's distance is the edge
    camera(&mut scene, "eye", v(1.0, 2.0, 3.0), Projection::Perspective { yfov, aspect: None });
    let view = Viewpoint::new(&scene, None).unwrap().at(&scene, 0.0).unwrap();
    let pixel = |p| view.project(p, 640, 480).unwrap();
    assert!(pixel(v(1.0, 2.0, -5.0)).distance(DVec2::new(320.0, 240.0)) < 1e-9);
    // 4 m ahead, 1 m to the right, 2 m up: the upper edge, and 120 pixels a metre.
    assert!(pixel(v(2.0, 4.0, -1.0)).distance(DVec2::new(440.0, 0.0)) < 1e-9);
    assert_eq!(view.project(v(1.0, 2.0, 4.0), 640, 480), None);
}

#[test]
fn a_wide_camera_keeps_its_whole_frame_in_a_narrow_picture() {
    let projection = Projection::Perspective { yfov: 1.0, aspect: Some(2.0) };
    let view = View { projection, ..View::look_at(DVec3::ZERO, -DVec3::Z, 1.0) };
    let corner = v(2.0 * 0.5_f64.tan(), 0.5_f64.tan(), -1.0);
    let pixel = view.project(corner, 400, 400).unwrap();
    assert!(pixel.distance(DVec2::new(400.0, 100.0)) < 1e-9, "{pixel}");
}

#[test]
fn an_orthographic_camera_projects_exactly_and_draws() {
    let mut scene = room(&[]);
    let projection = Projection::Orthographic { xmag: 2.0, ymag: 1.5 };
    camera(&mut scene, "plan", v(2.0, 1.5, 10.0), projection);
    let view = Viewpoint::new(&scene, Some("plan")).unwrap().at(&scene, 0.0).unwrap();
    assert!(
        view.project(v(4.0, 3.0, 0.0), 200, 150).unwrap().distance(DVec2::new(200.0, 0.0)) < 1e-9
    );
    // From outside, through the back of the front wall, one sees the back wall and the lamp.
    let snapshot = snapshot(&scene, uneven, |p, _, m| {
        if m.exitance[0] > 0.0 { [1.0; 3] } else { [p.z as f32 * 0.01 + 0.1; 3] }
    });
    let image = render(&snapshot, &view, &settings(Shading::Flat));
    assert_eq!(image.pixel(100, 3), [255; 3]);
    assert_eq!(image.pixel(100, 75), image.pixel(10, 140));
}

#[test]
fn an_unknown_camera_is_named() {
    let mut scene = room(&[]);
    camera(&mut scene, "door", DVec3::ZERO, Projection::Perspective { yfov: 1.0, aspect: None });
    let message = Viewpoint::new(&scene, Some("dor")).unwrap_err().to_string();
    assert_eq!(message, "no camera is called \"dor\"; the scene has: door");
}

/// Looks from within the room in many directions, close to walls too: no pixel shows the background.
#[test]
fn a_closed_room_has_no_pinholes() {
    let scene = room(&[]);
    let snapshot = snapshot(&scene, uneven, |_, _, _| GREY);
    for shading in [Shading::Flat, Shading::Gouraud] {
        for (i, eye) in
            [v(2.0, 1.5, 2.5), v(0.001, 1.0, 0.3), v(3.9, 0.01, 4.9)].into_iter().enumerate()
        {
            for k in 0..6 {
                let angle = f64::from(k) * 1.1 + i as f64;
                let target = eye + v(angle.sin(), (f64::from(k) - 2.0) * 0.4, angle.cos());
                let image = render(&snapshot, &View::look_at(eye, target, 1.3), &settings(shading));
                assert_eq!(distinct(&image).len(), 1, "{shading:?} from {eye} to {target}");
            }
        }
    }
}

#[test]
fn a_constant_field_is_a_constant_picture() {
    let scene = room(&[]);
    let snapshot = snapshot(&scene, uneven, |_, _, _| GREY);
    let view = View::look_at(v(0.5, 1.5, 4.5), v(3.0, 1.0, 0.0), 1.0);
    for shading in [Shading::Flat, Shading::Gouraud] {
        for samples in [1, 7, 16, 64] {
            let image = render(&snapshot, &view, &Settings { samples, ..settings(shading) });
            assert_eq!(distinct(&image), [[188; 3]], "{shading:?}, {samples} samples");
        }
    }
}

#[test]
fn what_is_nearer_hides_what_is_farther() {
    let mut scene = room(&[]);
    let blue = material(&mut scene, [0.0, 0.0, 0.9], 0.0);
    // After the room, so that the order of drawing alone would do; then also before it.
    solid(&mut scene, v(1.5, 0.0, 1.0), v(2.5, 1.0, 2.0), blue);
    let snapshot = snapshot(&scene, uneven, |_, _, m| m.reflectance.map(|r| r as f32));
    let pixel = |eye: DVec3, target: DVec3, at: DVec3| {
        let view = View::look_at(eye, target, 0.8);
        let p = view.project(at, 200, 150).unwrap();
        render(&snapshot, &view, &settings(Shading::Flat)).pixel(p.x as u32, p.y as u32)
    };
    let is_blue = |p: [u8; 3]| p[0] == 0 && p[2] > 200;
    let (front, centre) = (v(2.0, 1.0, 4.8), v(2.0, 0.5, 1.5));
    assert!(is_blue(pixel(front, centre, v(2.0, 0.5, 2.0))));
    assert!(!is_blue(pixel(front, centre, v(1.3, 0.5, 2.0))));
    // The lamp hides the box from above the ceiling, whose back is not drawn.
    let above = v(2.0, 8.0, 2.5);
    let lamp = pixel(above, centre, v(2.0, 2.95, 2.5));
    assert_eq!(lamp, [188; 3]);
    assert!(is_blue(pixel(v(2.0, 2.0, 0.2), centre, v(2.0, 1.0, 1.5))));
}

#[test]
fn gouraud_reproduces_a_linear_ramp() {
    let scene = room(&[]);
    let ramp = |p: DVec3| 0.1 + 0.1 * p.x + 0.05 * p.y + 0.08 * p.z;
    let snapshot = snapshot(&scene, uneven, |p, _, _| [ramp(p) as f32; 3]);
    let view = View::look_at(v(0.5, 2.0, 4.5), v(3.0, 0.5, 0.0), 1.0);
    let image = render(&snapshot, &view, &Settings { samples: 1, ..settings(Shading::Gouraud) });
    let mut worst = 0.0_f64;
    for i in 1..40 {
        for k in 1..40 {
            let floor = v(f64::from(i) * 0.1, 0.0, f64::from(k) * 0.125);
            let Some(p) = view.project(floor, 200, 150) else { continue };
            if p.x > 0.0 && p.y > 0.0 && p.x < 200.0 && p.y < 150.0 {
                let code = f64::from(image.pixel(p.x as u32, p.y as u32)[0]) / 255.0;
                let shown = ((code + 0.055) / 1.055).powf(2.4);
                worst = worst.max((shown - ramp(floor)).abs());
            }
        }
    }
    // Half a pixel and half a code.
    assert!(worst < 0.008, "{worst}");
}

#[test]
fn the_bits_do_not_depend_on_threads_or_repetition() {
    let mut scene = room(&[]);
    let white = scene.patches[2].material;
    let block = (v(1.2, 0.0, 1.0), v(2.2, 1.0, 2.0));
    solid(&mut scene, block.0, block.1, white);
    let snapshot = snapshot(&scene, uneven, lit(block));
    let picture = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let view = View::automatic(&scene);
            let exposure = Exposure::automatic(&snapshot, &view);
            let mesh =
                Settings { mesh: true, exposure, width: 203, height: 151, ..Settings::default() };
            (view, exposure, render(&snapshot, &view, &mesh))
        })
    };
    let one = picture(1);
    assert!([1, 2, 8].into_iter().all(|threads| picture(threads) == one));
}

#[test]
fn a_body_may_be_absent_and_a_scene_empty() {
    let scene = room(&[]);
    let mut snapshot = snapshot(&scene, uneven, |_, _, _| GREY);
    let hidden = (0..2).map(|body| (BodyId(body), false)).collect();
    snapshot.world = scene.at_but(0.0, &Held { presence: hidden, ..Held::default() });
    let view = View::automatic(&scene);
    let image =
        render(&snapshot, &view, &Settings { background: [0.0, 1.0, 0.0], ..Settings::default() });
    assert_eq!(distinct(&image), [[0, 255, 0]]);
    View::automatic(&empty());
}

#[test]
fn outlines_follow_the_leaves_and_are_hidden_with_them() {
    let scene = room(&[]);
    let view = View::look_at(v(2.0, 1.5, 4.9), v(2.0, 1.5, 0.0), 1.0);
    let picture = |level_max, mesh| {
        let snapshot = snapshot(&scene, |_, _, level| level < level_max, |_, _, _| GREY);
        render(&snapshot, &view, &Settings { mesh, ..settings(Shading::Flat) })
    };
    let marked = |level| picture(level, true).pixels.iter().filter(|p| **p != [188; 3]).count();
    assert_eq!(distinct(&picture(3, false)).len(), 1);
    assert!(marked(1) > 200 && marked(2) > marked(1) * 3 / 2 && marked(3) > marked(2) * 3 / 2);
    assert_eq!(picture(1, true).pixel(60, 60), [188; 3]);
}

#[test]
fn exposure_puts_surfaces_in_the_middle_and_lets_lamps_clip() {
    let scene = room(&[]);
    let view = View::automatic(&scene);
    for brightness in [1e-3_f32, 1.0, 1e4] {
        let snapshot = snapshot(&scene, uneven, |p, _, m| {
            let lamp = if m.exitance[0] > 0.0 { 1e3 } else { 1.0 };
            [brightness * lamp * (0.5 + 0.1 * p.x as f32); 3]
        });
        let exposure = Exposure::automatic(&snapshot, &view);
        let image = render(&snapshot, &view, &Settings { exposure, ..Settings::default() });
        let clipped = image.pixels.iter().filter(|p| p[0] > 250).count();
        let dark = image.pixels.iter().filter(|p| p[0] < 60).count();
        assert!(clipped > 0 && clipped * 20 < image.pixels.len(), "{clipped}");
        assert_eq!(dark, 0);
    }
}

#[test]
fn exposure_stops_at_what_the_solution_tells() {
    let scene = room(&[]);
    let view = View::look_at(v(2.0, 1.5, 4.9), v(2.0, 0.0, 0.0), 0.8);
    let metered = |radiosity: f32| {
        let dim = snapshot(&scene, uneven, |_, _, _| [radiosity; 3]);
        let dim = relume_core::session::Snapshot { error_w_m2: 0.01, ..dim };
        Exposure::metered(&dim, &view)
    };
    let scale = |m: Metered| match m.exposure {
        Exposure::Fixed(scale) => scale / std::f64::consts::PI,
        Exposure::Automatic => panic!("it is fixed"),
    };
    // Per radiosity: middle grey, and then no brighter than a tenth for what it may be off by.
    assert!((scale(metered(1.0)) - 0.2).abs() < 1e-3 && metered(1.0).lit == 1.0);
    assert!((scale(metered(0.015)) - 10.0).abs() < 1e-6 && metered(0.015).lit == 1.0);
    for noise in [0.005, 1e-10, 0.0] {
        assert!(
            (scale(metered(noise)) - 10.0).abs() < 1e-6 && metered(noise).lit == 0.0,
            "{noise}"
        );
    }
}

#[test]
fn a_view_is_carried_about_an_axis() {
    let view = View::look_at_with_up(v(3.0, 0.0, 0.0), v(1.0, 0.0, 0.0), DVec3::Z, 1.0);
    let turned = view.turned(v(1.0, 0.0, 0.0), DVec3::Z, 0.25);
    assert!((turned.world_from_camera.translation - v(1.0, 2.0, 0.0)).length() < 1e-12);
    let upright = turned.project(v(1.0, 0.0, 0.5), 100, 100).unwrap();
    assert!((upright.x - 50.0).abs() < 1e-9 && upright.y < 49.0, "{upright}");
}

#[test]
fn a_picture_is_written_whole_or_not_at_all() {
    let directory = tempfile::tempdir().unwrap();
    let image = Image { width: 2, height: 1, pixels: vec![[1, 2, 3], [4, 5, 6]] };
    let path = directory.path().join("frame-0000.png");
    image.write_png(&path).unwrap();
    image.write_png(&path).unwrap();
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = [0; 6];
    reader.next_frame(&mut bytes).unwrap();
    assert_eq!(bytes, [1, 2, 3, 4, 5, 6]);
    let error =
        image.write_png(directory.path().join("missing/frame.png")).unwrap_err().to_string();
    assert!(error.contains("missing/frame.png") && error.contains("No such file"), "{error}");
    // A directory of that name: renaming fails, and nothing is left behind.
    std::fs::create_dir(directory.path().join("taken.png")).unwrap();
    image.write_png(directory.path().join("taken.png")).unwrap_err();
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2);
}

#[test]
fn a_rotated_camera_looks_where_it_points() {
    let mut scene = empty();
    let quarter = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
    let node = node(&mut scene, DVec3::ZERO, quarter);
    let projection = Projection::Perspective { yfov: 1.0, aspect: None };
    scene.cameras.push(relume_core::scene::Camera { name: "side".into(), node, projection });
    let view = Viewpoint::new(&scene, None).unwrap().at(&scene, 0.0).unwrap();
    let pixel = view.project(v(-3.0, 0.0, 0.0), 640, 480).unwrap();
    assert!(pixel.distance(DVec2::new(320.0, 240.0)) < 1e-9);
}

#[test]
fn wild_values_and_places_do_not_panic() {
    let scene = room(&[]);
    for value in [f32::NAN, f32::INFINITY, -1.0, f32::MAX, f32::MIN_POSITIVE] {
        let snapshot =
            snapshot(&scene, uneven, |p, _, _| if p.x > 2.0 { [value; 3] } else { GREY });
        for eye in [DVec3::ZERO, v(4.0, 3.0, 5.0), v(2.0, 0.0, 2.5), v(1e9, 0.0, 0.0)] {
            for exposure in [Exposure::Automatic, Exposure::Fixed(1.0)] {
                let view = View::look_at(eye, v(2.0, 1.5, 2.5), 1.0);
                render(
                    &snapshot,
                    &view,
                    &Settings { exposure, mesh: true, ..settings(Shading::Gouraud) },
                );
            }
        }
        let view = View::look_at(v(2.0, 1.5, 2.5), v(2.0, 1.5, 2.5), 3.1);
        for (width, height) in [(0, 0), (1, 1), (1, 300)] {
            render(&snapshot, &view, &Settings { width, height, ..settings(Shading::Gouraud) });
        }
    }
}

/// Of surfaces in one plane the smaller is seen, in whatever order they come and however far the view is
/// turned: that is how they are lit.
#[test]
fn a_lamp_in_the_plane_of_the_ceiling_is_seen() {
    for lamp_first in [false, true] {
        let mut scene = empty();
        let (grey, glow) =
            (material(&mut scene, [0.5; 3], 0.0), material(&mut scene, [0.0; 3], 1.0));
        let square = |h: f64| vec![v(-h, 0.3, -h), v(h, 0.3, -h), v(h, 0.3, h), v(-h, 0.3, h)];
        let mut polygons = vec![(square(2.0), grey), (square(0.5), glow)];
        if lamp_first {
            polygons.reverse();
        }
        body(&mut scene, &polygons);
        let snapshot =
            snapshot(&scene, uneven, |_, _, m| if m.exitance[0] > 0.0 { [1.0; 3] } else { GREY });
        for k in 0..12 {
            let angle = f64::from(k) * 0.5;
            let eye = v(1.3 * angle.cos(), -0.4 - 0.1 * f64::from(k), 1.7 * angle.sin());
            let view = View::look_at(eye, v(0.0, 0.3, 0.0), 0.4);
            for projection in [view.projection, Projection::Orthographic { xmag: 0.3, ymag: 0.2 }] {
                let view = View { projection, ..view };
                let image = render(&snapshot, &view, &settings(Shading::Gouraud));
                for (x, y) in [(100, 75), (95, 70), (104, 78)] {
                    assert_eq!(image.pixel(x, y), [255; 3], "view {k} at {x}, {y}");
                }
            }
        }
    }
}

/// Sides of a prism about the vertical axis, a metre in radius and two high, with light from +X.
fn prism(count: u32) -> Snapshot {
    let mut scene = empty();
    let white = material(&mut scene, [0.5; 3], 0.0);
    let at = |k: u32, y: f64| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(count)).sin_cos();
        v(cos, y, -sin)
    };
    let of = |k: u32| (vec![at(k, -1.0), at(k + 1, -1.0), at(k + 1, 1.0), at(k, 1.0)], white);
    body(&mut scene, &(0..count).map(of).collect::<Vec<_>>());
    let mut made = snapshot(&scene, |_, _, _| false, |_, _, _| [0.0; 3]);
    for (patch, leaf) in made.scene.patches.iter().zip(&mut made.leaves) {
        leaf.irradiance = [(1.5 + patch.frame.normal.x) as f32; 3];
        leaf.radiosity = leaf.irradiance.map(|h| 0.5 * h);
    }
    made
}

/// A prism of sixteen sides stands for a cylinder: no step between neighbours. One of six sides is what it is.
#[test]
fn curved_bodies_show_no_facets() {
    let view = View::look_at(v(0.0, 0.0, 6.0), DVec3::ZERO, 0.5);
    let largest_step = |count: u32, shading: Shading| {
        let image = render(&prism(count), &view, &settings(shading));
        let row: Vec<[u8; 3]> = (0..200).map(|x| image.pixel(x, 75)).collect();
        let is_seen = |p: &&[u8; 3]| **p != [255, 0, 255] && p[0] == p[1];
        let seen: Vec<[u8; 3]> = row.iter().filter(is_seen).copied().collect();
        assert!(seen.len() > 60, "{seen:?}");
        seen.windows(2).map(|w| w[0][0].abs_diff(w[1][0])).max().unwrap()
    };
    assert!(largest_step(16, Shading::Flat) > 12);
    assert!(largest_step(16, Shading::Gouraud) < 6);
    assert_eq!(largest_step(6, Shading::Gouraud), largest_step(6, Shading::Flat));
}
