//! CIE 171:2006, test cases 5.6 to 5.8, computed: the geometry is the standard's, the answers are
//! formulas, and no printed table is copied (that of 5.7 is known to be wrong).

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use relume_core::scene::{LightKind, MaterialId, Scene, SceneBuilder};
use relume_judge::{exact, seen};

use crate::common::{self, at_tolerance, facing_up, leaf_area, solved, v};
use crate::validation::line;

/// What reflects in 5.6 and 5.7, and how much.
struct Reflector {
    corners: Vec<DVec3>,
    reflectance: f64,
    /// The light's direction.
    light: DVec3,
}

impl Reflector {
    /// Irradiance of the reflector where the light is 1 W/m2 across its way.
    fn irradiance(&self) -> f64 {
        -relume_judge::Polygon::black(self.corners.clone()).normal().dot(self.light)
    }

    fn scene(&self, reflectance: f64, add: &dyn Fn(&mut SceneBuilder, MaterialId)) -> Scene {
        let mut b = SceneBuilder::new("cie 171");
        let grey = b.material("grey", [reflectance; 3], [0.0; 3]);
        let black = b.material("black", [0.0; 3], [0.0; 3]);
        common::plates(&mut b, grey, &[("S2", std::slice::from_ref(&self.corners))]);
        add(&mut b, black);
        let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, self.light);
        let node = b.node("light", None, DVec3::ZERO, turn);
        b.light("light", node, LightKind::Directional, [1.0; 3]);
        b.build().unwrap()
    }

    /// Reflected irradiance at a point over E rho, E being the reflector's: what is there less what is
    /// there of the light itself, without the reflector's part.
    fn share(
        &self,
        at: DVec3,
        normal: DVec3,
        tolerance: f64,
        add: &dyn Fn(&mut SceneBuilder, MaterialId),
    ) -> f64 {
        let total = |reflectance: f64| {
            let scene = self.scene(reflectance, add);
            solved(scene, at_tolerance(tolerance)).0.frame().unwrap().irradiance_at(at, normal)[0]
        };
        (total(self.reflectance) - total(0.0)) / (self.irradiance() * self.reflectance)
    }
}

/// Points along a wall and along a ceiling or floor, half a metre apart.
fn rows(wall: [f64; 2], flat: [f64; 2], z: f64, up: DVec3) -> Vec<(DVec3, DVec3)> {
    let steps = |[from, to]: [f64; 2]| {
        let n = ((to - from) / 0.5).round() as u32;
        (0..n).map(move |k| from + 0.25 + 0.5 * f64::from(k))
    };
    let on_wall = steps(wall).map(|z| (v(2.0, 0.0, z), DVec3::Y));
    on_wall.chain(steps(flat).map(|y| (v(2.0, y, z), up))).collect()
}

/// Holds the worst of the points, which is the line's.
fn worst(
    name: &str,
    points: &[(DVec3, DVec3)],
    error_max: f64,
    exact: impl Fn(DVec3, DVec3) -> f64,
    found: impl Fn(DVec3, DVec3, f64) -> f64,
) {
    let off = |tolerance: f64| {
        let each = points.iter().map(|&(p, n)| found(p, n, tolerance) - exact(p, n));
        each.fold(0.0_f64, |m, e| if e.abs() > m.abs() { e } else { m })
    };
    let mean = points.iter().map(|&(p, n)| exact(p, n)).sum::<f64>() / points.len() as f64;
    line(&format!("{name}: mean of {} points, worst error", points.len()), mean, error_max, |t| {
        mean + off(t)
    });
}

#[test]
fn cie_5_6_light_reflected_by_a_diffuse_surface() {
    // A floor of 4 m under a uniform light, a wall from 0.5 m and a ceiling at 3 m; and the same with a
    // small and a very large floor.
    for size in [0.5, 4.0, 500.0] {
        let range = [2.0 - size / 2.0, 2.0 + size / 2.0];
        let reflector = Reflector {
            corners: facing_up(range, range, 0.0).to_vec(),
            reflectance: 0.3,
            light: v(0.0, 0.0, -1.0),
        };
        let points = rows([0.5, 3.0], [0.0, 4.0], 3.0, DVec3::NEG_Z);
        let none = |_: &mut SceneBuilder, _: MaterialId| {};
        worst(
            &format!("5.6, floor of {size} m"),
            &points,
            1e-4,
            |p, n| exact::lambert(p, n, &before(&reflector.corners, n)),
            |p, n, tolerance| reflector.share(p, n, tolerance, &none),
        );
    }
}

/// What a point sees of a level floor around it: from the wall at y = 0 the part in front of that.
fn before(corners: &[DVec3], normal: DVec3) -> Vec<DVec3> {
    let front = |c: &DVec3| if normal == DVec3::Y { v(c.x, c.y.max(0.0), c.z) } else { *c };
    corners.iter().map(front).collect()
}

#[test]
fn cie_5_7_diffuse_reflection_past_an_obstruction() {
    // A wall of 4 x 3 m at y = 4 in the light, one to measure on at y = 0, between them a black
    // partition as wide as the walls, 1 m high and 0.2 m thick.
    let (near, far, top) = (2.5, 2.7, 1.0);
    let reflector = Reflector {
        corners: vec![v(0., 4., 0.), v(4., 4., 0.), v(4., 4., 3.), v(0., 4., 3.)],
        reflectance: 0.6,
        light: v(0.0, 0.5, -0.75_f64.sqrt()),
    };
    assert!((reflector.irradiance() - 0.5).abs() < 1e-12);
    let partition = |b: &mut SceneBuilder, black: MaterialId| {
        let node = common::still(b, "partition");
        b.cuboid(node, "partition", black, v(0.0, near, 0.0), v(4.0, far, top));
    };
    let points = rows([0.0, 3.0], [0.0, 2.5], 0.0, DVec3::Z);
    // The partition is as wide as the wall: what is seen of it is a rectangle over a straight line.
    let over = |p: DVec3| {
        let line = |y: f64| p.z + (top - p.z) * (4.0 - p.y) / (y - p.y);
        line(near).max(line(far)).clamp(0.0, 3.0)
    };
    let by_hand = |p: DVec3, n: DVec3| {
        let z = over(p);
        let left = [v(0., 4., z), v(4., 4., z), v(4., 4., 3.), v(0., 4., 3.)];
        if z < 3.0 { exact::lambert(p, n, &left) } else { 0.0 }
    };
    let (a, b) = (
        [v(0., near, 0.), v(4., near, 0.), v(4., near, 1.), v(0., near, 1.)],
        [v(0., far, 0.), v(4., far, 0.), v(4., far, 1.), v(0., far, 1.)],
    );
    for &(p, n) in &points {
        let cut = seen::form_factor_from_point(p, n, &reflector.corners, &[&a, &b]);
        println!("    at {p}: {:.5}", by_hand(p, n));
        assert!((cut - by_hand(p, n)).abs() < 1e-9, "{p}: {cut} {}", by_hand(p, n));
    }
    worst("5.7, wall behind a partition", &points, 1e-4, by_hand, |p, n, tolerance| {
        reflector.share(p, n, tolerance, &partition)
    });
}

#[test]
fn cie_5_8_the_internally_reflected_component() {
    // A cube of 4 m with a lamp of equal intensity everywhere in its middle: in the mean over its
    // walls, rho / (1 - rho) of the direct irradiance flux / area comes by reflection.
    let (side, flux) = (4.0, 10_000.0);
    for reflectance in [0.1, 0.3, 0.5, 0.7, 0.9, 0.95] {
        let mut b = SceneBuilder::new("cube");
        let grey = b.material("grey", [reflectance; 3], [0.0; 3]);
        let node = common::still(&mut b, "room");
        b.cuboid_inward(node, "walls", grey, DVec3::ZERO, DVec3::splat(side));
        let node = b.node("lamp", None, DVec3::splat(side / 2.0), DQuat::IDENTITY);
        b.light("lamp", node, LightKind::Point, [flux / (4.0 * PI); 3]);
        let scene = b.build().unwrap();
        let direct = flux / (6.0 * side * side);
        let exact = direct * reflectance / (1.0 - reflectance);
        // What the factors are off in the mean comes back with every reflection.
        let error_max = 5e-4 * exact / (1.0 - reflectance);
        line(&format!("5.8, reflectance {reflectance}"), exact, error_max, |tolerance| {
            let snapshot =
                solved(scene.clone(), at_tolerance(tolerance)).0.frame().unwrap().solution();
            let sums = snapshot.leaves.iter().fold((0.0, 0.0), |(area, sum), leaf| {
                let a = leaf_area(leaf);
                (area + a, sum + a * f64::from(leaf.irradiance[0]))
            });
            sums.1 / sums.0 - direct
        });
    }
}
