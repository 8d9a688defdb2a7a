//! Form factors between plates: Howell's catalogue, the polygon pairs of Mazumder and Ravishankar,
//! crossed strings, and blocked pairs.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use glam::{DVec2, DVec3};
use relume_core::scene::{Scene, SceneBuilder};
use relume_core::session::Session;
use relume_judge::{exact, seen};

use crate::common::{self, Quad, at_tolerance, facing_up, flipped, form_factor, plate_scene, v};
use crate::validation::line;

type Polygons = Vec<Vec<DVec3>>;

/// Two named groups of polygons and what stands between them.
struct Pair {
    floor: Polygons,
    other: Polygons,
    between: Polygons,
}

impl Pair {
    fn free(floor: &[DVec3], other: &[DVec3]) -> Pair {
        Pair { floor: vec![floor.to_vec()], other: vec![other.to_vec()], between: vec![] }
    }

    fn scene(&self) -> Scene {
        let mut b = SceneBuilder::new("pair");
        let grey = b.material("grey", [0.5; 3], [0.0; 3]);
        let thin = b.double_sided_material("thin", [0.5; 3], [0.0; 3]);
        common::plates(&mut b, grey, &[("floor", &self.floor), ("other", &self.other)]);
        common::plates(&mut b, thin, &[("between", &self.between)]);
        b.build().unwrap()
    }

    /// F from floor to other at a tolerance.
    fn factor(&self, tolerance: f64) -> f64 {
        form_factor(&common::solved(self.scene(), at_tolerance(tolerance)).0, "floor", "other")
    }

    /// The exact one of these very polygons, by the judge's own integration.
    fn judged(&self, error_max: f64) -> f64 {
        let between: Vec<&[DVec3]> = self.between.iter().map(|p| &p[..]).collect();
        let (mut sum, mut whole) = (0.0, 0.0);
        for a in &self.floor {
            let area = relume_judge::Polygon::black(a.clone()).area_m2();
            whole += area;
            for b in &self.other {
                sum += area * seen::form_factor(a, b, &between, error_max);
            }
        }
        sum / whole
    }
}

/// A line for a pair; errors relative to F.
fn check(name: &str, exact: f64, pair: &Pair, error_max: f64) {
    line(name, exact, error_max * exact, |tolerance| pair.factor(tolerance));
}

fn rectangles(first: [[f64; 2]; 2], second: [[f64; 2]; 2], distance: f64) -> Pair {
    Pair::free(
        &facing_up(first[0], first[1], 0.0),
        &flipped(facing_up(second[0], second[1], distance)),
    )
}

/// A plate `depth` x `width` from the edge x = 0 and one of `height` that rises from it.
fn hinged(depth: f64, height: f64, width: f64, angle: f64) -> Pair {
    let (up, y) = (v(angle.cos(), 0.0, angle.sin()) * height, v(0.0, width, 0.0));
    Pair::free(&facing_up([0.0, depth], [0.0, width], 0.0), &[DVec3::ZERO, y, y + up, up])
}

const UNIT: [f64; 2] = [0.0, 1.0];

#[test]
fn howell_parallel() {
    let squares = |z: f64| rectangles([UNIT, UNIT], [UNIT, UNIT], z);
    for z in [0.1, 1.0, 2.0, 10.0] {
        let f = exact::opposed_rectangles(1.0, 1.0, z);
        check(&format!("C-11, squares {z} apart"), f, &squares(z), 5e-4);
    }
    let (first, second) = ([[0.0, 2.0], UNIT], [[1.5, 2.5], [-1.0, 0.5]]);
    let f = exact::parallel_rectangles(first, second, 0.8);
    check("C-13, rectangles beside each other", f, &rectangles(first, second, 0.8), 5e-4);
}

#[test]
fn howell_at_right_angles_and_inclined() {
    for (d, h) in [(1.0, 1.0), (2.0, 0.5)] {
        let f = exact::rectangles_at_right_angles(d, h, 1.0);
        check(&format!("C-14, {d} and {h} deep"), f, &hinged(d, h, 1.0, FRAC_PI_2), 5e-4);
    }
    for degrees in [30.0_f64, 60.0, 120.0, 150.0] {
        let pair = hinged(1.0, 1.0, 1.0, degrees.to_radians());
        let quad: Quad = pair.floor[0].clone().try_into().unwrap();
        let f = exact::parallelogram_to_polygon(&quad, &pair.other[0]);
        check(&format!("C-16, squares at {degrees} degrees"), f, &pair, 5e-4);
    }
}

/// A regular polygon inscribed in a circle.
fn ring(sides: u32, radius: f64, z: f64) -> Vec<DVec3> {
    let corner = |k: u32| {
        let (sine, cosine) = (f64::from(k) * TAU / f64::from(sides)).sin_cos();
        v(radius * cosine, radius * sine, z)
    };
    (0..sides).map(corner).collect()
}

fn reversed(mut corners: Vec<DVec3>) -> Vec<DVec3> {
    corners.reverse();
    corners
}

#[test]
fn howell_discs() {
    for (r1, r2, h) in [(1.0, 1.0, 1.0), (2.0, 0.5, 0.7)] {
        // As 32-gons: their own exact factor is what is asked for; the discs' stands beside it.
        let pair = Pair::free(&ring(32, r1, 0.0), &reversed(ring(32, r2, h)));
        let (own, disc) = (pair.judged(1e-7), exact::coaxial_discs(r1, r2, h));
        println!("discs of radius {r1} and {r2}, {h} apart: {disc:.6}");
        assert!((own / disc - 1.0).abs() < 0.02, "{own} is not near {disc}");
        check(&format!("C-41, discs {r1} and {r2} at {h}, as 32-gons"), own, &pair, 1e-3);
    }
}

/// A sphere of triangles: an octahedron, each face in 16, put on the sphere.
fn sphere(radius: f64, centre: DVec3) -> Polygons {
    let mut faces = Vec::new();
    for bits in 0..8 {
        let s = |axis: usize| if bits >> axis & 1 == 1 { -1.0 } else { 1.0 };
        let t = [DVec3::X * s(0), DVec3::Y * s(1), DVec3::Z * s(2)];
        faces.push(if s(0) * s(1) * s(2) > 0.0 { t } else { [t[0], t[2], t[1]] });
    }
    for _ in 0..2 {
        let parts = |[p, q, r]: [DVec3; 3]| {
            let (a, b, c) = ((p + q) / 2.0, (q + r) / 2.0, (r + p) / 2.0);
            [[p, a, c], [a, q, b], [c, b, r], [a, b, c]]
        };
        faces = faces.into_iter().flat_map(parts).collect();
        faces.iter_mut().flatten().for_each(|p| *p = p.normalize());
    }
    faces.iter().map(|t| t.map(|p| centre + p * radius).to_vec()).collect()
}

#[test]
fn howell_spheres() {
    let inward = |polygons: Polygons| polygons.into_iter().map(reversed).collect::<Polygons>();
    let (inner, outer) = (sphere(0.5, DVec3::ZERO), inward(sphere(1.0, DVec3::ZERO)));
    let scene = plate_scene(&[("inner", &inner), ("outer", &outer)]);
    // Exact for the polyhedra too, with their own areas.
    let ratio = common::area_of(&scene, "inner") / common::area_of(&scene, "outer");
    let smooth = 1.0 - exact::concentric_spheres_outer_to_itself(0.5, 1.0);
    assert!((ratio - smooth).abs() < 1e-12, "{ratio}");
    let solve = |tolerance| common::solved(scene.clone(), at_tolerance(tolerance)).0;
    line("sphere to the sphere around it, 128 triangles each", 1.0, 2e-3, |t| {
        form_factor(&solve(t), "inner", "outer")
    });
    line("the outer sphere to the inner", ratio, 1e-3, |t| {
        form_factor(&solve(t), "outer", "inner")
    });
    let pair = Pair {
        floor: sphere(0.3, v(0.0, 0.0, 1.0)),
        other: vec![ring(32, 0.8, 0.0)],
        between: vec![],
    };
    let (own, smooth) = (pair.judged(1e-6), exact::sphere_to_disc(0.8, 1.0));
    println!("sphere to disc: {smooth:.6}");
    assert!((own / smooth - 1.0).abs() < 0.02, "{own} {smooth}");
    check("sphere to disc, 128 triangles and a 32-gon", own, &pair, 2e-3);
}

#[test]
fn howell_obstructed() {
    let half = vec![facing_up([0.0, 0.5], [0.0, 0.5], 0.5).to_vec()];
    let blocked = Pair { between: half, ..rectangles([UNIT, UNIT], [UNIT, UNIT], 1.0) };
    check("squares at 1, a quarter blocked half-way", 0.149_868_671_774, &blocked, 2e-3);
    let off = (blocked.factor(0.002) - 0.149_868_671_774).abs();
    println!("    at 0.002 off {off:.1e}");
    assert!(off < 1e-4, "{off}");
    let discs = Pair {
        floor: vec![ring(16, 1.0, 0.0)],
        other: vec![reversed(ring(16, 1.0, 1.0))],
        between: vec![ring(16, 0.5, 0.4)],
    };
    check("16-gons at 1, a smaller one between", discs.judged(1e-6), &discs, 2e-3);
    let tilted = [v(0.2, 0.1, 0.3), v(0.9, 0.3, 0.5), v(0.7, 0.9, 0.7), v(0.1, 0.6, 0.45)];
    let corner = Pair { between: vec![tilted[..3].to_vec()], ..hinged(1.0, 1.0, 1.0, FRAC_PI_2) };
    check("squares at a right angle, a triangle between", corner.judged(1e-6), &corner, 2e-3);
}

#[test]
fn plates_drawn_apart() {
    let mut b = SceneBuilder::new("apart");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    common::plates(&mut b, grey, &[("floor", &[facing_up(UNIT, UNIT, 0.0).to_vec()])]);
    let node = common::sliding(&mut b, "other", DVec3::Z, DVec3::Z * 2.0);
    b.polygon(node, "other", grey, &flipped(facing_up(UNIT, UNIT, 0.0)));
    let scene = Arc::new(b.build().unwrap());
    for (time, distance) in [(0.0, 1.0), (0.25, 1.25), (0.5, 1.5), (1.0, 2.0)] {
        line(
            &format!("drawn apart, distance {distance}"),
            exact::opposed_rectangles(1.0, 1.0, distance),
            1e-4,
            |tolerance| {
                let mut session =
                    Session::new(Arc::clone(&scene), at_tolerance(tolerance)).unwrap();
                session.step(0, 0.0).unwrap();
                session.step(1, time).unwrap();
                form_factor(&session, "floor", "other")
            },
        );
    }
}

#[test]
fn polygons_of_mazumder_and_ravishankar() {
    let p = |corners: &[[f64; 3]]| -> Vec<DVec3> { corners.iter().map(|&c| c.into()).collect() };
    let square = p(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
    let far = p(&[[2., 0.5, 0.], [3., 0., 0.5], [3., 2., 0.5], [2., 1.5, 0.]]);
    let cases = [
        ("1, squares at 1", square.clone(), flipped(facing_up(UNIT, UNIT, 1.0)).to_vec(), 0.199825),
        (
            "2, squares at 10",
            square.clone(),
            flipped(facing_up(UNIT, UNIT, 10.0)).to_vec(),
            3.16206e-3,
        ),
        (
            "3, squares with a common edge",
            square,
            p(&[[0., 0., 0.], [0., 1., 0.], [0., 1., 1.], [0., 0., 1.]]),
            0.200044,
        ),
        (
            "4, triangles in parallel planes",
            p(&[[0., 0., 0.], [1., 1., 0.], [0., 1., 0.]]),
            p(&[[1., 0., 1.], [0., 1., 1.], [1., 1., 1.]]),
            0.099912,
        ),
        (
            "5a, quadrilaterals at a slant",
            p(&[[0., 0.5, 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]),
            far.clone(),
            4.44228e-3,
        ),
        (
            "5b, another, the same second one",
            p(&[[0., 0., 0.], [0.5, 0., 0.], [1., 1., 0.], [0., 1., 0.]]),
            far,
            3.63699e-3,
        ),
        (
            "6, triangles at a slant",
            p(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.]]),
            p(&[[2., 2., 2.], [4., 4., 4.], [2., 3., 3.]]),
            1.06866e-3,
        ),
    ];
    for (name, first, second, printed) in cases {
        // Whichever winding makes the two face each other.
        let pairs = [second.clone(), reversed(second)].map(|s| Pair::free(&first, &s));
        let judged = pairs.each_ref().map(|p| p.judged(1e-9));
        let facing = usize::from(judged[1] > judged[0]);
        let own = judged[facing];
        assert!((own / printed - 1.0).abs() < 1e-5, "{name}: printed {printed}, integrated {own}");
        check(&format!("Mazumder {name}"), own, &pairs[facing], 1e-3);
    }
}

/// The middle of a very long plate and another, in the plane's terms: what the ends of a plate 100 long
/// miss is 2e-6 of it.
fn strips(first: [DVec2; 2], second: [DVec2; 2], between: Option<[DVec2; 2]>) -> Pair {
    let (short, long) = (0.5, 50.0);
    let plate = |[p, q]: [DVec2; 2], half: f64| {
        let at = |p: DVec2, y: f64| v(p.x, y, p.y);
        vec![at(p, -half), at(q, -half), at(q, half), at(p, half)]
    };
    Pair {
        floor: vec![plate(first, short)],
        other: vec![plate(second, long)],
        between: between.iter().map(|&b| plate(b, long)).collect(),
    }
}

#[test]
fn crossed_strings_in_the_plane() {
    let at = DVec2::new;
    let (floor, lid) = ([at(0., 0.), at(1., 0.)], [at(1., 1.), at(0., 1.)]);
    let f = exact::crossed_strings(floor, [lid[1], lid[0]]);
    assert!((f - exact::opposed_strips(1.0, 1.0)).abs() < 1e-12);
    check("C-1, long plates at 1", f, &strips(floor, lid, None), 1e-3);
    let wall = [at(0., 0.), at(0., 0.5)];
    check(
        "C-3, long plates at a right angle",
        exact::strips_at_right_angles(1.0, 0.5),
        &strips(floor, [wall[1], wall[0]], None),
        1e-3,
    );
    // Past the edge of a third: strings bend around it.
    let tip = at(0.4, 0.5);
    let bent = |p: DVec2, q: DVec2| p.distance(tip) + tip.distance(q);
    let crossed = 2.0 * 2.0_f64.sqrt();
    let f = (crossed - bent(floor[0], lid[1]) - 1.0) / 2.0;
    let between = Some([at(0.0, 0.5), tip]);
    check("crossed strings past an edge", f, &strips(floor, lid, between), 2e-3);
    // The judge says the same of the prism.
    let own = strips(floor, lid, between).judged(1e-6);
    assert!((own / f - 1.0).abs() < 1e-4, "{own} {f}");
}
