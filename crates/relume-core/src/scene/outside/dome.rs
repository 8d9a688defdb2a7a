//! The sky as facets: cells of a cube's sides around the scene, finer where radiance varies.
//!
//! Sides of a cube tile all directions without gaps, and boxes around their cells have no thickness. Cells are divided
//! evenly in angle. Must not know what a sky's radiance comes from.

use std::f64::consts::FRAC_PI_4;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::super::tuning::{SKY_SHARE, SKY_SHARE_ALL_ROUND};
use super::sky::SkyNow;
use crate::scene::tuning::{
    SKY_DEPTH_MAX, SKY_DEPTH_MIN, SKY_FACETS_MAX, SKY_SAMPLES, SKY_SAMPLES_OF_PICTURES,
};

/// A part of a side of the cube [-1, 1]^3, seen from its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    side: Side,
    /// Lower and upper angles along both axes of the side, in units of 45 degrees.
    low: DVec2,
    high: DVec2,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Side {
    outward: DVec3,
    u: DVec3,
    v: DVec3,
}

/// A cell with its mean radiance at each of the given instants, W/m2/sr.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    pub(super) cell: Cell,
    pub(super) radiance: Vec<[f64; 3]>,
    /// By how much of the sky's light, at each instant, the light of this cell is sent from the wrong place at most: the
    /// standard deviations of radiance and of direction over the cell times its solid angle.
    errors: Vec<f64>,
    depth: u32,
}

/// Facets of a sky that is given at one instant or more; without those that are always dark.
///
/// The cell that errs most is divided until the errors of all are below half of `fineness`, relative to the sky's light.
pub(super) fn facets(skies: &[SkyNow], all_round: bool, fineness: f64) -> Vec<Facet> {
    let pictured = matches!(skies.first(), Some(SkyNow::Picture(_)));
    let share = if all_round { SKY_SHARE_ALL_ROUND } else { SKY_SHARE };
    let depth_max = if pictured { SKY_DEPTH_MAX.1 } else { SKY_DEPTH_MAX.0 };
    let look = |cell: &Cell| skies.iter().map(|s| Mean::of(s, cell)).collect::<Vec<_>>();
    let roots = roots(all_round);
    let looks: Vec<Vec<Mean>> = roots.par_iter().map(look).collect();
    let flux_of = |k: usize| looks.iter().map(|of_cell| of_cell[k].flux()).sum::<f64>();
    let flux: Vec<f64> = (0..skies.len()).map(flux_of).collect();
    let facet = |cell: Cell, means: Vec<Mean>, depth: u32| Facet {
        cell,
        errors: means.iter().zip(&flux).map(|(m, all)| m.error() / all.max(1e-300)).collect(),
        radiance: means.iter().map(|m| m.radiance).collect(),
        depth,
    };
    let mut out: Vec<Facet> =
        roots.into_iter().zip(looks).map(|(cell, means)| facet(cell, means, 0)).collect();
    let divide = |out: &mut Vec<Facet>, at: usize| {
        let Facet { cell, depth, .. } = out[at];
        let parts = cell.quarters().into_par_iter();
        let parts: Vec<Facet> = parts.map(|c| facet(c, look(&c), depth + 1)).collect();
        out.splice(at..=at, parts);
    };
    while out.len() + 3 <= SKY_FACETS_MAX {
        let sums = (0..skies.len()).map(|k| out.iter().map(|f| f.errors[k]).sum::<f64>());
        if let Some(coarse) = out.iter().position(|f| f.depth < SKY_DEPTH_MIN) {
            divide(&mut out, coarse);
            continue;
        }
        // The instant that errs most.
        let (instant, sum) = sums.enumerate().fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        let may_split = |f: &(usize, &Facet)| f.1.depth < depth_max && f.1.errors[instant] > 0.0;
        let worst = out.iter().enumerate().filter(may_split).reduce(|one, two| {
            // The first of equals.
            if two.1.errors[instant] > one.1.errors[instant] { two } else { one }
        });
        let Some((worst, _)) = worst.filter(|_| sum > share * fineness) else { break };
        divide(&mut out, worst);
    }
    out.retain(|f| f.radiance.iter().any(|l| l.iter().any(|&c| c > 0.0)));
    out
}

/// Cells to begin with: 45 degrees by 45.
fn roots(all_round: bool) -> Vec<Cell> {
    let side = |outward: DVec3, u: DVec3| Side { outward, u, v: u.cross(outward) };
    let mut out = Vec::new();
    let mut add = |side: Side, low: DVec2| out.push(Cell { side, low, high: low + 1.0 });
    let halves = [-1.0, 0.0];
    let flat = [Some(DVec3::Y), all_round.then_some(DVec3::NEG_Y)];
    for outward in flat.into_iter().flatten() {
        for (u, v) in halves.into_iter().flat_map(|u| halves.map(|v| (u, v))) {
            add(side(outward, DVec3::X), DVec2::new(u, v));
        }
    }
    for outward in [DVec3::NEG_Z, DVec3::X, DVec3::Z, DVec3::NEG_X] {
        let upright = Side { outward, u: outward.cross(DVec3::Y), v: DVec3::Y };
        let floors: &[f64] = if all_round { &[0.0, -1.0] } else { &[0.0] };
        for (u, &v) in halves.into_iter().flat_map(|u| floors.iter().map(move |v| (u, v))) {
            add(upright, DVec2::new(u, v));
        }
    }
    out
}

impl Cell {
    /// The lower half of all directions.
    pub(super) fn below() -> Vec<Cell> {
        let all = roots(true);
        let down = |c: &Cell| c.side.outward.y < 0.0 || (c.side.outward.y == 0.0 && c.low.y < 0.0);
        all.into_iter().filter(down).collect()
    }

    /// The point of the cube's surface at angles along both axes, in units of 45 degrees.
    fn point(&self, at: DVec2) -> DVec3 {
        let Side { outward, u, v } = self.side;
        // Exact where cells of two sides meet.
        let along = |a: f64| if a.abs() == 1.0 { a } else { libm::tan(a * FRAC_PI_4) };
        outward + u * along(at.x) + v * along(at.y)
    }

    /// Corners on the surface of the cube, counter-clockwise seen from its middle.
    pub(super) fn corners(&self) -> [DVec3; 4] {
        let (l, h) = (self.low, self.high);
        let corners = [l, DVec2::new(h.x, l.y), h, DVec2::new(l.x, h.y)].map(|at| self.point(at));
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        match normal.dot(self.side.outward) < 0.0 {
            true => corners,
            false => [corners[3], corners[2], corners[1], corners[0]],
        }
    }

    fn quarters(&self) -> Vec<Cell> {
        let half = (self.high - self.low) * 0.5;
        let part = |k: usize| {
            let low = self.low + half * DVec2::new((k & 1) as f64, (k >> 1) as f64);
            Cell { low, high: low + half, ..*self }
        };
        (0..4).map(part).collect()
    }

    /// Directions of points in the middle of `count` x `count` parts, each with its solid angle, sr.
    fn grid(&self, count: u32) -> impl Iterator<Item = (DVec3, f64)> + '_ {
        let n = f64::from(count);
        let at =
            move |k: u32| DVec2::new(f64::from(k % count) + 0.5, f64::from(k / count) + 0.5) / n;
        (0..count * count).map(move |k| self.sample(at(k), count * count))
    }

    /// The same of points in no rows, so that edges along the sides are met evenly (the R2 sequence of Roberts 2018).
    fn scatter(&self, count: u32) -> impl Iterator<Item = (DVec3, f64)> + '_ {
        let step = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_2);
        let at = move |k: u32| (step * f64::from(k) + 0.5).fract();
        (0..count * count).map(move |k| self.sample(at(k), count * count))
    }

    /// The direction of a point in shares of the sides, and its part of the solid angle if there are `count`.
    fn sample(&self, share: DVec2, count: u32) -> (DVec3, f64) {
        let sides = self.high - self.low;
        let p = self.point(self.low + share * sides);
        let (tu, tv) = (p.dot(self.side.u), p.dot(self.side.v));
        // d omega = du dv / r^3 on the side of the cube, du = (1 + u^2) times the angle.
        let angles = sides * FRAC_PI_4;
        let area = (1.0 + tu * tu) * (1.0 + tv * tv) * angles.x * angles.y / f64::from(count);
        let r = p.length();
        (p / r, area / (r * r * r))
    }

    /// Samples of a sky.
    fn samples(&self, sky: &SkyNow) -> Box<dyn Iterator<Item = (DVec3, f64)> + '_> {
        let SkyNow::Picture(picture) = sky else { return Box::new(self.grid(SKY_SAMPLES)) };
        // Eight units of 45 degrees are all columns.
        let pixels = 0.125 * f64::from(picture.size().0) * (self.high.x - self.low.x);
        let (least, most) = SKY_SAMPLES_OF_PICTURES;
        Box::new(self.scatter((pixels.ceil() as u32).clamp(least, most)))
    }
}

/// What comes from a cell at one instant.
struct Mean {
    radiance: [f64; 3],
    solid_angle: f64,
    /// Standard deviations of radiance (mean of the channels), W/m2/sr, and of direction, radians.
    spread: (f64, f64),
}

impl Mean {
    fn of(sky: &SkyNow, cell: &Cell) -> Mean {
        let (mut sum, mut square, mut all, mut middle) = ([0.0; 3], 0.0, 0.0, DVec3::ZERO);
        for (direction, angle) in cell.samples(sky) {
            let radiance = sky.radiance(direction);
            (0..3).for_each(|c| sum[c] += angle * radiance[c]);
            let mean = radiance.iter().sum::<f64>() / 3.0;
            square += angle * mean * mean;
            all += angle;
            middle += direction * angle;
        }
        let radiance = sum.map(|s| s / all);
        let mean = radiance.iter().sum::<f64>() / 3.0;
        let deviation = |square: f64| square.max(0.0).sqrt();
        let spread = (
            deviation(square / all - mean * mean),
            deviation(1.0 - (middle / all).length_squared()),
        );
        Mean { radiance, solid_angle: all, spread }
    }

    fn flux(&self) -> f64 {
        self.solid_angle * self.radiance.iter().sum::<f64>() / 3.0
    }

    fn error(&self) -> f64 {
        self.solid_angle * self.spread.0 * self.spread.1
    }
}
