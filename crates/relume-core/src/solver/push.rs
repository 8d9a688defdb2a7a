//! Irradiance pushed from the roots of quadtrees down to their leaves; row sums in the same way.

use super::field::Linear;
use super::links::Links;
use super::place::Place;
use super::surfaces::Surfaces;

/// Sum of the form factors from points of an element: 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowSum {
    /// Mean over the element.
    pub mean: f32,
    /// Gradient, per metre.
    pub gradient: [f32; 2],
}

/// Calls `visit` with the sum of the form factors from each leaf of a facet, over its and its
/// ancestors' links: as lines, or as means alone unless `linear`.
pub fn row_sums(
    surfaces: &impl Surfaces,
    links: &Links,
    linear: bool,
    counts: &(dyn Fn(u32) -> bool + Sync),
    facet: u32,
    visit: &mut dyn FnMut(u32, &RowSum),
) {
    let own = |id: u32| {
        let mut sum = Linear::default();
        let list = links.of(id);
        for link in list.iter().filter(|l| counts(l.source)) {
            sum.mean[0] += link.coupling;
            if !linear {
                continue;
            }
            let [u, v] = link.receiver_gradient();
            sum.gradient[0][0] += u * link.coupling;
            sum.gradient[1][0] += v * link.coupling;
        }
        if !list.is_empty() {
            let per_radius = 1.0 / surfaces.place(id).radius;
            sum.gradient.iter_mut().for_each(|g| g[0] *= per_radius);
        }
        match surfaces.groups() {
            Some(groups) => sum.plus(&groups.row(id, linear, counts)),
            None => sum,
        }
    };
    let place = surfaces.place(facet);
    push(surfaces, facet, &place, &Linear::default(), &own, &mut |id, sum| {
        visit(id, &RowSum { mean: sum.mean[0], gradient: sum.gradient.map(|g| g[0]) });
    });
}

/// Adds `own` up from the root of a quadtree down to its leaves.
pub(super) fn push(
    surfaces: &impl Surfaces,
    id: u32,
    place: &Place,
    inherited: &Linear,
    own: &dyn Fn(u32) -> Linear,
    visit: &mut dyn FnMut(u32, &Linear),
) {
    let whole = own(id).plus(inherited);
    let children = surfaces.children(id);
    if children.is_empty() {
        return visit(id, &whole);
    }
    for child in children {
        let at = surfaces.place(child);
        push(surfaces, child, &at, &whole.about(place, &at), own, visit);
    }
}
