//! Values of the coarse solution and of groups, by the names of elements: functions of the instant that links do not show.
//!
//! Verdicts weigh by brightness that is rounded, and withstand small changes of it: a coarse solution that is not that of a cold
//! build may pass unseen for many frames.

use crate::element::{ElementId, ElementKey, Forest};
use crate::solver::{GroupEnd, GroupLinks, Link, Links};
use crate::space::SpaceState;

/// Quantity of the coarse solution, or of groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CoarseQuantity {
    /// Rounded brightness of a coarse element or punctual light: radiosity, reflected part of it, irradiance, W/m2.
    Brightness,
    /// Coarse link to a receiver from a source: share of what the source sends, 1.
    Link,
    /// Coarse link with nothing in the way.
    OpenLink,
    /// Group of patches: number and places of its facets.
    Group,
    /// Link that ends on a group, facet by facet: coupling (1/m2) and factors.
    GroupLink,
}

/// Value of the coarse solution, or of groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoarseValue {
    /// Quantity.
    pub what: CoarseQuantity,
    /// Names of its ends; that of one element twice.
    pub ends: (ElementKey, ElementKey),
    /// Bits of its numbers, or of a digest of them.
    pub bits: [u64; 3],
}

impl CoarseValue {
    /// Quantity and names.
    pub(super) fn name(&self) -> (CoarseQuantity, (ElementKey, ElementKey)) {
        (self.what, self.ends)
    }

    /// Numbers in words.
    pub(super) fn in_numbers(&self) -> String {
        let [a, b, c] = self.bits;
        match self.what {
            CoarseQuantity::Brightness => {
                let [a, b, c] = [a, b, c].map(f64::from_bits);
                format!("radiosity {a:?}, reflected {b:?}, irradiance {c:?} W/m2")
            }
            CoarseQuantity::Link | CoarseQuantity::OpenLink => {
                format!("coupling {:?}, gradients {b:08x}", f32::from_bits(a as u32))
            }
            CoarseQuantity::Group => format!("{a} facets, digest {b:016x}"),
            CoarseQuantity::GroupLink => {
                let coupling = f32::from_bits(a as u32);
                format!("coupling {coupling:?} 1/m2, digests {b:016x} and {c:016x}")
            }
        }
    }
}

/// Values of a state in the order of their quantities and names. Cost: n log n in coarse links and links of groups.
pub(super) fn coarse_values(space: &SpaceState) -> Vec<CoarseValue> {
    let SpaceState { forest, coarse, groups, .. } = space;
    let mut out = Vec::new();
    let [links, open] = coarse.links();
    // The form-factor oracle needs no coarse solution.
    if !coarse.brightness().is_empty() {
        add_brightness(space, &mut out);
        add_links(forest, CoarseQuantity::Link, links, &mut out);
        add_links(forest, CoarseQuantity::OpenLink, open, &mut out);
    }
    add_groups(forest, &mut out);
    add_group_links(forest, groups, &mut out);
    out.sort_unstable_by_key(CoarseValue::name);
    out
}

fn add_brightness(space: &SpaceState, out: &mut Vec<CoarseValue>) {
    let SpaceState { forest, coarse, .. } = space;
    let ids = (0..forest.kept_len()).map(ElementId);
    let known = ids.filter(|&id| forest.is_coarse_root(id) || forest.light(id).is_some());
    out.extend(known.map(|id| {
        let brightness = coarse.brightness().of(forest, id);
        let numbers = [brightness.radiosity, brightness.reflected, brightness.irradiance];
        value_of(CoarseQuantity::Brightness, forest.key(id), numbers.map(f64::to_bits))
    }));
}

fn add_links(forest: &Forest, what: CoarseQuantity, links: &Links, out: &mut Vec<CoarseValue>) {
    let of = |id: u32| links.of(id).iter().map(move |link| (id, link));
    out.extend((0..links.elements() as u32).flat_map(of).map(|(receiver, link)| {
        let Link { source, coupling, over_receiver: [au, av], over_source: [bu, bv] } = *link;
        let gradients = [au, av, bu, bv].iter().fold(0, |sum, &g| sum << 8 | u64::from(g as u8));
        let ends = (forest.key(ElementId(receiver)), forest.key(ElementId(source)));
        CoarseValue { what, ends, bits: [u64::from(coupling.to_bits()), gradients, 0] }
    }));
}

fn add_groups(forest: &Forest, out: &mut Vec<CoarseValue>) {
    let groups = forest.groups();
    out.extend(groups.ids().map(|id| {
        let group = forest.group(id).expect("it is one");
        let leaves = groups.leaves_of(group);
        let numbers = leaves.iter().flat_map(|leaf| {
            let key = forest.key(leaf.facet);
            let places = [leaf.centre.x, leaf.centre.y, leaf.centre.z, leaf.area_m2];
            [u64::from(key.facet), u64::from(key.path)].into_iter().chain(places.map(f64::to_bits))
        });
        let flags = u64::from(group.is_convex) << 1 | u64::from(group.body.is_some());
        let bits = [leaves.len() as u64, digest(numbers), flags];
        value_of(CoarseQuantity::Group, forest.key(id), bits)
    }));
}

fn add_group_links(forest: &Forest, groups: &GroupLinks, out: &mut Vec<CoarseValue>) {
    out.extend(groups.iter().map(|(ids, link)| {
        let of_end = |end: &GroupEnd| match end {
            GroupEnd::Group { facets, first } => {
                digest(groups.factors(facets, *first).iter().map(|f| u64::from(f.to_bits())))
            }
            GroupEnd::Element { area_m2, radius, mean, gradient: [u, v], .. } => {
                digest([area_m2, radius, mean, u, v].into_iter().map(|x| u64::from(x.to_bits())))
            }
        };
        let [one, two] = link.ends.each_ref().map(of_end);
        let [a, b] = ids.map(|id| forest.key(ElementId(id)));
        let coupling = u64::from(link.coupling.to_bits()) | u64::from(link.by_facets) << 32;
        CoarseValue { what: CoarseQuantity::GroupLink, ends: (a, b), bits: [coupling, one, two] }
    }));
}

fn value_of(what: CoarseQuantity, key: ElementKey, bits: [u64; 3]) -> CoarseValue {
    CoarseValue { what, ends: (key, key), bits }
}

/// Number that depends on all of some numbers and on their order.
fn digest(numbers: impl Iterator<Item = u64>) -> u64 {
    let step = |sum: u64, number: u64| {
        let x = (sum.rotate_left(23) ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x ^ (x >> 29)
    };
    numbers.fold(1, step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_tells_order_and_single_bits_apart() {
        let of = |numbers: &[u64]| digest(numbers.iter().copied());
        assert_ne!(of(&[1, 2]), of(&[2, 1]));
        assert_ne!(of(&[0]), of(&[0, 0]));
        assert_ne!(of(&[1 << 63, 0]), of(&[0, 0]));
        assert_eq!(of(&[3, 4]), of(&[3, 4]));
    }
}
