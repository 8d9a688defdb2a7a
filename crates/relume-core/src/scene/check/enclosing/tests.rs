//! Rooms of thin and thick walls, of one and of two, drawn at random from a seed, of which walls and furniture are turned.

use std::collections::BTreeSet;

use glam::{DQuat, DVec3};

use crate::scene::builder::cuboid_sides;
use crate::scene::check::draw::Draw;
use crate::scene::{MaterialId, SceneBuilder, check};

/// An object: its name, and its polygons as they should face.
struct Object {
    name: String,
    polygons: Vec<Vec<DVec3>>,
}

/// The objects of a house.
#[derive(Default)]
struct House {
    objects: Vec<Object>,
}

impl House {
    fn add(&mut self, name: &str, polygons: Vec<Vec<DVec3>>) {
        self.objects.push(Object { name: name.to_owned(), polygons });
    }

    fn block(&mut self, name: &str, low: DVec3, high: DVec3) {
        let sides = cuboid_sides(low, high).iter().map(|side| side.to_vec()).collect();
        self.add(name, sides);
    }

    /// An upright wall from `a` to `b`, its front on the left seen from above, maybe with a door or a window.
    fn wall(&mut self, draw: &mut Draw, name: &str, [a, b]: [DVec3; 2], height: f64, thick: f64) {
        let along = b - a;
        let (door, sill, head) = match draw.below(3) {
            0 => (Some([0.4, 0.62]), 0.0, 0.7 * height),
            1 => (Some([0.25, 0.6]), 0.35 * height, 0.7 * height),
            _ => (None, 0.0, height),
        };
        let mut pieces = Vec::new();
        match door {
            None => pieces.push(([0.0, 1.0], [0.0, height])),
            Some([from, to]) => {
                pieces.push(([0.0, from], [0.0, height]));
                pieces.push(([to, 1.0], [0.0, height]));
                pieces.push(([from, to], [head, height]));
                if sill > 0.0 {
                    pieces.push(([from, to], [0.0, sill]));
                }
            }
        }
        let up = DVec3::Y;
        let apart = draw.one_in(2);
        let mut all = Vec::new();
        for (k, ([s, e], [low, high])) in pieces.into_iter().enumerate() {
            let at = |x: f64, y: f64| a + along * x + up * y;
            let polygons = if thick > 0.0 {
                let out = up.cross(along).normalize() * thick;
                let (p, q) = (at(s, low), at(e, high) + out);
                cuboid_sides(p.min(q), p.max(q)).iter().map(|side| side.to_vec()).collect()
            } else {
                vec![vec![at(s, low), at(e, low), at(e, high), at(s, high)]]
            };
            if apart || thick > 0.0 {
                self.add(&format!("{name} {k}"), polygons);
            } else {
                all.extend(polygons);
            }
        }
        if !all.is_empty() {
            self.add(name, all);
        }
    }

    /// A floor or a ceiling over rectangles, thin or thick.
    fn level(&mut self, name: &str, over: &[[DVec3; 2]], y: f64, is_floor: bool, thick: f64) {
        if thick > 0.0 {
            for (k, [low, high]) in over.iter().enumerate() {
                let (below, above) = if is_floor { (y - thick, y) } else { (y, y + thick) };
                let (low, high) = (low.with_y(below), high.with_y(above));
                self.block(&format!("{name} {k}"), low, high);
            }
            return;
        }
        let mut polygons = Vec::new();
        for [low, high] in over {
            let at = |x: f64, z: f64| DVec3::new(x, y, z);
            let mut flat =
                vec![at(low.x, low.z), at(low.x, high.z), at(high.x, high.z), at(high.x, low.z)];
            if !is_floor {
                flat.reverse();
            }
            polygons.push(flat);
        }
        self.add(name, polygons);
    }

    fn table(&mut self, name: &str, low: DVec3, high: DVec3) {
        let top = 0.04;
        let mut polygons: Vec<Vec<DVec3>> = Vec::new();
        let mut block = |low: DVec3, high: DVec3| {
            polygons.extend(cuboid_sides(low, high).iter().map(|side| side.to_vec()));
        };
        block(low.with_y(high.y - top), high);
        for (x, z) in [(0.05, 0.05), (0.85, 0.05), (0.05, 0.85), (0.85, 0.85)] {
            let from = low + DVec3::new(x, 0.0, z) * (high - low);
            block(from, (from + DVec3::new(0.1, 0.0, 0.1) * (high - low)).with_y(high.y - top));
        }
        self.add(name, polygons);
    }
}

/// Corners of the floor's outline, seen from above with the inside on the right of x towards -z; rectangles that tile it.
fn plan(draw: &mut Draw) -> (Vec<DVec3>, Vec<[DVec3; 2]>) {
    let (w, d) = (draw.within(2.5, 9.0), draw.within(2.5, 9.0));
    let p = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    if draw.one_in(3) {
        let (x, z) = (draw.within(0.35, 0.65) * w, draw.within(0.35, 0.65) * d);
        let outline = vec![p(0., 0.), p(w, 0.), p(w, z), p(x, z), p(x, d), p(0., d)];
        return (outline, vec![[p(0., 0.), p(w, z)], [p(0., z), p(x, d)]]);
    }
    (vec![p(0., 0.), p(w, 0.), p(w, d), p(0., d)], vec![[p(0., 0.), p(w, d)]])
}

/// What is named in a random house and what is turned in it. With `turn` up to three walls and pieces of furniture are.
fn house(seed: u64, turn: bool) -> (BTreeSet<String>, BTreeSet<String>, String) {
    let mut draw = Draw(seed);
    let mut house = House::default();
    let height = draw.within(2.2, 3.5);
    let thick = [0.0, 0.0, 0.1, 0.25][draw.below(4)];
    let (outline, over) = plan(&mut draw);
    for k in 0..outline.len() {
        let ends = [outline[k], outline[(k + 1) % outline.len()]];
        house.wall(&mut draw, &format!("wall {k}"), ends, height, thick);
    }
    house.level("floor", &over, 0.0, true, thick);
    house.level("ceiling", &over, height, false, thick);
    let [low, high] = over[0];
    let mut lamps = vec![low.lerp(high, 0.3)];
    if draw.one_in(3) {
        // A wall between two rooms, with a door.
        let x = draw.within(0.4, 0.6) * high.x;
        let depth = over[0][1].z;
        let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        house.block("between 0", at(x, 0., 0.), at(x + 0.1, height, 0.5 * depth));
        let door = at(x + 0.1, height, 0.7 * depth);
        house.block("between 1", at(x, 2.0, 0.5 * depth), door);
        house.block("between 2", at(x, 0., 0.7 * depth), at(x + 0.1, height, depth));
        lamps.push(low.lerp(high, 0.8));
    }
    for k in 0..draw.below(5) {
        let [low, high] = over[draw.below(over.len())];
        let span = high - low;
        let from = low + span * DVec3::new(draw.within(0.05, 0.7), 0., draw.within(0.05, 0.7));
        let stands_off = if draw.one_in(2) { 0.0 } else { 0.01 };
        let from = from.with_y(stands_off);
        let size = DVec3::new(
            draw.within(0.1, 0.25) * span.x,
            draw.within(0.3, 1.6),
            draw.within(0.1, 0.25) * span.z,
        );
        match draw.below(3) {
            0 => house.table(&format!("table {k}"), from, from + size.with_y(0.75)),
            _ => house.block(&format!("crate {k}"), from, from + size),
        }
    }
    let mut turned = BTreeSet::new();
    let count = if turn { 1 + draw.below(3) } else { 0 };
    for _ in 0..count {
        let k = draw.below(house.objects.len());
        turned.insert(house.objects[k].name.clone());
    }
    let what = format!("thick {thick}, {} walls, {} lamps", outline.len(), lamps.len());
    (named(&mut draw, &house, &lamps, height, &turned), turned, what)
}

/// What `check` says faces the wrong way.
fn named(
    draw: &mut Draw,
    house: &House,
    lamps: &[DVec3],
    height: f64,
    turned: &BTreeSet<String>,
) -> BTreeSet<String> {
    let mut b = SceneBuilder::new("s");
    let grey: MaterialId = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [10.0; 3]);
    let turn = DQuat::from_rotation_y(draw.within(0.0, 6.3));
    for object in &house.objects {
        let node = b.node(&object.name, None, DVec3::ZERO, turn);
        for polygon in &object.polygons {
            let mut polygon = polygon.clone();
            // Outlines are drawn clockwise from inside.
            if turned.contains(&object.name) {
                polygon.reverse();
            }
            b.polygon(node, &object.name, grey, &polygon);
        }
    }
    for (k, lamp) in lamps.iter().enumerate() {
        let name = format!("lamp {k}");
        let node = b.node(&name, None, turn * lamp.with_y(0.95 * height), turn);
        let c = |x: f64, z: f64| DVec3::new(x, 0.0, z) * 0.2;
        b.polygon(node, &name, glow, &[c(0., 0.), c(1., 0.), c(1., 1.), c(0., 1.)]);
    }
    let notes = check(&b.build().unwrap());
    let flipped = notes.into_iter().filter(|note| note.code == "flipped-normals");
    flipped.flat_map(|n| n.subject.split(", ").map(str::to_owned).collect::<Vec<_>>()).collect()
}

/// Houses of which all is named that is turned and nothing else, and houses with a wrong name.
fn judged(seeds: std::ops::Range<u64>) -> [usize; 2] {
    let mut out = [0; 2];
    for seed in seeds {
        let (named, turned, what) = house(seed, seed % 4 != 0);
        let is_wrong = !named.is_subset(&turned);
        out[0] += usize::from(named == turned);
        out[1] += usize::from(is_wrong);
        if named != turned {
            println!("seed {seed} ({what}): named {named:?}, turned {turned:?}");
        }
    }
    out
}

#[test]
fn walls_and_furniture_that_are_turned_are_named_in_houses_of_thin_and_thick_walls() {
    let [right, wrong] = judged(0..100);
    assert!(right >= 85 && wrong == 0, "{right} of 100 right, {wrong} with a wrong name");
}

#[test]
#[ignore = "measures; houses that nothing was set by"]
fn other_houses() {
    let [right, wrong] = judged(9000..9300);
    println!("{right} of 300 right, {wrong} with a wrong name");
    assert!(right >= 255 && wrong == 0, "{right} of 300 right, {wrong} with a wrong name");
}
