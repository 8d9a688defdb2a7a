//! How much the light that an element gets counts where irradiance is gathered at points: the adjoint of the coarse solution.
//!
//! A point gathers what elements send with visibility of its own, and lamps' light exactly: that the mesh errs there is no
//! error of the point. An error on an element reaches points by what the element reflects, past all else that reflects. So
//! it counts by the importance of the element (Smits, Arvo and Salesin 1992), with each place in the scene as a sensor, of
//! which errors are relative to what arrives there.

use crate::element::{ElementId, Forest};
use crate::pair::{Brightness, coarsen};
use crate::solver::{Link, Links, Surfaces};

use super::surfaces::CoarseSurfaces;
use super::tuning::{COARSE_SWEEPS, POINTS_MOST, POINTS_NEAR, POINTS_SHARE};

/// What the tolerance is about: whose irradiance is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Aim {
    /// The irradiance that elements have: what pictures, exported light and snapshots show.
    #[default]
    Mesh,
    /// The irradiance that is gathered at points ([`Frame::irradiance_at`](crate::session::Frame::irradiance_at)): sensors. It
    /// finds lamps' light and shadows itself, so elements only need to send the right light: at the same tolerance with a
    /// fifth to nine tenths of the links. Elements themselves may then err by several times the tolerance.
    Points,
}

/// Weighs coarse elements (by number, `known` with unrounded brightness) by what errors on them do to points: their irradiance
/// is replaced by one over the larger of two weights.
///
/// One is their importance, times `POINTS_SHARE`: what errs in one sense wherever light comes from there. What counts for more
/// than is typical of the scene, as the few elements that light goes through on its way into another room, counts for more by as
/// much again. It is at most their weight for the mesh; where they count for more than twice what is typical, up to `POINTS_MOST`
/// times that. The other is what they do where they are most of what is seen, as in a gap, times `POINTS_NEAR`, up to their
/// weight for the mesh.
pub(super) fn weigh_by_points(
    (links, forest, coarse): (&Links, &Forest, &[u32]),
    surfaces: &CoarseSurfaces<'_>,
    known: &mut [Brightness],
) {
    let scene = Reflecting { links, forest, coarse, surfaces };
    let (importance, nearby) = (scene.importance(known), scene.nearby(known));
    let (mut area_m2, mut sum) = (0.0, 0.0);
    for ((light, importance), &id) in known.iter().zip(&importance).zip(coarse) {
        if light.irradiance.is_finite() {
            area_m2 += surfaces.area_m2(id);
            sum += surfaces.area_m2(id) * importance * light.irradiance;
        }
    }
    // As brightness is rounded, so that it seldom changes.
    let typical = coarsen(sum / area_m2).max(f64::MIN_POSITIVE);
    for ((light, importance), nearby) in known.iter_mut().zip(&importance).zip(&nearby) {
        if light.irradiance.is_finite() {
            let beside_typical = importance * light.irradiance / typical;
            // Over the weight for the mesh.
            let over_mesh = |weight: f64, most: f64| (weight * light.irradiance).min(most);
            // In a white room all count for much, and all alike.
            let most = (0.5 * beside_typical).clamp(1.0, POINTS_MOST);
            let reflected = over_mesh(POINTS_SHARE * importance * beside_typical, most);
            let near = over_mesh(POINTS_NEAR * nearby, 1.0);
            light.irradiance /= reflected.max(near).max(LEAST);
        }
    }
}

/// Weight of what counts for nothing, over that for the mesh: a number that can be divided by.
const LEAST: f64 = 1e-9;

/// The coarse elements and what goes from one to the other.
struct Reflecting<'a> {
    links: &'a Links,
    forest: &'a Forest,
    coarse: &'a [u32],
    surfaces: &'a CoarseSurfaces<'a>,
}

impl Reflecting<'_> {
    /// For each coarse element, m2/W: mean relative change of irradiance at all that it lights, by whatever way, per change of
    /// its own irradiance, over its share of the area.
    ///
    /// The adjoint of gathering, in as many sweeps as the coarse solution has.
    fn importance(&self, known: &[Brightness]) -> Vec<f64> {
        let mut out = vec![0.0; self.coarse.len()];
        for _ in 0..COARSE_SWEEPS {
            let of = |&id: &u32| {
                // By reciprocity what the element sends goes where its own sources are.
                let sends = |(number, coupling): (usize, f64)| {
                    coupling * (1.0 / known[number].irradiance + out[number])
                };
                self.reflectance(id) * self.seen(id).map(sends).sum::<f64>()
            };
            out = self.coarse.iter().map(of).collect();
        }
        out
    }

    /// The same for the root mean square change, straight from the element, over the root of its share.
    fn nearby(&self, known: &[Brightness]) -> Vec<f64> {
        let area_m2 = |id: u32| self.surfaces.area_m2(id);
        let of = |&id: &u32| {
            let square = |(number, coupling): (usize, f64)| {
                let change = coupling / known[number].irradiance;
                change * change * area_m2(id) / area_m2(self.coarse[number]).max(f64::MIN_POSITIVE)
            };
            self.reflectance(id) * self.seen(id).map(square).sum::<f64>().sqrt()
        };
        self.coarse.iter().map(of).collect()
    }

    /// The coarse elements that one sees, by number, with the form factors to them; what is distant sees none.
    fn seen(&self, id: u32) -> impl Iterator<Item = (usize, f64)> + '_ {
        let links = match self.forest.is_distant(ElementId(id)) {
            true => &[],
            false => self.links.of(id),
        };
        let seen = |link: &Link| {
            Some((self.forest.coarse(ElementId(link.source))?, f64::from(link.coupling)))
        };
        links.iter().filter_map(seen)
    }

    fn reflectance(&self, id: u32) -> f64 {
        let of = self.surfaces.material(self.surfaces.facet_of(id)).reflectance;
        of.iter().map(|&rho| f64::from(rho)).sum::<f64>() / 3.0
    }
}
