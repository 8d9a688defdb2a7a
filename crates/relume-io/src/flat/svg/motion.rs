//! Motion from `animateTransform`: places and angles that go straight from key to key, as the plane's do.

use glam::{DAffine2, DVec2};
use roxmltree::Node;

use super::path::numbers;
use super::{Fault, fault, transform};
use relume_core::flat::{Key, Motion};

/// A group that moves.
pub(super) struct Moved {
    pub(super) motion: Motion,
    /// From its units to its body's frame, the origin of which is what it turns about.
    pub(super) world: DAffine2,
}

/// One animation: values at ascending times.
struct Track {
    keys: Vec<(f64, Vec<f64>)>,
}

/// How a group moves; `None` if it does not. `world` takes the units that it is in to metres.
///
/// With T(t) its translation and R(t) its rotation about c, points are at world T(t) R(t) p: in metres that
/// is a rotation about world c, and the straight way of T on top of it.
pub(super) fn of(node: Node<'_, '_>, world: &DAffine2) -> Result<Option<Moved>, Fault> {
    let children = node.children().filter(Node::is_element);
    let animations: Vec<_> =
        children.filter(|c| c.tag_name().name() == "animateTransform").collect();
    if animations.is_empty() {
        return Ok(None);
    }
    let Tracks { slide, turn } = tracks(node, &animations)?;
    let before = *world * transform::of(node)?;
    let m = before.matrix2;
    let (u, v) = (m.x_axis, m.y_axis);
    let size = u.length_squared();
    let alike = (v.length_squared() - size).abs() < 1e-9 * size && u.dot(v).abs() < 1e-9 * size;
    if !alike {
        return fault(
            "it moves within a transform that changes its shape",
            "scale both axes alike, and do not skew",
        );
    }
    let centre = match &turn {
        Some(track) => before.transform_point2(centre(track)?),
        None => DVec2::ZERO,
    };
    // y of the plane is up, so what turns clockwise in SVG does so by a negative angle.
    let sense = m.determinant().signum();
    let times = |track: &Option<Track>| -> Vec<f64> {
        track.iter().flat_map(|t| t.keys.iter().map(|key| key.0)).collect()
    };
    let mut times_s = [times(&slide), times(&turn)].concat();
    times_s.sort_unstable_by(f64::total_cmp);
    times_s.dedup();
    let key = |time_s: f64| {
        let shift =
            slide.as_ref().map_or(DVec2::ZERO, |t| DVec2::new(t.at(time_s, 0), t.at(time_s, 1)));
        let degrees = turn.as_ref().map_or(0.0, |t| t.at(time_s, 0));
        let angle = sense * degrees.to_radians();
        Key { time_s, place: centre + m * shift, angle }
    };
    let motion = Motion::new(times_s.into_iter().map(key).collect());
    Ok(Some(Moved { motion, world: DAffine2::from_translation(-centre) * before }))
}

/// The animations of one group.
struct Tracks {
    slide: Option<Track>,
    turn: Option<Track>,
}

/// The animations of a group by what they change, at most one of each, sliding first.
fn tracks(node: Node<'_, '_>, animations: &[Node<'_, '_>]) -> Result<Tracks, Fault> {
    let (mut slide, mut turn) = (None, None);
    for (k, animation) in animations.iter().enumerate() {
        let sum = animation.attribute("additive") == Some("sum");
        if !sum && (k > 0 || node.attribute("transform").is_some()) {
            return fault(
                "an animateTransform takes the place of its transform, or of another animateTransform",
                "add additive=\"sum\" to it",
            );
        }
        let (of, numbers) = match animation.attribute("type").unwrap_or("translate") {
            "translate" if turn.is_some() => {
                return fault(
                    "it turns before it slides",
                    "put the animateTransform of type translate first",
                );
            }
            "translate" => (&mut slide, 1..=2),
            "rotate" => (&mut turn, 1..=3),
            other => {
                return fault(
                    format!("animateTransform has type `{other}`"),
                    "bodies are rigid: write translate or rotate",
                );
            }
        };
        if of.is_some() {
            return fault(
                "it has two animateTransform of one type",
                "make one of them, with values",
            );
        }
        *of = Some(track(*animation, &numbers)?);
    }
    Ok(Tracks { slide, turn })
}

/// What a rotation turns about, which must stay where it is.
fn centre(track: &Track) -> Result<DVec2, Fault> {
    let of = |values: &[f64]| {
        let number = |k: usize| values.get(k).copied().unwrap_or(0.0);
        DVec2::new(number(1), number(2))
    };
    let first = of(&track.keys[0].1);
    match track.keys.iter().all(|key| of(&key.1) == first) {
        true => Ok(first),
        false => fault(
            "what it turns about moves",
            "let it turn about one point, and slide by another animateTransform",
        ),
    }
}

impl Track {
    /// A number at a time: that of the first key before it, and of the last after it.
    fn at(&self, time_s: f64, which: usize) -> f64 {
        let value = |k: usize| self.keys[k].1.get(which).copied().unwrap_or(0.0);
        let after = self.keys.partition_point(|key| key.0 <= time_s);
        match (after.checked_sub(1), after < self.keys.len()) {
            (None, _) => value(0),
            (Some(before), false) => value(before),
            (Some(before), true) => {
                let (from, to) = (self.keys[before].0, self.keys[after].0);
                let share = (time_s - from) / (to - from);
                value(before) + (value(after) - value(before)) * share
            }
        }
    }
}

fn track(node: Node<'_, '_>, counts: &std::ops::RangeInclusive<usize>) -> Result<Track, Fault> {
    if let Some(mode) = node.attribute("calcMode").filter(|&mode| mode != "linear") {
        return fault(
            format!("calcMode is `{mode}`"),
            "leave it out: bodies go straight from key to key",
        );
    }
    let values = match (node.attribute("values"), node.attribute("from"), node.attribute("to")) {
        (Some(values), ..) => values.split(';').map(str::to_owned).collect(),
        (None, Some(from), Some(to)) => vec![from.to_owned(), to.to_owned()],
        _ => {
            return fault(
                "animateTransform has no values",
                "write values=\"0 0; 1 0\", or from and to",
            );
        }
    };
    let values: Vec<String> = values.into_iter().filter(|v| !v.trim().is_empty()).collect();
    let values = values.iter().map(|v| numbers(v)).collect::<Result<Vec<_>, _>>()?;
    if values.is_empty() || !values.iter().all(|v| counts.contains(&v.len())) {
        return fault(
            "animateTransform has a value with too few or too many numbers",
            "write x y for translate, degrees or degrees x y for rotate",
        );
    }
    let begin_s = seconds(node, "begin")?.unwrap_or(0.0);
    let Some(length_s) = seconds(node, "dur")?.filter(|&s| s > 0.0) else {
        return fault("animateTransform has no dur above 0", "write such as dur=\"2s\"");
    };
    let shares = match node.attribute("keyTimes") {
        None => (0..values.len()).map(|k| k as f64 / (values.len() - 1).max(1) as f64).collect(),
        Some(text) => numbers(&text.replace(';', " "))?,
    };
    let ascend =
        shares.is_sorted_by(|a, b| a < b) && shares.iter().all(|s| (0.0..=1.0).contains(s));
    if shares.len() != values.len() || !ascend {
        return fault(
            "keyTimes does not go with values",
            "write a number from 0 to 1 for each value, ascending",
        );
    }
    let times = shares.into_iter().map(|share| begin_s + share * length_s);
    Ok(Track { keys: times.zip(values).collect() })
}

/// A time such as `2s`, `500ms` or `2`.
fn seconds(node: Node<'_, '_>, name: &str) -> Result<Option<f64>, Fault> {
    let Some(text) = node.attribute(name) else { return Ok(None) };
    let word = text.trim();
    let (number, unit) = match (word.strip_suffix("ms"), word.strip_suffix("min")) {
        (Some(number), _) => (number, 1e-3),
        (_, Some(number)) => (number, 60.0),
        _ => (word.strip_suffix('s').unwrap_or(word), 1.0),
    };
    match number.trim().parse::<f64>().ok().filter(|s| s.is_finite() && *s >= 0.0) {
        Some(number) => Ok(Some(number * unit)),
        None => fault(format!("{name} is `{text}`"), "write a time such as 2s or 500ms"),
    }
}
