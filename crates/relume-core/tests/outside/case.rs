//! A scene as the tests describe it: panels, what moves them, and what is to be looked at. From it come the
//! engine's scene and the judge's polygons, apart from each other.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use relume_core::scene::{
    Interpolation, MaterialId, NodeId, RotationTrack, Scene, SceneBuilder, Track,
};
use relume_core::session::Sensor;
use relume_judge::{Polygon, Random, World};

/// Short for [`DVec3::new`].
pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A flat convex piece of a surface; all panels of one name are one surface.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    pub(crate) name: String,
    /// Counter-clockwise from the front; in the mover's frame where there is one.
    pub(crate) corners: Vec<DVec3>,
    pub(crate) both_sides: bool,
    pub(crate) reflectance: f64,
    pub(crate) exitance: f64,
    pub(crate) mover: Option<usize>,
}

/// Where a body is at 0 s and at 1 s.
#[derive(Clone, Debug)]
pub(crate) struct Mover {
    pub(crate) place: [DVec3; 2],
    /// Turned by this at 1 s, and not at all at 0 s.
    pub(crate) turn: DQuat,
}

/// An exact form factor between two names, and by how much it may be wrong itself.
#[derive(Clone, Debug)]
pub(crate) struct Known {
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) factor: f64,
    pub(crate) error: f64,
}

/// What stands on what from a time on: the covered part of the floor and the bottom see each other, or nothing.
#[derive(Clone, Debug)]
pub(crate) struct Contact {
    pub(crate) bottom: String,
    pub(crate) floor: String,
    /// Share of the floor's area that is covered.
    pub(crate) share: f64,
    pub(crate) since_s: f64,
}

/// A scene and what is asked of it.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) tolerance: f64,
    pub(crate) panels: Vec<Panel>,
    pub(crate) movers: Vec<Mover>,
    /// Names of which the whole row is compared with the judge's.
    pub(crate) rows: Vec<String>,
    pub(crate) known: Vec<Known>,
    pub(crate) contact: Option<Contact>,
    /// No light gets out, and no black back is in view: every row sums to 1.
    pub(crate) sealed: bool,
    /// Either rows sum to 1, or it is said that something overlaps.
    pub(crate) may_overlap: bool,
    pub(crate) sensors: Vec<Sensor>,
    /// Whether light is solved for, and energy balanced.
    pub(crate) lit: bool,
    /// Whether form factors are looked at.
    pub(crate) factors: bool,
    /// Whether what arrives at each surface is compared with particles of the judge.
    pub(crate) fluxes: bool,
    /// Whether links are compared with a cold build.
    pub(crate) cold: bool,
    pub(crate) times_s: Vec<f64>,
    /// What arrives at every sensor, where that is known.
    pub(crate) irradiance: Option<f64>,
    /// Light at sensors is that of particles from lamps: for small bright places in view.
    pub(crate) by_particles: bool,
    /// Whether a line is printed for each frame solved.
    pub(crate) says_steps: bool,
    /// In words, for messages.
    pub(crate) story: String,
    /// Applied to everything at last: turned and scaled.
    scale: f64,
    world_from_case: DQuat,
}

impl Case {
    /// An empty one.
    pub(crate) fn new(tolerance: f64) -> Case {
        Case {
            tolerance,
            panels: Vec::new(),
            movers: Vec::new(),
            rows: Vec::new(),
            known: Vec::new(),
            contact: None,
            sealed: false,
            may_overlap: false,
            sensors: Vec::new(),
            lit: false,
            factors: true,
            fluxes: false,
            cold: false,
            times_s: vec![0.0],
            irradiance: None,
            by_particles: false,
            says_steps: false,
            story: String::new(),
            scale: 1.0,
            world_from_case: DQuat::IDENTITY,
        }
    }

    /// Adds a panel of reflectance 1/2.
    pub(crate) fn panel(&mut self, name: &str, corners: &[DVec3], both_sides: bool) -> &mut Panel {
        self.panels.push(Panel {
            name: name.to_owned(),
            corners: corners.to_vec(),
            both_sides,
            reflectance: 0.5,
            exitance: 0.0,
            mover: None,
        });
        self.panels.last_mut().expect("just added")
    }

    /// Makes panels the faces of one body, which stays where it is.
    pub(crate) fn one_body(&mut self, panels: std::ops::Range<usize>) {
        let mover = Some(self.movers.len());
        self.movers.push(Mover { place: [DVec3::ZERO; 2], turn: DQuat::IDENTITY });
        self.panels[panels].iter_mut().for_each(|panel| panel.mover = mover);
    }

    /// Adds the sides of a box, `NAME-x0` to `NAME-z1`, and returns the range of their numbers.
    pub(crate) fn cuboid(
        &mut self,
        name: &str,
        lo: DVec3,
        hi: DVec3,
        inward: bool,
    ) -> std::ops::Range<usize> {
        let start = self.panels.len();
        for (side, mut corners) in cuboid_sides(lo, hi) {
            if inward {
                corners.reverse();
            }
            self.panel(&format!("{name}-{side}"), &corners, false);
        }
        start..self.panels.len()
    }

    /// Adds a closed room from the origin to a corner: `r-x0` to `r-z1`.
    pub(crate) fn room(&mut self, size: DVec3) {
        self.cuboid("r", DVec3::ZERO, size, true);
        self.sealed = true;
    }

    /// Names whose rows are compared.
    pub(crate) fn look_at(&mut self, names: &[&str]) {
        self.rows.extend(names.iter().map(|n| (*n).to_owned()));
    }

    /// Draws how all of it lies in the world: as it is, with other axes, or turned and scaled.
    pub(crate) fn lay(&mut self, random: &mut Random) {
        match random.bits() % 3 {
            0 => {}
            1 => {
                let cyclic = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
                self.world_from_case = DQuat::from_mat3(&cyclic);
            }
            _ => {
                self.world_from_case = random.rotation();
                self.scale = 10_f64.powf(random.between(-1.0, 1.0));
            }
        }
    }

    fn point(&self, p: DVec3) -> DVec3 {
        if self.scale == 1.0 && self.world_from_case == DQuat::IDENTITY {
            // What a file would hold.
            return p.as_vec3().as_dvec3();
        }
        self.world_from_case * (p * self.scale)
    }

    /// Sensors in the world.
    pub(crate) fn world_sensors(&self) -> Vec<Sensor> {
        let sensor = |s: &Sensor| Sensor {
            at: self.point(s.at),
            normal: (self.world_from_case * s.normal).normalize(),
        };
        self.sensors.iter().map(sensor).collect()
    }

    fn corners(&self, panel: &Panel, time_s: f64) -> Vec<DVec3> {
        let placed = |&p: &DVec3| match panel.mover {
            None => self.point(p),
            Some(k) => {
                let (place, turn) = self.pose(k, time_s);
                place + turn * (p * self.scale)
            }
        };
        panel.corners.iter().map(placed).collect()
    }

    /// Place and turn of a mover in the world.
    fn pose(&self, mover: usize, time_s: f64) -> (DVec3, DQuat) {
        let m = &self.movers[mover];
        let t = time_s.clamp(0.0, 1.0);
        let turn = DQuat::IDENTITY.slerp(m.turn, t);
        (self.point(m.place[0]).lerp(self.point(m.place[1]), t), self.world_from_case * turn)
    }

    /// The engine's scene.
    pub(crate) fn scene(&self) -> Arc<Scene> {
        let mut b = SceneBuilder::new("outside");
        let mut movers = Vec::new();
        let interpolation = Interpolation::Linear;
        let times_s = vec![0.0, 1.0];
        for k in 0..self.movers.len() {
            let ends = [self.pose(k, 0.0), self.pose(k, 1.0)];
            let node = b.node(&format!("mover {k}"), None, ends[0].0, ends[0].1);
            let values = ends.map(|e| e.0).to_vec();
            b.animate_translation(node, Track { times_s: times_s.clone(), values, interpolation });
            let values = ends.map(|e| e.1).to_vec();
            b.animate_rotation(
                node,
                RotationTrack { times_s: times_s.clone(), values, interpolation },
            );
            movers.push(node);
        }
        let mut materials = Vec::new();
        let mut nodes: Vec<(String, NodeId)> = Vec::new();
        for p in &self.panels {
            let (rho, m) = ([p.reflectance; 3], [p.exitance; 3]);
            let look = (p.both_sides, p.reflectance, p.exitance);
            let known = materials.iter().find(|k: &&((bool, f64, f64), MaterialId)| k.0 == look);
            let material = known.map(|k| k.1).unwrap_or_else(|| match p.both_sides {
                true => b.double_sided_material("both", rho, m),
                false => b.material("one", rho, m),
            });
            materials.push((look, material));
            let node = match (p.mover, nodes.iter().find(|n| n.0 == p.name)) {
                (Some(k), _) => movers[k],
                (None, Some(node)) => node.1,
                (None, None) => {
                    let node = b.node(&p.name, None, DVec3::ZERO, DQuat::IDENTITY);
                    nodes.push((p.name.clone(), node));
                    node
                }
            };
            let corners: Vec<DVec3> = match p.mover {
                Some(_) => p.corners.iter().map(|&c| c * self.scale).collect(),
                None => self.corners(p, 0.0),
            };
            b.polygon(node, &p.name, material, &corners);
        }
        Arc::new(b.build().unwrap_or_else(|e| panic!("{e}: {}", self.story)))
    }

    /// The judge's world at a time, and the name of each of its polygons.
    pub(crate) fn world(&self, time_s: f64) -> (World, Vec<String>) {
        let (mut polygons, mut names) = (Vec::new(), Vec::new());
        for p in &self.panels {
            let corners = self.corners(p, time_s);
            let of = |corners: Vec<DVec3>, twin: Option<usize>| Polygon {
                corners,
                reflectance: [p.reflectance; 3],
                exitance: [p.exitance; 3],
                twin,
            };
            let k = polygons.len();
            if p.both_sides {
                let back = corners.iter().rev().copied().collect();
                polygons.extend([of(corners, Some(k + 1)), of(back, Some(k))]);
                names.extend([p.name.clone(), format!("{} back", p.name)]);
            } else {
                polygons.push(of(corners, None));
                names.push(p.name.clone());
            }
        }
        (World::new(polygons), names)
    }
}

/// The sides of a box seen from outside, each with its name.
pub(crate) fn cuboid_sides(lo: DVec3, hi: DVec3) -> [(&'static str, Vec<DVec3>); 6] {
    let corner = |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
        v(pick(0), pick(1), pick(2))
    };
    let side = |bits: [usize; 4]| bits.map(corner).to_vec();
    [
        ("x0", side([0, 4, 6, 2])),
        ("x1", side([1, 3, 7, 5])),
        ("y0", side([0, 1, 5, 4])),
        ("y1", side([2, 6, 7, 3])),
        ("z0", side([0, 2, 3, 1])),
        ("z1", side([4, 5, 7, 6])),
    ]
}

/// A number between two, the logarithm uniform.
pub(crate) fn log_between(random: &mut Random, lo: f64, hi: f64) -> f64 {
    (random.between(lo.ln(), hi.ln())).exp().clamp(lo, hi)
}

/// Whether a draw of this share comes.
pub(crate) fn chance(random: &mut Random, share: f64) -> bool {
    random.unit() < share
}

/// A whole number from `lo` to `hi`, both included.
pub(crate) fn whole(random: &mut Random, lo: usize, hi: usize) -> usize {
    lo + (random.bits() % (hi - lo + 1) as u64) as usize
}
