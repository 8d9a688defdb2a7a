//! The coarse solution that the error oracle weighs by: a fixed set of coarse elements, all pairs
//! of them linked, a fixed number of sweeps from the emission. A pure function of the scene at one
//! instant: links are summed in the order of the coarse elements, whatever their history.

use crate::element::{ElementId, Forest, Kind, Renumbering, WorldView};
use crate::pair::{self, Brightness, Carried, Changes, CoarseBrightness, CoarseLink};
use crate::scene::{LightId, PatchId, Scene, World};
use crate::solver::{Dirty, Link, Links, Radiosity, Stop, Surfaces};

use crate::follow::set_pairs;

use super::importance::{Aim, weigh_by_points};
use super::sensor_views::CoarseScene;
use super::surfaces::{CoarseReceivers, CoarseSurfaces, LitForest};
use super::tuning::{COARSE_SHARE, COARSE_SWEEPS, DARK_FLOOR, LOST, REFERENCE_SHARE};

/// Splits facets down to coarse elements, numbers them and keeps them for good; returns their ids
/// by number.
pub(super) fn number(scene: &Scene, forest: &mut Forest) -> Vec<u32> {
    let largest = forest.made_m2() * COARSE_SHARE;
    let mut out = Vec::new();
    let groups = forest.groups().roots().to_vec();
    for patch in 0..scene.patches.len() as u32 {
        let mut stack = vec![forest.patch_root(PatchId(patch))];
        stack.retain(|&root| !forest.is_in_group(root));
        while let Some(id) = stack.pop() {
            let whole = forest.kind(id) == Kind::Element
                && (forest.area_m2(id) <= largest || !forest.can_split(id));
            if whole {
                forest.set_coarse(id, out.len());
                out.push(id.0);
                continue;
            }
            let children = match forest.kind(id) {
                Kind::Element => forest.split(id).0,
                _ => forest.children(id),
            };
            stack.extend(children.rev().map(ElementId));
        }
    }
    for group in groups {
        forest.set_coarse(group, out.len());
        out.push(group.0);
    }
    forest.keep_all();
    out
}

/// The coarse links and their solution.
#[derive(Clone, Debug, Default)]
pub(crate) struct Coarse {
    links: Links,
    /// The same with nothing in the way.
    open: Links,
    radiosity: Radiosity,
    pub(super) brightness: CoarseBrightness,
}

impl Coarse {
    /// Takes over what an update found on the coarse pairs. Whether any of them changed.
    pub(super) fn follow(&mut self, seed: &Forest, changes: &Changes) -> bool {
        let held = changes.coarse_links.iter();
        let held = held.map(|&CoarseLink { a, b, carried }| pair::Link { a, b, carried });
        let open = held.clone().map(|link| {
            let carried = Carried { visibility: u16::MAX, ..link.carried };
            pair::Link { carried, ..link }
        });
        let seed = &CoarseReceivers(seed);
        set_pairs(&mut self.links, seed, changes.dropped_coarse_links.iter().copied(), held);
        set_pairs(&mut self.open, seed, changes.dropped_coarse_links.iter().copied(), open);
        self.links.tidy();
        self.open.tidy();
        !changes.dropped_coarse_links.is_empty() || !changes.coarse_links.is_empty()
    }

    /// Takes links out again.
    pub(super) fn forget(&mut self, seed: &Forest, made: &[CoarseLink]) {
        let seed = &CoarseReceivers(seed);
        for links in [&mut self.links, &mut self.open] {
            let pairs = made.iter().map(|link| (link.a, link.b));
            set_pairs(links, seed, pairs, std::iter::empty());
            links.tidy();
        }
    }

    /// Solves over the coarse links as the scene shines in a world; `coarse` are the coarse elements of `seed` by number.
    pub(super) fn solve(
        &mut self,
        (scene, now, view): (&Scene, &World, &WorldView),
        seed: &Forest,
        coarse: &[u32],
        aim: &Aim,
    ) {
        for &id in coarse {
            self.links.sort(id);
            self.open.sort(id);
        }
        let lit = LitForest::new(scene, seed, now).with_places();
        self.radiosity = start(now, seed, &lit);
        let surfaces = CoarseSurfaces::new(lit);
        for &group in seed.groups().roots() {
            self.radiosity.set(group.0, surfaces.material(group.0).exitance);
        }
        self.radiosity.solve(&surfaces, &self.links, Dirty::All, Stop::Sweeps(COARSE_SWEEPS));
        self.brightness = self.measure((scene, now, view), (seed, coarse), &surfaces, aim);
    }

    fn measure(
        &self,
        (scene, now, view): (&Scene, &World, &WorldView),
        (seed, coarse): (&Forest, &[u32]),
        surfaces: &CoarseSurfaces<'_>,
        aim: &Aim,
    ) -> CoarseBrightness {
        let total_area = seed.made_m2();
        let mean = |v: [f32; 3]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / 3.0;
        let mut irradiance = vec![0.0; coarse.len()];
        for facet in surfaces.facets() {
            self.radiosity.irradiances(surfaces, facet.0, &mut |id, h| {
                let number = seed.coarse(ElementId(id)).expect("leaves of the seed are coarse");
                irradiance[number] = mean(h.mean.map(|x| x.max(0.0)));
            });
        }
        let arriving: f64 =
            coarse.iter().zip(&irradiance).map(|(&id, h)| surfaces.area_m2(id) * h).sum();
        let intensity = |k: u32| now.intensity(LightId(k)).iter().sum::<f64>() / 3.0;
        let mut lights: Vec<f64> = (0..scene.lights.len() as u32).map(intensity).collect();
        let floor = arriving / total_area * DARK_FLOOR;
        let light_of = |(&id, irradiance): (&u32, &f64)| {
            if seed.is_distant(ElementId(id)) {
                let radiosity = mean(self.radiosity.radiosity(id));
                return Brightness { radiosity, ..Brightness::DISTANT };
            }
            let emitted = mean(surfaces.material(surfaces.facet_of(id)).exitance);
            let radiosity = mean(self.radiosity.radiosity(id));
            let reflected = (radiosity - emitted).max(0.0);
            Brightness { radiosity, reflected, irradiance: irradiance + floor }
        };
        let emits = |source: u32| match seed.light(ElementId(source)) {
            Some(light) => lights[light],
            None => mean(surfaces.material(surfaces.facet_of(source)).exitance),
        };
        let brings = |link: &Link| f64::from(link.coupling) * emits(link.source);
        let open =
            |&id: &u32| surfaces.area_m2(id) * self.open.of(id).iter().map(brings).sum::<f64>();
        let known = if arriving > LOST * coarse.iter().map(open).sum::<f64>() {
            let mut known: Vec<Brightness> = coarse.iter().zip(&irradiance).map(light_of).collect();
            let radiosity = &self.radiosity;
            let seen = CoarseScene { now, view, forest: seed, coarse, surfaces, radiosity, floor };
            if let Some(sensors) = aim.sensors() {
                let views = seen.views(sensors);
                weigh_by_points((&self.links, seed, coarse), surfaces, &views, &mut known);
            }
            known
        } else {
            // Nothing emits, or all is hidden: every surface and light weighs the same, and errors are relative to row sums.
            lights.iter_mut().for_each(|i| *i = f64::from(u8::from(*i > 0.0)));
            let uniform = |&id: &u32| match seed.is_distant(ElementId(id)) {
                true if self.radiosity.radiosity(id) == [0.0; 3] => Brightness::DISTANT,
                true => Brightness { radiosity: 1.0, ..Brightness::DISTANT },
                false => Brightness::UNIFORM,
            };
            coarse.iter().map(uniform).collect()
        };
        CoarseBrightness::new(known, lights, total_area * REFERENCE_SHARE)
    }

    /// Follows elements of a seed to their new ids, and coarse elements to other numbers; what is no longer one loses its links.
    pub(crate) fn renumber(
        &mut self,
        seed: &Forest,
        to: &Renumbering,
        numbers: &[Option<usize>],
        regrouped: &[ElementId],
    ) {
        let lost = || regrouped.iter().copied().filter(|&id| !seed.is_coarse_root(id));
        for links in [&mut self.links, &mut self.open] {
            links.extend(to.old_len());
            links.renumber(to);
            links.extend(seed.len());
            let of = |id: ElementId| links.of(id.0).iter().map(move |l| (id, ElementId(l.source)));
            let dropped: Vec<(ElementId, ElementId)> = lost().flat_map(of).collect();
            let none = std::iter::empty();
            set_pairs(links, &CoarseReceivers(seed), dropped.into_iter(), none);
            links.tidy();
        }
        self.radiosity = Radiosity::default();
        self.brightness.renumber(numbers);
    }

    /// Coarse links, and the same with nothing in the way.
    pub(crate) fn links(&self) -> [&Links; 2] {
        [&self.links, &self.open]
    }

    /// Rounded brightness of the coarse elements.
    pub(crate) fn brightness(&self) -> &CoarseBrightness {
        &self.brightness
    }

    /// Radiosity of a coarse element.
    pub(super) fn radiosity(&self, id: u32) -> [f32; 3] {
        self.radiosity.radiosity(id)
    }

    /// Bytes held.
    pub(super) fn memory_bytes(&self) -> u64 {
        let links = self.links.memory_bytes() + self.open.memory_bytes();
        links + self.radiosity.memory_bytes()
    }
}

/// A solution to begin with: exitances, and what lights and what is distant send.
pub(super) fn start(now: &World, forest: &Forest, surfaces: &LitForest<'_>) -> Radiosity {
    let mut out = Radiosity::new(surfaces);
    set_sources(now, (forest, surfaces), &mut out);
    out
}

/// Gives the punctual lights the intensities that they have in a world, and what is distant its exitance.
pub(super) fn set_sources(
    now: &World,
    (forest, surfaces): (&Forest, &LitForest<'_>),
    radiosity: &mut Radiosity,
) {
    for facet in forest.distant_facets() {
        radiosity.set(facet.0, surfaces.material(facet.0).exitance);
    }
    for id in 0..forest.fixed_len() {
        if let Some(light) = forest.light(ElementId(id)) {
            radiosity.set(id, now.intensity(LightId(light as u32)).map(|x| x as f32));
        }
    }
}
