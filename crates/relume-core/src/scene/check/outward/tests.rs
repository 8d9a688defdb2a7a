//! Rooms and what is no room, drawn at random from a seed.

use glam::{DQuat, DVec3};

use crate::scene::builder::cuboid_sides;
use crate::scene::check::draw::Draw;
use crate::scene::{MaterialId, Note, SceneBuilder, check};

/// A scene under construction, turned about the vertical and moved.
struct Stage {
    b: SceneBuilder,
    turn: DQuat,
    at: DVec3,
    one_sided: MaterialId,
    two_sided: MaterialId,
    glow: MaterialId,
}

impl Stage {
    fn new(draw: &mut Draw) -> Stage {
        let mut b = SceneBuilder::new("s");
        let one_sided = b.material("one", [0.5; 3], [0.0; 3]);
        let two_sided = b.double_sided_material("two", [0.5; 3], [0.0; 3]);
        let glow = b.material("glow", [0.0; 3], [10.0; 3]);
        let turn = DQuat::from_rotation_y(draw.within(0.0, 6.3));
        let at = DVec3::new(draw.within(-9.0, 9.0), draw.within(-1.0, 4.0), draw.within(-9.0, 9.0));
        Stage { b, turn, at, one_sided, two_sided, glow }
    }

    /// A polygon that is an object; counter-clockwise from the front.
    fn panel(&mut self, name: &str, material: MaterialId, corners: &[DVec3]) {
        let node = self.b.node(name, None, self.at, self.turn);
        self.b.polygon(node, name, material, corners);
    }

    /// A box that is an object, its outside seen.
    fn block(&mut self, name: &str, low: DVec3, high: DVec3) {
        let node = self.b.node(name, None, self.at, self.turn);
        let material = self.one_sided;
        self.b.cuboid(node, name, material, low, high);
    }

    /// A lamp that faces down.
    fn lamp(&mut self, at: DVec3, size: f64) {
        let c = |x: f64, z: f64| at + DVec3::new(x, 0.0, z) * size;
        let glow = self.glow;
        self.panel("lamp", glow, &[c(0., 0.), c(1., 0.), c(1., 1.), c(0., 1.)]);
    }

    fn flipped(self) -> Vec<String> {
        let scene = self.b.build().unwrap();
        let notes: Vec<Note> = check(&scene);
        let flipped = notes.into_iter().filter(|note| note.code == "flipped-normals");
        flipped.map(|note| note.subject).collect()
    }
}

/// Sides of a box, facing inwards, with their names; without its top if that is open. Each ends so far before the others.
fn sides(low: DVec3, high: DVec3, gap: f64, open: bool) -> Vec<(&'static str, Vec<DVec3>)> {
    let all = cuboid_sides(low, high);
    let mut found = Vec::new();
    for side in all {
        let normal = (side[1] - side[0]).cross(side[2] - side[0]).normalize();
        let middle = side.iter().sum::<DVec3>() / 4.0;
        let name = match normal.to_array() {
            [x, ..] if x > 0.5 => "east",
            [x, ..] if x < -0.5 => "west",
            [_, y, _] if y > 0.5 => "ceiling",
            [_, y, _] if y < -0.5 => "floor",
            [.., z] if z > 0.5 => "south",
            _ => "north",
        };
        if open && name == "ceiling" {
            continue;
        }
        let shrunk =
            |c: &DVec3| *c - (*c - middle).signum() * (*c - middle).abs().min(DVec3::splat(gap));
        let mut corners: Vec<DVec3> = side.iter().map(shrunk).collect();
        corners.reverse();
        found.push((name, corners));
    }
    found
}

/// A room of separate objects and what stands in it; a wall of it may face outwards.
fn room(seed: u64, flip: bool) -> (Vec<String>, String) {
    let mut draw = Draw(seed);
    let mut stage = Stage::new(&mut draw);
    let size = DVec3::new(draw.within(1.5, 12.0), draw.within(2.0, 4.0), draw.within(1.5, 12.0));
    let gap = [0.0, 0.005, 0.001][draw.below(3)];
    let (open, double) = (draw.one_in(2), draw.one_in(2));
    let sides = sides(DVec3::ZERO, size, gap, open);
    let which = draw.below(sides.len());
    for (k, (name, corners)) in sides.iter().enumerate() {
        let mut corners = corners.clone();
        if flip && k == which {
            corners.reverse();
        }
        let material = if double && k != which { stage.two_sided } else { stage.one_sided };
        stage.panel(name, material, &corners);
    }
    let lamp = DVec3::new(draw.within(0.2, 0.7), draw.within(0.5, 0.9), draw.within(0.2, 0.7));
    stage.lamp(size * lamp, draw.within(0.1, 0.2));
    for k in 0..draw.below(5) {
        let low = size * DVec3::new(draw.within(0.02, 0.7), 0.0, draw.within(0.02, 0.7));
        let extent =
            DVec3::new(draw.within(0.2, 0.28), draw.within(0.1, 0.4), draw.within(0.2, 0.28));
        let high = (low + size * extent).min(size * 0.98);
        stage.block(&format!("crate {k}"), low, high);
    }
    let wanted = if flip { sides[which].0.to_owned() } else { String::new() };
    (stage.flipped(), wanted)
}

#[test]
fn a_wall_that_faces_out_of_its_room_is_named_in_every_kind_of_room() {
    for seed in 0..200 {
        let (found, wanted) = room(seed, true);
        assert_eq!(found, [wanted], "seed {seed}");
    }
}

#[test]
fn sound_rooms_are_passed() {
    for seed in 0..200 {
        assert_eq!(room(seed, false).0, [""; 0], "seed {seed}");
    }
}

#[test]
fn a_floor_that_is_wider_than_its_room_hides_no_wall_that_faces_outwards() {
    for seed in 0..100 {
        let mut draw = Draw(seed);
        let mut stage = Stage::new(&mut draw);
        let size = DVec3::new(draw.within(2.0, 8.0), draw.within(2.0, 4.0), draw.within(2.0, 8.0));
        let wide = draw.within(1.0, 6.0);
        let walls = sides(DVec3::ZERO, size, 0.0, true);
        let which = draw.below(4);
        let mut wanted = "";
        let upright = walls.iter().filter(|wall| wall.0 != "floor").enumerate();
        let one_sided = stage.one_sided;
        for (k, (name, corners)) in upright {
            let mut corners = corners.clone();
            if k == which {
                corners.reverse();
                wanted = *name;
            }
            stage.panel(name, one_sided, &corners);
        }
        ground(&mut stage, DVec3::ZERO - wide, size + wide);
        stage.lamp(size * 0.45, 0.2);
        assert_eq!(stage.flipped(), [wanted], "seed {seed}");
    }
}

/// A floor of height 0 that faces up.
fn ground(stage: &mut Stage, low: DVec3, high: DVec3) {
    let c = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let corners = [c(low.x, low.z), c(low.x, high.z), c(high.x, high.z), c(high.x, low.z)];
    let material = stage.one_sided;
    stage.panel("ground", material, &corners);
}

/// What stands about in the open or in a room, and is as it should be.
fn sound(seed: u64) -> Vec<String> {
    let mut draw = Draw(seed);
    let mut stage = Stage::new(&mut draw);
    let extent = draw.within(8.0, 30.0);
    let (low, high) = (DVec3::new(-extent, 0.0, -extent), DVec3::new(extent, 4.0, extent));
    if draw.one_in(2) {
        for (name, corners) in sides(low, high, 0.0, draw.one_in(2)) {
            let one_sided = stage.one_sided;
            stage.panel(name, one_sided, &corners);
        }
    } else {
        ground(&mut stage, low, high);
    }
    let lamp = DVec3::new(draw.within(-4.0, 4.0), draw.within(3.0, 3.9), draw.within(-4.0, 4.0));
    stage.lamp(lamp, 0.3);
    for k in 0..1 + draw.below(6) {
        let at = DVec3::new(draw.within(-0.8, 0.6) * extent, 0.0, draw.within(-0.8, 0.6) * extent);
        let (w, h, d) = (draw.within(0.5, 3.0), draw.within(0.5, 2.5), draw.within(0.4, 3.0));
        let boarded = draw.one_in(2);
        let name = |part: &str| format!("{part} {k}");
        let whole = sides(at, at + DVec3::new(w, h, d), 0.0, false);
        let (one_sided, two_sided) = (stage.one_sided, stage.two_sided);
        let outwards = |stage: &mut Stage, parts: &[&str], but: &str, double: bool| {
            for (part, corners) in whole.iter().filter(|(part, _)| parts.contains(part)) {
                let mut corners = corners.clone();
                corners.reverse();
                let material = if double && *part != but { two_sided } else { one_sided };
                stage.panel(&name(part), material, &corners);
            }
        };
        match draw.below(6) {
            // A panel, a screen of three, the outside of a house, a cupboard without a bottom, a table with aprons, a box without a lid.
            0 => outwards(&mut stage, &["north"], "", false),
            1 => outwards(&mut stage, &["north", "west", "east"], "", false),
            2 => outwards(&mut stage, &["north", "west", "east", "south", "ceiling"], "", false),
            3 => outwards(&mut stage, &["north", "west", "east", "south"], "", false),
            4 => outwards(
                &mut stage,
                &["north", "west", "east", "south", "ceiling"],
                "ceiling",
                boarded,
            ),
            _ => {
                outwards(&mut stage, &["north", "west", "east", "south", "floor"], "south", boarded)
            }
        }
    }
    stage.flipped()
}

#[test]
fn panels_furniture_and_outsides_of_houses_are_passed() {
    for seed in 0..400 {
        assert_eq!(sound(seed), [""; 0], "seed {seed}");
    }
}

/// The sides of a closed room of which some face outwards, by number, as they are named.
fn room_with(draw: &mut Draw, turned: &[usize]) -> (Vec<String>, Vec<String>) {
    let mut stage = Stage::new(draw);
    let size = DVec3::new(draw.within(2.0, 8.0), draw.within(2.0, 4.0), draw.within(2.0, 8.0));
    let one_sided = stage.one_sided;
    let mut wanted = Vec::new();
    for (k, (name, mut corners)) in sides(DVec3::ZERO, size, 0.0, false).into_iter().enumerate() {
        if turned.contains(&k) {
            corners.reverse();
            wanted.push(name.to_owned());
        }
        stage.panel(name, one_sided, &corners);
    }
    stage.lamp(size * DVec3::new(0.45, 0.8, 0.5), 0.2);
    let mut found = stage.flipped();
    found.sort();
    wanted.sort();
    (found, wanted)
}

#[test]
fn walls_beside_each_other_that_face_outwards_are_all_named() {
    let mut draw = Draw(7);
    for seed in 0..40 {
        for one in 0..6 {
            for other in one + 1..6 {
                let (found, wanted) = room_with(&mut draw, &[one, other]);
                assert_eq!(found, wanted, "seed {seed}");
            }
        }
    }
}

#[test]
fn three_walls_about_a_corner_that_face_outwards_are_all_named() {
    let normals = |k: usize| {
        let c = &sides(DVec3::ZERO, DVec3::ONE, 0.0, false)[k].1;
        (c[1] - c[0]).cross(c[2] - c[0])
    };
    let mut draw = Draw(3);
    for seed in 0..10 {
        for one in 0..6 {
            for other in one + 1..6 {
                for third in other + 1..6 {
                    let [p, q, r] = [one, other, third].map(normals);
                    if p.cross(q).dot(r).abs() > 0.5 {
                        let (found, wanted) = room_with(&mut draw, &[one, other, third]);
                        assert_eq!(found, wanted, "seed {seed}");
                    }
                }
            }
        }
    }
}
