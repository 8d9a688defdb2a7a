//! Light as one continuous function, and the light of lamps at every pixel.

use glam::{DMat3, DVec3};
use relume_core::geometry::Pose;
use relume_core::scene::{PatchId, Projection, Scene};
use relume_core::session::{Command, Gathered, LampLight, Options, Session, Snapshot};
use relume_judge::path::{Estimate, Site, irradiance};
use relume_judge::seen::form_factor_from_point;
use relume_judge::{Polygon, World};
use relume_picture::picture::{Seen, Settings, Shading, View, direct_lamps, layers};

use crate::common::*;

/// The room with a block on its floor and its lamp lower, out of the gap below the ceiling.
fn furnished() -> Scene {
    let mut scene = room(&[]);
    scene.materials[3].exitance = [0.0; 3];
    let glow = material(&mut scene, [0.5; 3], 60.0);
    solid(&mut scene, v(1.6, 2.2, 2.2), v(2.4, 2.25, 2.8), glow);
    let grey = material(&mut scene, [0.6; 3], 0.0);
    solid(&mut scene, v(1.0, 0.0, 2.2), v(1.8, 0.9, 3.0), grey);
    scene
}

fn solved(scene: Scene, tolerance: f64) -> Session {
    let options = Options { tolerance, ..Options::default() };
    let mut session = Session::new(scene, options).unwrap();
    session.solve().unwrap();
    session
}

fn cleaned(session: &Session) -> Snapshot {
    let lamps = direct_lamps(session.scene(), &session.world());
    session.frame().unwrap().solution_beside(&lamps)
}

/// From the front wall, a little down.
fn view() -> View {
    let back = v(0.0, 0.25, 1.0).normalize();
    let rotation = DMat3::from_cols(DVec3::X, back.cross(DVec3::X), back);
    View {
        world_from_camera: Pose { rotation, translation: v(2.03, 1.7, 4.9) },
        projection: Projection::Perspective { yfov: 1.0, aspect: None },
    }
}

fn numbers(
    snapshot: &Snapshot,
    view: &View,
    shading: Shading,
    (width, height): (u32, u32),
) -> Vec<Seen> {
    let settings = Settings { width, height, samples: 1, shading, ..Settings::default() };
    layers(snapshot, view, &settings).pixels
}

/// What a pixel of a perspective view sees.
fn place(view: &View, seen: &Seen, k: usize, (width, height): (u32, u32)) -> DVec3 {
    let Projection::Perspective { yfov, .. } = view.projection else { panic!("a perspective") };
    let scale = f64::from(height) / 2.0 / (yfov / 2.0).tan();
    let (x, y) = ((k as u32 % width) as f64 + 0.5, (k as u32 / width) as f64 + 0.5);
    let depth = f64::from(seen.depth_m);
    let right = (x - f64::from(width) / 2.0) / scale * depth;
    let up = (f64::from(height) / 2.0 - y) / scale * depth;
    view.world_from_camera.point(DVec3::new(right, up, -depth))
}

fn polygons(session: &Session) -> Vec<Polygon> {
    let (scene, world) = (session.scene(), session.world());
    let polygon = |patch: &relume_core::scene::Patch| Polygon {
        corners: patch
            .corners_in_body()
            .map(|c| world.pose(patch.body).unwrap().point(c))
            .collect(),
        reflectance: world.reflectance(scene, patch),
        exitance: world.exitance(scene, patch),
        twin: patch.twin.map(|PatchId(k)| k as usize),
    };
    scene.patches.iter().map(polygon).collect()
}

/// What a place sees of lamps past everything, and what it would see of them, W/m2.
fn judged_direct(polygons: &[Polygon], at: DVec3, normal: DVec3) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (k, lamp) in polygons.iter().enumerate().filter(|(_, p)| p.exitance[0] > 0.0) {
        let others = polygons.iter().enumerate().filter(|(j, _)| *j != k);
        let blockers: Vec<&[DVec3]> = others.map(|(_, p)| &p.corners[..]).collect();
        for (sum, blockers) in sums.iter_mut().zip([&blockers[..], &[]]) {
            *sum += lamp.exitance[0] * form_factor_from_point(at, normal, &lamp.corners, blockers);
        }
    }
    sums
}

const SIZE: (u32, u32) = (47, 33);

#[test]
fn direct_light_of_every_pixel_is_the_exact_formulas() {
    let session = solved(furnished(), 0.2);
    let snapshot = cleaned(&session);
    let polygons = polygons(&session);
    let (mut partly, mut most) = (0, 0.0_f64);
    for (k, seen) in numbers(&snapshot, &view(), Shading::Smooth, SIZE).iter().enumerate() {
        let normal = DVec3::from_array(seen.normal.map(f64::from));
        let at = place(&view(), seen, k, SIZE) + normal * 2e-6;
        let [exact, open] = judged_direct(&polygons, at, normal);
        partly += u32::from(exact > 0.01 * open && exact < 0.99 * open);
        // Depths are in single precision, and what is clear and far is interpolated over a leaf.
        assert!(
            (f64::from(seen.direct[0]) - exact).abs() < 1e-3 * open.max(1.0),
            "{exact} at {at}: {seen:?}"
        );
        most = most.max(exact);
    }
    assert!(partly > 20 && most > 1.0, "{partly} {most}");
}

/// A horizontal regular polygon that faces up or down.
fn disc(centre: DVec3, radius: f64, corners: u32, up: bool) -> Vec<DVec3> {
    let corner = |k: u32| {
        let turn = std::f64::consts::TAU * f64::from(k) / f64::from(corners);
        centre + radius * v(turn.cos(), 0.0, if up { -turn.sin() } else { turn.sin() })
    };
    (0..corners).map(corner).collect()
}

/// Suns are polygons of sixteen corners, and files have round table tops.
#[test]
fn lamps_and_blockers_of_many_corners_are_found_exactly() {
    let mut scene = room(&[]);
    scene.materials[3].exitance = [0.0; 3];
    let glow = material(&mut scene, [0.0; 3], 60.0);
    let grey = material(&mut scene, [0.5; 3], 0.0);
    body(&mut scene, &[(disc(v(2.0, 2.5, 2.5), 0.3, 16, false), glow)]);
    body(&mut scene, &[(disc(v(1.9, 1.0, 2.4), 0.4, 30, true), grey)]);
    solid(&mut scene, v(2.6, 1.2, 2.2), v(3.0, 1.5, 2.6), grey);
    let session = solved(scene, 0.3);
    let polygons = polygons(&session);
    let (mut partly, mut clear) = (0, 0);
    for (k, seen) in numbers(&cleaned(&session), &view(), Shading::Smooth, SIZE).iter().enumerate()
    {
        let normal = DVec3::from_array(seen.normal.map(f64::from));
        let at = place(&view(), seen, k, SIZE) + normal * 2e-6;
        let [exact, open] = judged_direct(&polygons, at, normal);
        partly += u32::from(exact > 0.01 * open && exact < 0.99 * open);
        clear += u32::from(exact > 0.1 && exact == open);
        let off = (f64::from(seen.direct[0]) - exact).abs();
        assert!(off < 1e-3 * open.max(1.0), "{exact} of {open} at {at}: {seen:?}");
    }
    assert!(partly > 20 && clear > 20, "{partly} {clear}");
}

/// Plates lie on half of a lamp in the floor, in its plane, and a box stands on another part: what they cover does not shine. The floor
/// around the lamp, larger and in its plane, covers nothing.
#[test]
fn what_lies_on_a_lamp_hides_it() {
    let lit = |on_it: &[&str]| {
        let mut scene = room(&[]);
        scene.materials[3].exitance = [0.0; 3];
        let grey = material(&mut scene, [0.5; 3], 0.0);
        let glow = material(&mut scene, [0.0; 3], 30.0);
        let flat = |x: [f64; 2]| side(v(x[0], -1.0, 1.0), v(x[1], 0.0, 3.0), Side::Ceiling);
        body(&mut scene, &[(flat([1.0, 3.0]), glow)]);
        if on_it.contains(&"plate") {
            // Smaller than a fifth of the lamp each.
            for k in 0..4 {
                let from = 1.0 + 0.25 * f64::from(k);
                body(&mut scene, &[(flat([from, from + 0.25]), grey)]);
            }
        }
        if on_it.contains(&"box") {
            solid(&mut scene, v(2.0, 0.0, 1.0), v(3.0, 1e-3, 3.0), grey);
        }
        let plain = snapshot(&scene, |_, _, level| level < 2, |_, _, _| [0.0; 3]);
        let lamps = direct_lamps(&scene, &plain.world);
        let exitance = [30.0; 3];
        let snapshot = Snapshot {
            indirect: vec![Gathered::default(); plain.leaves.len()],
            lamps: lamps.iter().map(|&patch| LampLight { patch, exitance }).collect(),
            ..plain
        };
        let seen = numbers(&snapshot, &view(), Shading::Smooth, SIZE);
        // On the left wall, at half height.
        seen[(15 * SIZE.0 + 1) as usize].direct[0]
    };
    let (all, plate, both) = (lit(&[]), lit(&["plate"]), lit(&["plate", "box"]));
    assert!(all > 1.0 && plate < 0.7 * all && plate > 0.1 * all, "{all} {plate}");
    assert!(both < 1e-3 * all, "{both}");
}

/// Root mean squares of what is off, over all pixels and over those in penumbrae, less the reference's own.
fn errors(snapshot: &Snapshot, shading: Shading, reference: &[(Estimate, bool)]) -> [f64; 2] {
    let mut sums = [(0.0, 0.0); 2];
    for (seen, (reference, partly)) in
        numbers(snapshot, &view(), shading, SIZE).iter().zip(reference)
    {
        let off: f64 =
            (0..3).map(|c| f64::from(seen.irradiance[c]) - reference.irradiance[c]).sum();
        let square = off * off - reference.standard_error.iter().sum::<f64>().powi(2);
        for (sum, counts) in sums.iter_mut().zip([true, *partly]) {
            if counts {
                *sum = (sum.0 + square, sum.1 + 1.0);
            }
        }
    }
    sums.map(|(squares, count)| (squares.max(0.0) / f64::max(count, 1.0)).sqrt())
}

#[test]
fn cleaned_pictures_err_a_third_of_gouraud_ones_and_half_in_penumbrae() {
    let session = solved(furnished(), 0.1);
    let world = World::new(polygons(&session));
    let plain = session.frame().unwrap().solution();
    let seen = numbers(&plain, &view(), Shading::Flat, SIZE);
    let sites: Vec<Site> = seen
        .iter()
        .enumerate()
        .map(|(k, seen)| {
            let normal = DVec3::from_array(seen.normal.map(f64::from));
            Site::point(place(&view(), seen, k, SIZE), normal)
        })
        .collect();
    let partly = |site: &Site| {
        let [exact, open] =
            judged_direct(world.polygons(), site.origin + site.normal * 1e-5, site.normal);
        exact > 0.01 * open && exact < 0.99 * open
    };
    let estimates = irradiance(&world, &sites, 24, 5);
    let reference: Vec<(Estimate, bool)> =
        estimates.into_iter().zip(&sites).map(|(e, site)| (e, partly(site))).collect();
    let before = errors(&plain, Shading::Gouraud, &reference);
    let after = errors(&cleaned(&session), Shading::Smooth, &reference);
    let sum = |(e, _): &(Estimate, bool)| e.irradiance.iter().sum::<f64>();
    let mean = reference.iter().map(sum).sum::<f64>() / reference.len() as f64;
    println!("all, penumbrae: gouraud {before:?}, cleaned {after:?} of {mean} W/m2");
    // In penumbrae what is left is light between block and floor, which is the mesh's.
    assert!(after[0] < before[0] / 3.0 && after[1] < before[1] / 2.0, "{after:?} {before:?}");
}

/// A snapshot with the irradiance of a function, line by line.
fn with_lines(scene: &Scene, of: impl Fn(DVec3) -> f64) -> Snapshot {
    with_lines_over(snapshot(scene, uneven, |_, _, _| [0.0; 3]), of)
}

fn with_lines_over(mut snapshot: Snapshot, of: impl Fn(DVec3) -> f64) -> Snapshot {
    let scene = std::sync::Arc::clone(&snapshot.scene);
    for k in 0..scene.patches.len() {
        let frame = scene.patches[k].frame;
        for index in snapshot.leaf_offsets[k]..snapshot.leaf_offsets[k + 1] {
            let leaf = &mut snapshot.leaves[index as usize];
            let at = frame.point(leaf.centroid());
            let along = |d: DVec3| ((of(at + d * 1e-4) - of(at - d * 1e-4)) / 2e-4) as f32;
            leaf.irradiance = [of(at) as f32; 3];
            leaf.irradiance_gradient = [[along(frame.u); 3], [along(frame.v); 3]];
        }
    }
    snapshot
}

#[test]
fn a_linear_field_is_shown_as_it_is_on_any_mesh() {
    let field = |p: DVec3| 10.0 + p.x - 0.7 * p.y + 0.4 * p.z;
    let snapshot = with_lines(&room(&[]), field);
    for (k, seen) in numbers(&snapshot, &view(), Shading::Smooth, SIZE).iter().enumerate() {
        let expected = field(place(&view(), seen, k, SIZE));
        assert!((f64::from(seen.irradiance[0]) - expected).abs() < 1e-3, "{expected}: {seen:?}");
    }
}

#[test]
fn light_has_no_seams_between_leaves() {
    let snapshot = with_lines(&room(&[]), |p| 3.0 + (3.0 * p.x).sin() + (2.0 * p.y + p.z).cos());
    // Along the back wall, in steps of a micrometre about the edges of leaves of all sizes, at the height of no corner.
    let shades = |x: f64| {
        let world_from_camera = Pose { rotation: DMat3::IDENTITY, translation: v(x, 1.2345, 1.0) };
        let projection = Projection::Orthographic { xmag: 4e-6, ymag: 1e-6 };
        let view = View { world_from_camera, projection };
        numbers(&snapshot, &view, Shading::Smooth, (8, 2))
    };
    for k in 1..64 {
        let row = shades(f64::from(k) / 16.0);
        let jump = (1..8).map(|i| (row[i].irradiance[0] - row[i - 1].irradiance[0]).abs());
        assert!(jump.fold(0.0, f32::max) < 1e-4, "at {k}: {row:?}");
    }
}

/// A slender triangle that points at a wall of squares: what it says beyond its sharp corner ends before it is left out.
#[test]
fn light_has_no_seams_beyond_sharp_corners() {
    let mut scene = empty();
    let white = material(&mut scene, [0.5; 3], 0.0);
    let square = |k: u32| {
        let (x, y) = (0.5 + 0.1 * f64::from(k / 10), 0.1 * f64::from(k % 10));
        (
            vec![v(x, y, 0.0), v(x + 0.1, y, 0.0), v(x + 0.1, y + 0.1, 0.0), v(x, y + 0.1, 0.0)],
            white,
        )
    };
    let mut wall: Vec<_> = (0..100).map(square).collect();
    wall.push((vec![v(0.0, 0.53, 0.0), v(0.5, 0.55, 0.0), v(0.0, 0.57, 0.0)], white));
    body(&mut scene, &wall);
    let first = scene.patches[0].surface;
    scene.patches.iter_mut().for_each(|patch| patch.surface = first);
    let whole = snapshot(&scene, |_, _, _| false, |_, _, _| [0.0; 3]);
    let snapshot = with_lines_over(whole, |p| 3.0 + (3.0 * p.x).sin() + (2.0 * p.y).cos());
    // Past the corner in steps of a tenth of a millimetre.
    let world_from_camera = Pose { rotation: DMat3::IDENTITY, translation: v(0.9, 0.55, 1.0) };
    let projection = Projection::Orthographic { xmag: 0.5, ymag: 1e-4 };
    let row =
        numbers(&snapshot, &View { world_from_camera, projection }, Shading::Smooth, (10_000, 2));
    let on = row[..10_000].windows(2).filter(|pair| pair.iter().all(|seen| seen.body == 1));
    let steps: Vec<f32> = on.map(|p| (p[1].irradiance[0] - p[0].irradiance[0]).abs()).collect();
    let most = steps.iter().copied().fold(0.0, f32::max);
    assert!(steps.len() > 9_000 && most < 3e-3, "{most}");
}

/// Two halves of a wall that numbers of few digits have bent by two thousandths.
#[test]
fn light_has_no_seam_where_a_wall_is_flat_but_for_rounding() {
    let mut scene = empty();
    let white = material(&mut scene, [0.5; 3], 0.0);
    let half = |x: [f64; 2], z: [f64; 2]| {
        let corners =
            vec![v(x[0], 0.0, z[0]), v(x[1], 0.0, z[1]), v(x[1], 1.0, z[1]), v(x[0], 1.0, z[0])];
        (corners, white)
    };
    body(&mut scene, &[half([0.0, 1.0], [0.0, 0.0]), half([1.0, 2.0], [0.0, 2e-3])]);
    let mut snapshot = snapshot(&scene, |_, _, _| false, |_, _, _| [0.0; 3]);
    snapshot.leaves[0].irradiance = [1.0; 3];
    snapshot.leaves[1].irradiance = [2.0; 3];
    let world_from_camera = Pose { rotation: DMat3::IDENTITY, translation: v(1.0, 0.5, 1.0) };
    let projection = Projection::Orthographic { xmag: 1e-5, ymag: 1e-5 };
    let view = View { world_from_camera, projection };
    for seen in &numbers(&snapshot, &view, Shading::Smooth, (8, 2)) {
        assert!((seen.irradiance[0] - 1.5).abs() < 1e-3, "{seen:?}");
    }
}

/// A closet beside the furnished room, out of its sight, with a lamp and a block of its own, which moves: what it is and how its
/// leaves are lit is of no matter to the room, though lamps and blockers are found in trees over both.
#[test]
fn walls_that_nothing_happens_to_do_not_change_by_a_bit() {
    let mut scene = furnished();
    let white = material(&mut scene, [0.3; 3], 0.0);
    let glow = material(&mut scene, [0.0; 3], 30.0);
    let turned = |s: Side| {
        let mut corners = side(v(10.0, 0.0, 0.0), v(11.0, 1.0, 1.0), s);
        corners.reverse();
        (corners, white)
    };
    let closet = body(&mut scene, &SIDES.map(turned));
    solid(&mut scene, v(10.4, 0.9, 0.4), v(10.6, 0.95, 0.6), glow);
    let block = solid(&mut scene, v(10.2, 0.0, 0.2), v(10.5, 0.3, 0.5), white);
    let mut session = solved(scene, 0.2);
    let snapshot = cleaned(&session);
    let shown = |snapshot: &Snapshot| numbers(snapshot, &view(), Shading::Smooth, SIZE);
    let before = shown(&snapshot);
    session.apply(Command::set_pose(block, Pose::translation([0.2, 0.0, 0.1]))).unwrap();
    let mut moved = Snapshot { world: session.world(), ..snapshot };
    let first = moved.scene.bodies[closet.0 as usize].patches.start;
    let aside = moved.leaf_offsets[first as usize] as usize;
    assert!(aside + 100 < moved.leaves.len());
    moved.indirect[aside..].iter_mut().for_each(|h| h.irradiance = [7.0; 3]);
    assert!(before == shown(&moved));
    // Where it does matter, it shows.
    moved.indirect[..aside].iter_mut().for_each(|h| h.irradiance = [7.0; 3]);
    assert!(before != shown(&moved));
}
