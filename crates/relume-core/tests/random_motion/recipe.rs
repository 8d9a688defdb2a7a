//! Scenes and motions drawn at random, as plain values that can be printed, built, and made smaller.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use relume_core::scene::{
    Interpolation, LightKind, MaterialId, NodeId, RotationTrack, Scene, SceneBuilder, Track,
};
use relume_core::session::{Aim, Options};

use crate::common::{Random, at_tolerance, facing_up, form_factor_oracle, still, v};

/// What does not move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// [-1, 1]^3 seen from inside.
    Room,
    /// A floor at z = -1, seen from above.
    Floor,
    /// A double-sided floor at z = -1 and a double-sided wall at x = -1.
    Corner,
    /// The room, and another one far from it.
    TwoRooms,
}

/// What a thing looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum What {
    Box,
    Tetrahedron,
    Prism,
    Hexagon,
    Sheet,
    Lamp,
    Point,
    Spot,
    Sun,
}

const SOLIDS: [What; 6] =
    [What::Box, What::Tetrahedron, What::Prism, What::Hexagon, What::Sheet, What::Lamp];
const LIGHTS: [What; 3] = [What::Point, What::Spot, What::Sun];

/// One body or light.
#[derive(Clone, Debug)]
pub(crate) struct Thing {
    pub(crate) what: What,
    /// Half its size, metres.
    pub(crate) size: f64,
    /// Where it is at 0 s, 1 s, ...; straight in between.
    pub(crate) keys: Vec<(DVec3, DQuat)>,
    /// Whether the two tracks are there at all: without them it rests.
    pub(crate) slides: bool,
    pub(crate) turns: bool,
    pub(crate) presence: Vec<(f64, bool)>,
    /// Hangs on the thing before it.
    pub(crate) rides: bool,
}

/// A scene, how it is solved, and the times it is solved at, in this order.
#[derive(Clone, Debug)]
pub(crate) struct Recipe {
    pub(crate) place: Place,
    pub(crate) things: Vec<Thing>,
    /// Nothing emits.
    pub(crate) dark: bool,
    /// How bright lamps and lights are at 0 s, 1 s, ...; empty where that does not change.
    pub(crate) glow: Vec<f64>,
    /// Tolerance of the error oracle, or the form-factor oracle with epsilon and least area.
    pub(crate) solve: Result<f64, (f64, f64)>,
    /// What the tolerance is about.
    pub(crate) aim: Aim,
    pub(crate) times_s: Vec<f64>,
}

/// What a draw dwells on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Flavour {
    /// Bodies anywhere.
    Free,
    /// Bodies that rest on the floor, touch each other, cut each other and walls.
    Contact,
    /// Bodies that come, go, and jump far away.
    Jumps,
    /// Punctual lights that move.
    Lights,
    /// Bodies that ride on others.
    Families,
    /// Lamps and punctual lights that brighten, darken, go out and rest.
    Glows,
}

/// Keys of every track, at 0 s, 1 s, ...
const KEYS: usize = 6;

impl Recipe {
    /// The recipe of a number.
    pub(crate) fn draw(flavour: Flavour, seed: u64, steps: usize) -> Recipe {
        let mut r = Random(seed.wrapping_mul(0x1234_5677).wrapping_add(flavour as u64));
        let place = *pick(
            &mut r,
            &[Place::Room, Place::Room, Place::Floor, Place::Corner, Place::TwoRooms],
        );
        let bodies = 2 + whole(&mut r, 4);
        let mut things: Vec<Thing> = Vec::new();
        for k in 0..bodies {
            let what = if k == 0 { What::Lamp } else { *pick(&mut r, &SOLIDS) };
            let thing = draw_thing(&mut r, flavour, what, &things);
            things.push(thing);
        }
        let lit = matches!(flavour, Flavour::Lights | Flavour::Glows);
        let lights = if lit { 1 + whole(&mut r, 2) } else { 0 };
        for _ in 0..lights {
            let what = *pick(&mut r, &LIGHTS);
            let thing = draw_thing(&mut r, flavour, what, &things);
            things.push(thing);
        }
        let solve = if r.unit() < 0.5 {
            Ok(*pick(&mut r, &[0.1, 0.2, 0.3, 0.4]))
        } else {
            Err((*pick(&mut r, &[0.1, 0.2, 0.3]), *pick(&mut r, &[0.01, 0.05])))
        };
        let times_s = draw_times(&mut r, steps);
        let dark = r.unit() < 0.1;
        let glow = match flavour {
            Flavour::Glows => {
                (0..KEYS).map(|_| *pick(&mut r, &[0.0, 0.2, 0.9, 1.0, 1.0, 7.0])).collect()
            }
            _ => Vec::new(),
        };
        if flavour == Flavour::Glows && r.unit() < 0.3 {
            things.iter_mut().for_each(|thing| (thing.slides, thing.turns) = (false, false));
        }
        Recipe { place, things, dark, glow, solve, aim: Aim::Mesh, times_s }
    }

    /// The same scene, at times that go steadily on, with a pause, an odd step or a step back now and
    /// then: what certificates are for.
    pub(crate) fn steady(flavour: Flavour, seed: u64, steps: usize) -> Recipe {
        let mut r = Random(seed.wrapping_mul(0x7654_3211).wrapping_add(flavour as u64));
        let pace = *pick(&mut r, &[0.001, 0.01, 0.04, 0.2]);
        let mut times_s = vec![r.between(0.0, KEYS as f64 - 1.5)];
        while times_s.len() <= steps {
            let last = *times_s.last().expect("not empty");
            let step = match whole(&mut r, 40) {
                0 => -3.0,
                1 => 0.0,
                2 => 20.0,
                3 | 4 => 0.5,
                5 | 6 => 2.7,
                _ => 1.0,
            };
            times_s.push(last + step * pace);
        }
        Recipe { times_s, ..Recipe::draw(flavour, seed, 1) }
    }

    pub(crate) fn options(&self) -> Options {
        match self.solve {
            Ok(tolerance) => Options { aim: self.aim.clone(), ..at_tolerance(tolerance) },
            Err((epsilon, min_area)) => {
                Options { tolerance: 0.1, ..form_factor_oracle(epsilon, min_area) }
            }
        }
    }

    pub(crate) fn scene(&self) -> Arc<Scene> {
        let mut b = SceneBuilder::new("random motion");
        let light = if self.dark { 0.0 } else { 1.0 };
        let grey = b.material("grey", [0.5, 0.6, 0.3], [0.0; 3]);
        let both = b.double_sided_material("both", [0.3, 0.2, 0.7], [0.0; 3]);
        let lamp = b.material("lamp", [0.1; 3], [9.0 * light, 6.0 * light, 3.0 * light]);
        let room = still(&mut b, "place");
        let floor = facing_up([-1.0, 1.0], [-1.0, 1.0], -1.0);
        match self.place {
            Place::Room => b.cuboid_inward(room, "walls", grey, DVec3::splat(-1.0), DVec3::ONE),
            Place::Floor => b.polygon(room, "floor", grey, &floor),
            Place::Corner => {
                b.polygon(room, "floor", both, &floor);
                let wall = [v(-1., -1., -1.), v(-1., 1., -1.), v(-1., 1., 1.), v(-1., -1., 1.)];
                b.polygon(room, "wall", both, &wall);
            }
            Place::TwoRooms => {
                b.cuboid_inward(room, "walls", grey, DVec3::splat(-1.0), DVec3::ONE);
                b.cuboid_inward(room, "other", grey, v(3.0, -1.0, -1.0), v(4.0, 0.0, 1.0));
                let down =
                    [v(-0.1, -0.1, 0.9), v(-0.1, 0.1, 0.9), v(0.1, 0.1, 0.9), v(0.1, -0.1, 0.9)];
                b.polygon(room, "other lamp", lamp, &down.map(|p| p + v(3.5, -0.5, 0.0)));
            }
        }
        let mut last = None;
        for (k, thing) in self.things.iter().enumerate() {
            last = Some(thing.build(&mut b, k, last, [grey, both, lamp], light));
        }
        if !self.glow.is_empty() {
            let times_s: Vec<f64> = (0..self.glow.len()).map(|k| k as f64).collect();
            let track = |full: [f64; 3]| Track {
                times_s: times_s.clone(),
                values: self.glow.iter().map(|&g| DVec3::from_array(full) * (g * light)).collect(),
                interpolation: Interpolation::Linear,
            };
            b.animate_exitance(lamp, track([9.0, 6.0, 3.0]));
            for (k, thing) in self.things.iter().enumerate() {
                if LIGHTS.contains(&thing.what) {
                    b.animate_intensity(&format!("{:?} {k}", thing.what), track([3.0; 3]));
                }
            }
        }
        Arc::new(b.build().unwrap())
    }
}

impl Thing {
    fn build(
        &self,
        b: &mut SceneBuilder,
        k: usize,
        last: Option<NodeId>,
        [grey, both, lamp]: [MaterialId; 3],
        light: f64,
    ) -> NodeId {
        let name = format!("{:?} {k}", self.what);
        let parent = last.filter(|_| self.rides);
        let node = b.node(&name, parent, self.keys[0].0, self.keys[0].1);
        self.animate(b, node);
        let s = self.size;
        let corner = |k: i32, z: f64| {
            DQuat::from_rotation_z(f64::from(k) * TAU / 6.0) * v(s, 0., 0.) + v(0., 0., z)
        };
        match self.what {
            What::Box => b.cuboid(node, &name, grey, DVec3::splat(-s), DVec3::splat(s)),
            What::Tetrahedron => {
                let p = [v(s, s, s), v(-s, -s, s), v(-s, s, -s), v(s, -s, -s)];
                for [i, j, k] in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
                    let (p, q, r) = (p[i], p[j], p[k]);
                    let outward = (q - p).cross(r - p).dot(p + q + r) > 0.0;
                    b.polygon(node, &name, grey, &if outward { [p, q, r] } else { [p, r, q] });
                }
            }
            What::Prism => {
                let base = [v(-s, -s, -s), v(s, -s, -s), v(0.0, s, -s)];
                let top = base.map(|p| p + v(0.0, 0.0, 2.0 * s));
                b.polygon(node, &name, grey, &top);
                b.polygon(node, &name, grey, &[base[0], base[2], base[1]]);
                for i in 0..3 {
                    let j = (i + 1) % 3;
                    b.polygon(node, &name, grey, &[base[i], base[j], top[j], top[i]]);
                }
            }
            What::Hexagon => {
                b.polygon(node, &name, both, &[0, 1, 2, 3, 4, 5].map(|k| corner(k, 0.0)))
            }
            What::Sheet => {
                b.polygon(node, &name, both, &facing_up([-s, s], [-0.5 * s, 0.5 * s], 0.0))
            }
            What::Lamp => {
                let mut down = facing_up([-s, s], [-s, s], 0.0);
                down.reverse();
                b.polygon(node, &name, lamp, &down);
            }
            What::Point => b.light(&name, node, LightKind::Point, [2.0 * light; 3]),
            What::Spot => {
                b.light(&name, node, LightKind::Spot { inner: 0.3, outer: 0.6 }, [5.0 * light; 3]);
            }
            What::Sun => b.light(&name, node, LightKind::Directional, [3.0 * light; 3]),
        }
        node
    }

    fn animate(&self, b: &mut SceneBuilder, node: NodeId) {
        let times_s: Vec<f64> = (0..self.keys.len()).map(|k| k as f64).collect();
        let interpolation = Interpolation::Linear;
        if self.slides {
            let values = self.keys.iter().map(|k| k.0).collect();
            b.animate_translation(node, Track { times_s: times_s.clone(), values, interpolation });
        }
        if self.turns {
            let values = self.keys.iter().map(|k| k.1).collect();
            b.animate_rotation(node, RotationTrack { times_s, values, interpolation });
        }
        if !self.presence.is_empty() {
            b.animate_presence(node, self.presence.clone());
        }
    }

    /// Distance from its middle to its underside when upright.
    fn height(what: What, size: f64) -> f64 {
        match what {
            What::Box | What::Tetrahedron | What::Prism => size,
            _ => 0.0,
        }
    }
}

fn whole(r: &mut Random, below: usize) -> usize {
    (r.unit() * below as f64) as usize
}

fn pick<'a, T>(r: &mut Random, from: &'a [T]) -> &'a T {
    &from[whole(r, from.len())]
}

fn draw_thing(r: &mut Random, flavour: Flavour, what: What, others: &[Thing]) -> Thing {
    let size = *pick(r, &[0.125, 0.25, 0.375]);
    let mut keys: Vec<(DVec3, DQuat)> = Vec::new();
    for _ in 0..KEYS {
        let key = match keys.last() {
            // It rests, or moves by next to nothing.
            Some(last) if r.unit() < 0.25 => *last,
            Some(last) if r.unit() < 0.1 => {
                (last.0 + DVec3::splat(*pick(r, &[1e-12, 1e-7, 1e-3])), last.1)
            }
            _ => draw_pose(r, flavour, what, size, others),
        };
        keys.push(key);
    }
    let comes_and_goes =
        flavour == Flavour::Jumps && r.unit() < 0.5 || flavour == Flavour::Lights && r.unit() < 0.2;
    let presence = if comes_and_goes {
        (0..KEYS).map(|k| (k as f64, r.unit() < 0.6)).collect()
    } else {
        Vec::new()
    };
    Thing {
        what,
        size,
        keys,
        slides: r.unit() < 0.75,
        turns: r.unit() < 0.5,
        presence,
        rides: !others.is_empty() && flavour == Flavour::Families && r.unit() < 0.6,
    }
}

fn draw_pose(
    r: &mut Random,
    flavour: Flavour,
    what: What,
    size: f64,
    others: &[Thing],
) -> (DVec3, DQuat) {
    let upright = DQuat::from_rotation_z(*pick(r, &[0.0, 0.0, 0.5, 1.0]));
    let inside = r.point(DVec3::splat(-0.7), DVec3::splat(0.7));
    match (flavour, whole(r, 6)) {
        // Exactly on the floor.
        (Flavour::Contact, 0 | 1) => {
            (v(inside.x, inside.y, Thing::height(what, size) - 1.0), upright)
        }
        // Face to face with another, where that stands upright.
        (Flavour::Contact, 2 | 3) if !others.is_empty() => {
            let other = pick(r, others);
            let (at, _) = *pick(r, &other.keys);
            let step = *pick(r, &[DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO]);
            (at + step * (size + other.size), DQuat::IDENTITY)
        }
        // Half through a wall, or flush with it.
        (Flavour::Contact, 4) => {
            (v(*pick(r, &[1.0, 1.0 - size, -1.0]), inside.y, inside.z), upright)
        }
        (Flavour::Jumps, 0) => {
            (r.rotation() * DVec3::X * *pick(r, &[2.0, 30.0, 1e4]), r.rotation())
        }
        (Flavour::Lights, 0) => (v(0.0, 0.0, 1.0), DQuat::IDENTITY),
        _ if r.unit() < 0.3 => (inside, DQuat::IDENTITY),
        _ => (inside, r.rotation()),
    }
}

/// Forward by thirds, then anywhere, and back to where it has been.
fn draw_times(r: &mut Random, steps: usize) -> Vec<f64> {
    let mut times_s = vec![0.0];
    while times_s.len() <= steps {
        let last = *times_s.last().expect("not empty");
        let next = match whole(r, 8) {
            0..=2 => last + *pick(r, &[0.01, 0.25, 1.0]),
            3 => whole(r, KEYS) as f64,
            4 => times_s[whole(r, times_s.len())],
            5 => last,
            _ => r.between(-0.5, KEYS as f64),
        };
        times_s.push(if next > KEYS as f64 { 0.0 } else { next });
    }
    times_s
}
