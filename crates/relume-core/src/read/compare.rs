//! Whether two solved sessions agree, and where not, in words: the judge of every short cut.
//!
//! Goes by the names of elements, not by their ids, which depend on history. Knows what links and
//! radiosities are, and nothing of how they came about.

use std::fmt;

use crate::element::{ElementId, ElementKey};
use crate::pair::{Carried, Gradients, PairHash, pair_key};

use super::coarse_values::{CoarseQuantity, CoarseValue};
use super::names::ElementName;
use super::solution::{Elements, named_leaves};
use crate::follow::Follower;

/// Single-precision roundings that a radiosity may differ by, in units of the last place: the
/// links of a receiver may be summed in another order.
const ROUNDINGS: f64 = 64.0;

/// Which of the two sessions compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// The first.
    One,
    /// The second.
    Two,
}

/// The first thing that two sessions differ in.
#[derive(Clone, Debug, PartialEq)]
pub enum Difference {
    /// They do not solve the same scene.
    Scene,
    /// Both have this link, but not the same exchange area, visibility or gradients.
    Carried {
        /// Its ends.
        ends: Box<(ElementName, ElementName)>,
        /// What it carries in the first session.
        one: Carried,
        /// What it carries in the second.
        two: Carried,
    },
    /// Only one of them has this link.
    OneOnly {
        /// Its ends.
        ends: Box<(ElementName, ElementName)>,
        /// Who has it.
        which: Which,
        /// What it carries there.
        carried: Carried,
    },
    /// A session has this link twice.
    Twice {
        /// Its ends.
        ends: Box<(ElementName, ElementName)>,
        /// Who has it twice.
        which: Which,
    },
    /// The links agree, but one report's hash is not that of its links.
    Hash {
        /// Whose.
        which: Which,
        /// What the report says.
        reported: String,
        /// What the links give.
        found: String,
    },
    /// The links agree, but a report counts another number of links, elements or leaves.
    Count {
        /// Of what.
        what: &'static str,
        /// In the first session.
        one: u64,
        /// In the second.
        two: u64,
    },
    /// The links agree, but not a value of the coarse solution or of groups.
    Coarse {
        /// Of which quantity.
        what: CoarseQuantity,
        /// Its ends: that of one element twice.
        ends: Box<(ElementName, ElementName)>,
        /// Its values in the first session and in the second; `None` in the one that lacks it.
        values: Box<[Option<CoarseValue>; 2]>,
    },
    /// Only one of them has this leaf.
    Leaf {
        /// Its name.
        element: ElementName,
        /// Who has it.
        which: Which,
    },
    /// A leaf's radiosities are further apart than the residuals allow.
    Radiosity {
        /// Its name.
        element: ElementName,
        /// In the first session, W/m2, linear RGB.
        one: [f32; 3],
        /// In the second.
        two: [f32; 3],
        /// How far they may be apart, W/m2.
        bound_w_m2: f64,
    },
}

/// How far apart the radiosities of two sessions are: the leaf that comes nearest to its bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RadiosityGap {
    /// Largest difference of a channel, W/m2.
    pub difference_w_m2: f64,
    /// What the residuals allow there, W/m2.
    pub bound_w_m2: f64,
}

/// Compares two sessions solved over the same scene with the same options: all links with what
/// they carry, bit for bit; the numbers of elements and leaves; the coarse solution (its links, and the brightness that verdicts
/// weigh by), groups and their links, bit for bit; and the radiosities of all leaves.
///
/// Two solutions B1, B2 of the same links with residuals r1, r2 (relative to the mean radiosity)
/// may differ by g (r1 + r2) of the mean radiosity, and by rounding to single precision, with g the largest error over the largest
/// residual: 1 / (1 - rho_max) unless sums of form factors exceed 1. The first difference in the order of the elements' names is returned, links before
/// counts before the coarse solution before radiosities; `None` where there is none.
///
/// Links are compared by their hash first, computed anew from the links of both; only where it
/// differs they are sorted. Cost: linear in links and n log n in elements, coarse links and links of groups where all is well.
pub fn compare<S: Elements>(one: &Follower<S>, two: &Follower<S>) -> Option<Difference> {
    let both = Both { one, two };
    if !one.space.is_of_the_scene_of(&two.space) {
        return Some(Difference::Scene);
    }
    let links = both.links().or_else(|| both.counts());
    links.or_else(|| both.coarse()).or_else(|| both.radiosities().err())
}

/// How far apart the radiosities of two sessions are that [`compare`] finds no difference between;
/// what it finds otherwise.
///
/// # Errors
/// The first leaf that only one of them has, or whose radiosities are too far apart.
pub fn radiosity_gap<S: Elements>(
    one: &Follower<S>,
    two: &Follower<S>,
) -> Result<RadiosityGap, Difference> {
    let both = Both { one, two };
    if one.space.is_of_the_scene_of(&two.space) {
        both.radiosities()
    } else {
        Err(Difference::Scene)
    }
}

/// Two sessions side by side.
struct Both<'a, S> {
    one: &'a Follower<S>,
    two: &'a Follower<S>,
}

/// A link by the names of its ends.
type NamedLink = ((ElementKey, ElementKey), Carried);

impl<S: Elements> Both<'_, S> {
    fn links(&self) -> Option<Difference> {
        let hashes = [self.one, self.two].map(hash_of);
        if hashes[0] != hashes[1] {
            let (one, two) = (named_links(self.one), named_links(self.two));
            return self.first_link(&one, &two);
        }
        let reports = [(Which::One, self.one), (Which::Two, self.two)];
        reports.into_iter().zip(hashes).find_map(|((which, solved), found)| {
            let (reported, found) = (solved.report.hash.clone(), found.to_string());
            (reported != found).then_some(Difference::Hash { which, reported, found })
        })
    }

    /// The first difference of two lists in key order.
    fn first_link(&self, one: &[NamedLink], two: &[NamedLink]) -> Option<Difference> {
        let alike = |(a, b): &(&NamedLink, &NamedLink)| a.0 == b.0 && bits(&a.1) == bits(&b.1);
        let same = one.iter().zip(two).take_while(alike).count();
        for (which, list) in [(Which::One, one), (Which::Two, two)] {
            if same > 0 && list.get(same).is_some_and(|link| link.0 == list[same - 1].0) {
                return Some(Difference::Twice { ends: self.ends(list[same].0), which });
            }
        }
        let only = |which, &(ends, carried): &NamedLink| Difference::OneOnly {
            ends: self.ends(ends),
            which,
            carried,
        };
        match (one.get(same), two.get(same)) {
            (None, None) => None,
            (Some(a), Some(b)) if a.0 == b.0 => {
                Some(Difference::Carried { ends: self.ends(a.0), one: a.1, two: b.1 })
            }
            (Some(a), Some(b)) if a.0 > b.0 => Some(only(Which::Two, b)),
            (Some(a), _) => Some(only(Which::One, a)),
            (None, Some(b)) => Some(only(Which::Two, b)),
        }
    }

    fn counts(&self) -> Option<Difference> {
        let (one, two) = (&self.one.report, &self.two.report);
        let counts = [
            ("links", one.links, two.links),
            ("elements", one.elements, two.elements),
            ("leaves", one.leaves, two.leaves),
        ];
        let differs = counts.into_iter().find(|(_, one, two)| one != two);
        differs.map(|(what, one, two)| Difference::Count { what, one, two })
    }

    /// The first value that differs, in the order of quantities and names.
    fn coarse(&self) -> Option<Difference> {
        let (one, two) = (self.one.space.coarse_values(), self.two.space.coarse_values());
        let same = one.iter().zip(&two).take_while(|(a, b)| a == b).count();
        let first = [one, two].map(|values| values.get(same).copied());
        let (what, ends) = first.iter().flatten().map(CoarseValue::name).min()?;
        let values = first.map(|value| value.filter(|value| value.name() == (what, ends)));
        Some(Difference::Coarse { what, ends: self.ends(ends), values: Box::new(values) })
    }

    fn radiosities(&self) -> Result<RadiosityGap, Difference> {
        let (one, two) = (named_leaves(self.one), named_leaves(self.two));
        let bound = Bound::new(self);
        let mut worst = RadiosityGap::default();
        for (a, b) in one.iter().zip(&two) {
            if a.0 != b.0 {
                break;
            }
            let (x, y) = (self.one.radiosity.radiosity(a.1.0), self.two.radiosity.radiosity(b.1.0));
            let gap = bound.gap(x, y);
            // So that what is no number counts as a difference.
            let within = gap.difference_w_m2 <= gap.bound_w_m2;
            if !within {
                let element = self.name(a.0);
                let bound_w_m2 = gap.bound_w_m2;
                return Err(Difference::Radiosity { element, one: x, two: y, bound_w_m2 });
            }
            if gap.share() >= worst.share() {
                worst = gap;
            }
        }
        match first_alone(&one, &two) {
            Some((which, key)) => Err(Difference::Leaf { element: self.name(key), which }),
            None => Ok(worst),
        }
    }

    fn ends(&self, (a, b): (ElementKey, ElementKey)) -> Box<(ElementName, ElementName)> {
        Box::new((self.name(a), self.name(b)))
    }

    fn name(&self, key: ElementKey) -> ElementName {
        self.one.space.name_of(key)
    }
}

/// How far radiosities may be apart.
struct Bound {
    by_residuals_w_m2: f64,
    mean_w_m2: f64,
    per_rounding: f64,
}

impl Bound {
    fn new<S: Elements>(both: &Both<'_, S>) -> Bound {
        let grows = S::error_growth(both.one);
        let mean_w_m2 = mean_radiosity(both.one).max(mean_radiosity(both.two));
        let residuals = both.one.report.residual + both.two.report.residual;
        Bound {
            by_residuals_w_m2: residuals * grows * mean_w_m2,
            mean_w_m2,
            per_rounding: ROUNDINGS * f64::from(f32::EPSILON) * grows,
        }
    }

    fn gap(&self, one: [f32; 3], two: [f32; 3]) -> RadiosityGap {
        let channels = one.map(f64::from).into_iter().zip(two.map(f64::from));
        let differences = channels.clone().map(|(a, b)| (a - b).abs());
        let largest = channels.fold(self.mean_w_m2, |m, (a, b)| m.max(a.abs()).max(b.abs()));
        RadiosityGap {
            // Not `f64::max`, which would drop what is no number.
            difference_w_m2: differences.fold(0.0, |m, d| if m.is_nan() || d <= m { m } else { d }),
            bound_w_m2: self.by_residuals_w_m2 + largest * self.per_rounding,
        }
    }
}

impl RadiosityGap {
    /// Difference by bound; 0 where there is no difference.
    pub fn share(&self) -> f64 {
        if self.difference_w_m2 == 0.0 { 0.0 } else { self.difference_w_m2 / self.bound_w_m2 }
    }
}

/// Area-weighted mean over all surfaces and channels, W/m2.
pub(super) fn mean_radiosity(solved: &Follower<impl Elements>) -> f64 {
    let (mut flux, mut area) = (0.0, 0.0);
    for &facet in solved.space.facets() {
        let a = solved.space.area_m2(facet);
        let b: f32 = solved.radiosity.radiosity(facet.0).iter().sum();
        flux += a * f64::from(b) / 3.0;
        area += a;
    }
    if area > 0.0 { flux / area } else { 0.0 }
}

/// What a link carries, to be compared bit for bit.
fn bits(carried: &Carried) -> (u32, u16, Gradients) {
    (carried.exchange_area_m2.to_bits(), carried.visibility, carried.gradients)
}

fn hash_of(solved: &Follower<impl Elements>) -> PairHash {
    let mut hash = PairHash::default();
    for link in solved.tree.links() {
        hash.add(pair_key(solved.space.key(link.a), solved.space.key(link.b)), &link.carried);
    }
    hash
}

fn named_links(solved: &Follower<impl Elements>) -> Vec<NamedLink> {
    let key = |id| solved.space.key(id);
    let mut out: Vec<NamedLink> =
        solved.tree.links().map(|l| ((key(l.a), key(l.b)), l.carried)).collect();
    out.sort_unstable_by_key(|link| link.0);
    out
}

/// The first name that only one of two sorted lists has.
fn first_alone(
    one: &[(ElementKey, ElementId)],
    two: &[(ElementKey, ElementId)],
) -> Option<(Which, ElementKey)> {
    let same = one.iter().zip(two).take_while(|(a, b)| a.0 == b.0).count();
    match (one.get(same), two.get(same)) {
        (None, None) => None,
        (Some(a), Some(b)) if b.0 < a.0 => Some((Which::Two, b.0)),
        (Some(a), _) => Some((Which::One, a.0)),
        (None, Some(b)) => Some((Which::Two, b.0)),
    }
}

impl Difference {
    /// The difference in words, with what the two sessions are to be called, such as "incremental"
    /// and "from scratch".
    pub fn in_words(&self, one: &str, two: &str) -> String {
        let name = |which: &Which| if *which == Which::One { one } else { two };
        let link = |ends: &(ElementName, ElementName)| {
            format!("the link between {} and {}", ends.0, ends.1)
        };
        match self {
            Difference::Scene => "they do not solve the same scene".to_owned(),
            Difference::Carried { ends, one: a, two: b } => {
                let [a, b] = in_numbers(a, b);
                format!("{} has {a} {one}, {b} {two}", link(ends))
            }
            Difference::OneOnly { ends, which, carried } => {
                let [numbers, _] = in_numbers(carried, carried);
                format!("{} exists {} only, with {numbers}", link(ends), name(which))
            }
            Difference::Twice { ends, which } => {
                format!("{} exists twice {}", link(ends), name(which))
            }
            Difference::Hash { which, reported, found } => format!(
                "the links agree, but {} the report's hash {reported} is not that of the links, {found}",
                name(which)
            ),
            Difference::Count { what, one: a, two: b } => {
                format!("the links agree, but there are {a} {what} {one}, {b} {two}")
            }
            Difference::Coarse { what, ends, values } => {
                let [a, b] = values.as_ref().map(|value| match value {
                    Some(value) => value.in_numbers(),
                    None => "nothing".to_owned(),
                });
                let of = match what {
                    CoarseQuantity::Brightness => format!("the brightness of {}", ends.0),
                    CoarseQuantity::Group => format!("the {}", ends.0),
                    CoarseQuantity::Link => {
                        format!("the coarse link to {} from {}", ends.0, ends.1)
                    }
                    CoarseQuantity::OpenLink => {
                        format!("the coarse link past all to {} from {}", ends.0, ends.1)
                    }
                    CoarseQuantity::GroupLink => link(ends),
                };
                format!("the links agree, but {of} has {a} {one}, {b} {two}")
            }
            Difference::Leaf { element, which } => {
                format!("{element} is a leaf {} only", name(which))
            }
            Difference::Radiosity { element, one: a, two: b, bound_w_m2 } => format!(
                "the radiosity of {element} is ({}) {one}, ({}) {two} W/m2: further apart than \
                 the {bound_w_m2:.2e} that the residuals allow",
                in_channels(*a),
                in_channels(*b)
            ),
        }
    }
}

/// What two links carry; gradients only where X and V are the same.
fn in_numbers(one: &Carried, two: &Carried) -> [String; 2] {
    let ((x, v, _), (y, w, _)) = (bits(one), bits(two));
    let alike = one.gradients != two.gradients && (x, v) == (y, w);
    [one, two].map(|c| {
        // Debug prints as many digits as it takes to tell two floats apart.
        let mut text = format!("X = {:?} m2, V = {:?}", c.exchange_area_m2, c.visibility());
        if alike {
            let ([au, av], [bu, bv]) = (c.gradients.over_a, c.gradients.over_b);
            text += &format!(", gradient steps ({au}, {av}) and ({bu}, {bv})");
        }
        text
    })
}

fn in_channels(value: [f32; 3]) -> String {
    value.map(|x| format!("{x:?}")).join(", ")
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.in_words("in the first session", "in the second session"))
    }
}

impl std::error::Error for Difference {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_of_no_number_is_a_difference() {
        let bound = Bound { by_residuals_w_m2: 1.0, mean_w_m2: 1.0, per_rounding: 0.0 };
        let gap = bound.gap([0.0, f32::NAN, 0.0], [0.0; 3]);
        assert!(gap.difference_w_m2.is_nan());
        assert_eq!(bound.gap([1.0, 2.0, 3.0], [1.0, 2.5, 3.0]).difference_w_m2, 0.5);
    }

    #[test]
    fn gradients_are_named_where_nothing_else_differs() {
        let one = Carried { exchange_area_m2: 0.5, visibility: 65_535, ..Carried::default() };
        let mut two = one;
        two.gradients.over_b = [3, -4];
        let [a, b] = in_numbers(&one, &two);
        assert_eq!(a, "X = 0.5 m2, V = 1.0, gradient steps (0, 0) and (0, 0)");
        assert_eq!(b, "X = 0.5 m2, V = 1.0, gradient steps (0, 0) and (3, -4)");
        two.visibility = 0;
        assert_eq!(in_numbers(&one, &two)[1], "X = 0.5 m2, V = 0.0");
    }
}
