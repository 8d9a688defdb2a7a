//! Lit scenes of many kinds, on none of which the oracle was calibrated: what a solution says of its own error is compared on
//! them with what it is off by, and the tolerance with what one gets for it.

use glam::{DQuat, DVec3};
use relume_core::scene::{MaterialId, NodeId, Scene, SceneBuilder};

/// Draws a scene.
type Draw = fn(&mut Maker);

/// The scenes, by name.
pub(crate) const SCENES: &[(&str, Draw)] = &[
    ("pillar", pillar),
    ("hall of 60 boxes", hall),
    ("door at 22 degrees", |m| door(m, 22.0)),
    ("door at 90 degrees", |m| door(m, 90.0)),
    ("slit of 5 cm", slit),
    ("blinds", blinds),
    ("thin legs", legs),
    ("white room", white),
    ("bodies 5 mm apart", near),
    ("small lamps", small_lamps),
    ("sun through a window", sun),
    ("device in a hall", device),
    ("furniture", furniture),
    ("street", street),
    ("three rooms", rooms),
    ("cove", cove),
];

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A scene in the making: one node that rests, and a material for each reflectance or exitance.
pub(crate) struct Maker {
    b: SceneBuilder,
    node: NodeId,
    materials: Vec<([f64; 2], MaterialId)>,
}

impl Maker {
    /// The scene of a name.
    pub(crate) fn scene(name: &str) -> Scene {
        let (_, make) = SCENES.iter().find(|scene| scene.0 == name).expect("a scene of that name");
        let mut b = SceneBuilder::new(name);
        let node = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
        let mut maker = Maker { b, node, materials: Vec::new() };
        make(&mut maker);
        maker.b.build().expect("a whole scene")
    }

    fn material(&mut self, reflectance: f64, exitance: f64) -> MaterialId {
        let look = [reflectance, exitance];
        if let Some((_, known)) = self.materials.iter().find(|known| known.0 == look) {
            return *known;
        }
        let made = self.b.material("made", [reflectance; 3], [exitance; 3]);
        self.materials.push((look, made));
        made
    }

    /// A closed room from the origin.
    fn room(&mut self, reflectance: f64, size: DVec3) {
        let material = self.material(reflectance, 0.0);
        for (side, mut corners) in sides(DVec3::ZERO, size) {
            corners.reverse();
            self.b.polygon(self.node, side, material, &corners);
        }
    }

    fn block(&mut self, name: &str, reflectance: f64, lo: DVec3, hi: DVec3) {
        self.turned(name, reflectance, (lo, hi), 0.0);
    }

    /// A box as a body of its own, turned about a vertical axis through the lower corner, degrees.
    fn turned(&mut self, name: &str, reflectance: f64, (lo, hi): (DVec3, DVec3), degrees: f64) {
        let material = self.material(reflectance, 0.0);
        let node = self.b.node(name, None, lo, DQuat::from_rotation_z(degrees.to_radians()));
        self.b.cuboid(node, name, material, DVec3::ZERO, hi - lo);
    }

    /// A lamp that shines down.
    fn lamp(&mut self, exitance: f64, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64) {
        let material = self.material(0.0, exitance);
        let corners = [v(x0, y0, z), v(x0, y1, z), v(x1, y1, z), v(x1, y0, z)];
        self.b.polygon(self.node, "lamp", material, &corners);
    }

    fn polygon(&mut self, name: &str, [reflectance, exitance]: [f64; 2], corners: &[DVec3]) {
        let material = self.material(reflectance, exitance);
        self.b.polygon(self.node, name, material, corners);
    }
}

fn sides(lo: DVec3, hi: DVec3) -> [(&'static str, Vec<DVec3>); 6] {
    let corner = |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
        v(pick(0), pick(1), pick(2))
    };
    let side = |bits: [usize; 4]| bits.map(corner).to_vec();
    [
        ("west", side([0, 4, 6, 2])),
        ("east", side([1, 3, 7, 5])),
        ("south", side([0, 1, 5, 4])),
        ("north", side([2, 6, 7, 3])),
        ("floor", side([0, 2, 3, 1])),
        ("ceiling", side([4, 5, 7, 6])),
    ]
}

fn pillar(m: &mut Maker) {
    m.room(0.5, v(4.0, 3.0, 2.5));
    m.turned("pillar", 0.4, (v(1.6, 1.2, 0.0), v(2.0, 1.6, 1.9)), 20.0);
    m.lamp(80.0, [1.5, 2.3], [1.0, 1.8], 2.45);
}

fn hall(m: &mut Maker) {
    m.room(0.5, v(12.0, 8.0, 4.0));
    for k in 0..60_u32 {
        let (x, y) = (0.6 + f64::from(k % 10) * 1.15, 0.5 + f64::from(k / 10) * 1.25);
        let size = v(0.5, 0.4, 0.3 + 0.12 * f64::from(k * 7 % 11));
        m.turned("crate", 0.4, (v(x, y, 0.0), v(x, y, 0.0) + size), f64::from(k * 37 % 90));
    }
    m.lamp(60.0, [2.5, 4.5], [3.0, 5.0], 3.9);
    m.lamp(60.0, [8.0, 10.0], [3.0, 5.0], 3.9);
}

/// Two rooms of 4 x 3 m, a wall of 10 cm between them with a doorway, and its leaf.
fn door(m: &mut Maker, degrees: f64) {
    m.room(0.6, v(8.1, 3.0, 2.5));
    m.block("wall", 0.6, v(4.0, 0.0, 0.0), v(4.1, 1.0, 2.5));
    m.block("wall", 0.6, v(4.0, 1.9, 0.0), v(4.1, 3.0, 2.5));
    m.block("lintel", 0.6, v(4.0, 1.0, 2.05), v(4.1, 1.9, 2.5));
    m.turned("leaf", 0.6, (v(4.11, 1.0, 0.005), v(4.15, 1.89, 2.04)), -degrees);
    m.lamp(80.0, [1.5, 2.3], [1.1, 1.9], 2.45);
}

fn slit(m: &mut Maker) {
    m.room(0.6, v(8.0, 3.0, 2.5));
    m.block("wall", 0.6, v(3.95, 0.0, 0.0), v(4.05, 2.95, 2.5));
    m.lamp(100.0, [1.0, 1.8], [1.0, 1.8], 2.4);
}

fn blinds(m: &mut Maker) {
    m.room(0.5, v(4.0, 4.0, 2.6));
    // A bright window in the wall, and slats before it.
    let pane = [v(0.01, 1.0, 0.9), v(0.01, 3.0, 0.9), v(0.01, 3.0, 2.2), v(0.01, 1.0, 2.2)];
    m.polygon("pane", [0.0, 40.0], &pane);
    for k in 0..13 {
        let z = 0.9 + 0.1 * f64::from(k);
        m.block("slat", 0.6, v(0.1, 0.95, z), v(0.18, 3.05, z + 0.004));
    }
}

fn legs(m: &mut Maker) {
    m.room(0.5, v(5.0, 4.0, 2.6));
    let mut table = |at: DVec3, size: DVec3, thick: f64| {
        m.block("top", 0.4, at + v(0.0, 0.0, size.z), at + size + v(0.0, 0.0, 0.03));
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let foot = at + v(x * (size.x - thick), y * (size.y - thick), 0.0);
            m.block("leg", 0.4, foot, foot + v(thick, thick, size.z));
        }
    };
    table(v(1.5, 1.2, 0.0), v(1.6, 0.9, 0.72), 0.03);
    for k in 0..3 {
        table(v(1.5 + 0.6 * f64::from(k), 0.6, 0.0), v(0.4, 0.4, 0.45), 0.02);
        table(v(1.5 + 0.6 * f64::from(k), 2.3, 0.0), v(0.4, 0.4, 0.45), 0.02);
    }
    m.lamp(300.0, [2.0, 2.3], [1.5, 1.8], 2.55);
}

fn white(m: &mut Maker) {
    m.room(0.9, v(5.0, 4.0, 3.0));
    m.turned("box", 0.9, (v(1.0, 1.0, 0.0), v(2.0, 1.8, 1.2)), 15.0);
    m.turned("box", 0.8, (v(3.2, 1.5, 0.0), v(3.9, 2.4, 0.8)), -25.0);
    m.lamp(20.0, [2.2, 3.0], [1.6, 2.4], 2.9);
}

fn near(m: &mut Maker) {
    m.room(0.6, v(4.0, 3.0, 2.5));
    m.block("cabinet", 0.5, v(0.005, 0.6, 0.005), v(0.6, 1.4, 1.8));
    m.block("cabinet", 0.5, v(0.005, 1.405, 0.005), v(0.6, 2.2, 1.8));
    m.block("chest", 0.5, v(2.0, 1.0, 0.005), v(2.8, 1.5, 0.5));
    m.block("chest", 0.5, v(2.0, 1.505, 0.005), v(2.8, 2.0, 0.7));
    m.block("plank", 0.5, v(1.9, 0.9, 0.705), v(2.9, 2.1, 0.73));
    m.lamp(60.0, [1.5, 2.5], [0.4, 0.9], 2.45);
}

fn small_lamps(m: &mut Maker) {
    m.room(0.4, v(6.0, 4.0, 2.8));
    for (x, y) in [(1.0, 1.0), (3.0, 1.2), (5.0, 1.0), (1.0, 3.0), (3.0, 2.8), (5.0, 3.0)] {
        m.lamp(4000.0, [x, x + 0.06], [y, y + 0.06], 2.75);
    }
    m.turned("desk", 0.5, (v(1.6, 1.4, 0.0), v(3.0, 2.1, 0.75)), 12.0);
    m.turned("shelf", 0.5, (v(4.2, 2.0, 0.0), v(4.5, 3.4, 2.0)), 5.0);
}

/// A room with a window of 1.5 x 1.2 m in a wall of 20 cm, and beyond it a yard with a bright square, 2 degrees wide.
fn sun(m: &mut Maker) {
    m.room(0.5, v(15.0, 8.0, 8.0));
    // The room is the far end of it: x from 10 m on, under a ceiling of its own.
    m.block("wall", 0.5, v(9.8, 0.0, 0.0), v(10.0, 3.0, 8.0));
    m.block("wall", 0.5, v(9.8, 4.5, 0.0), v(10.0, 8.0, 8.0));
    m.block("sill", 0.5, v(9.8, 3.0, 0.0), v(10.0, 4.5, 0.9));
    m.block("lintel", 0.5, v(9.8, 3.0, 2.1), v(10.0, 4.5, 8.0));
    m.block("ceiling", 0.6, v(10.0, 0.0, 2.6), v(15.0, 8.0, 2.8));
    m.block("desk", 0.4, v(11.5, 3.2, 0.0), v(12.3, 4.4, 0.75));
    let (at, along) = (v(1.0, 2.5, 7.0), v(10.0, 1.2, -5.5).normalize());
    let across = along.cross(DVec3::Z).normalize();
    let up = across.cross(along);
    let corner = |x: f64, y: f64| at + (across * x + up * y) * 0.2;
    let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    m.polygon("sun", [0.0, 30000.0], &corners);
}

fn device(m: &mut Maker) {
    m.room(0.5, v(10.0, 10.0, 4.0));
    m.block("top", 0.5, v(4.0, 4.0, 0.7), v(5.6, 4.8, 0.74));
    for (x, y) in [(4.0, 4.0), (5.54, 4.0), (4.0, 4.74), (5.54, 4.74)] {
        m.block("leg", 0.5, v(x, y, 0.0), v(x + 0.06, y + 0.06, 0.7));
    }
    m.block("device", 0.4, v(4.8, 4.4, 0.7405), v(4.82, 4.43, 0.7505));
    m.block("pin", 0.4, v(4.83, 4.4, 0.7405), v(4.832, 4.402, 0.76));
    m.lamp(60.0, [3.0, 4.5], [5.0, 6.5], 3.9);
}

fn furniture(m: &mut Maker) {
    m.room(0.6, v(5.0, 4.0, 2.6));
    for k in 0..5 {
        let z = 0.02 + 0.4 * f64::from(k);
        m.block("board", 0.6, v(0.02, 0.6, z), v(0.35, 1.8, z + 0.02));
    }
    m.block("side", 0.6, v(0.02, 0.57, 0.0), v(0.35, 0.6, 1.8));
    m.block("side", 0.6, v(0.02, 1.8, 0.0), v(0.35, 1.83, 1.8));
    m.block("bed", 0.7, v(2.8, 0.05, 0.2), v(4.9, 1.5, 0.5));
    m.turned("chest", 0.5, (v(3.2, 2.6, 0.0), v(4.0, 3.2, 0.8)), 18.0);
    m.turned("stool", 0.5, (v(1.6, 2.0, 0.0), v(2.0, 2.4, 0.45)), 40.0);
    m.block("panel", 0.6, v(2.3, 2.8, 0.0), v(2.33, 3.9, 1.6));
    m.lamp(100.0, [2.0, 2.5], [1.2, 1.7], 2.5);
}

fn street(m: &mut Maker) {
    let ground =
        [v(-15.0, -15.0, 0.0), v(15.0, -15.0, 0.0), v(15.0, 15.0, 0.0), v(-15.0, 15.0, 0.0)];
    m.polygon("ground", [0.3, 0.0], &ground);
    for k in 0..16_u32 {
        let (x, y) = (-11.0 + f64::from(k % 4) * 6.0, -11.0 + f64::from(k / 4) * 6.0);
        let size = v(4.6, 4.4, 3.0 + f64::from(k * 5 % 7));
        m.block("house", 0.4, v(x, y, 0.0), v(x, y, 0.0) + size);
    }
    m.lamp(10.0, [-60.0, 60.0], [-60.0, 60.0], 40.0);
}

fn rooms(m: &mut Maker) {
    m.room(0.7, v(12.2, 3.0, 2.5));
    for (x, y) in [(4.0, 0.2), (8.1, 2.0)] {
        m.block("wall", 0.7, v(x, 0.0, 0.0), v(x + 0.1, y, 2.5));
        m.block("wall", 0.7, v(x, y + 0.8, 0.0), v(x + 0.1, 3.0, 2.5));
        m.block("lintel", 0.7, v(x, y, 2.0), v(x + 0.1, y + 0.8, 2.5));
    }
    m.lamp(100.0, [1.5, 2.3], [1.1, 1.9], 2.45);
}

fn cove(m: &mut Maker) {
    m.room(0.6, v(5.0, 4.0, 2.6));
    m.block("ledge", 0.6, v(0.0, 0.5, 2.4), v(0.2, 3.5, 2.43));
    let strip = [v(0.05, 0.6, 2.44), v(0.1, 0.6, 2.44), v(0.1, 3.4, 2.44), v(0.05, 3.4, 2.44)];
    m.polygon("strip", [0.0, 800.0], &strip);
    m.block("table", 0.5, v(2.0, 1.5, 0.7), v(3.4, 2.3, 0.74));
}
