//! What a bench measured, as tables and as JSON. Knows numbers only: no session, no clock.

use std::fmt::{self, Write};

use indicatif::HumanBytes;
use relume::session::{FrameReport, Seconds};
use serde::Serialize;

use crate::failure::Failure;
use crate::output::{count, counted};

/// Name of the format.
const SCHEMA: &str = "relume-bench/1";

/// Shorter times are not told apart, seconds: so that no ratio is infinite.
const INSTANT_S: f64 = 1e-9;

/// A frame that followed from the one before.
#[derive(Debug, Serialize)]
pub(crate) struct Measured {
    /// Time of the step, seconds.
    pub(crate) seconds: f64,
    /// Time to draw its picture, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) picture_seconds: Option<f64>,
    /// What was done.
    pub(crate) report: FrameReport,
    /// The same frame built from scratch.
    #[serde(rename = "from_scratch", skip_serializing_if = "Option::is_none")]
    pub(crate) cold: Option<Cold>,
}

/// A frame built from scratch.
#[derive(Debug, Serialize)]
pub(crate) struct Cold {
    /// Time to set up and solve, seconds.
    pub(crate) seconds: f64,
    /// What was done.
    pub(crate) report: FrameReport,
}

/// Memory at the last frame.
#[derive(Debug, Serialize)]
pub(crate) struct Held {
    /// Pair tree and links by receiver.
    pub(crate) pair_bytes: u64,
    /// Element forest, radiosities, and where each element's links are.
    pub(crate) element_bytes: u64,
    /// What does not grow with the tolerance.
    pub(crate) fixed_bytes: u64,
    /// Most memory of the process, the builds from scratch and the pictures included.
    pub(crate) peak_bytes: u64,
    /// Pairs of any state.
    pub(crate) pairs: u64,
    /// Elements.
    pub(crate) elements: u64,
    /// Links.
    pub(crate) links: u64,
}

/// All that was measured.
#[derive(Debug)]
pub(crate) struct Figures {
    /// Name of the scene.
    pub(crate) sequence: String,
    /// Relative error of irradiance aimed at, where there is one.
    pub(crate) tolerance: Option<f64>,
    /// The oracle, as on the command line.
    pub(crate) oracle: String,
    /// Both in words.
    pub(crate) settings: String,
    /// The update strategy, as on the command line.
    pub(crate) update: String,
    /// Threads used.
    pub(crate) threads: usize,
    /// The first frame, set up and solved.
    pub(crate) first: Measured,
    /// The frames after it; one or more.
    pub(crate) frames: Vec<Measured>,
    /// Memory.
    pub(crate) held: Held,
}

/// A row of the paper's Table 0.1.
#[derive(Debug, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Its name.
    pub(crate) sequence: String,
    /// Frames averaged over: all but the first.
    pub(crate) frames: usize,
    /// Time a frame, seconds: mean, standard deviation, median.
    pub(crate) mean_s: f64,
    pub(crate) standard_deviation_s: f64,
    pub(crate) median_s: f64,
    /// Time to set up and solve the first frame.
    pub(crate) first_s: f64,
    /// First by mean.
    pub(crate) ratio: f64,
}

/// Frames against the same frames built from scratch.
#[derive(Debug, Serialize)]
struct Against {
    /// Frames built both ways.
    frames: usize,
    cold_mean_s: f64,
    cold_median_s: f64,
    ratio_of_means: f64,
    ratio_of_medians: f64,
    bound: Bound,
}

/// The least that a frame would cost if only links with a moved end were judged, at the price of a
/// cold build (its evaluation as if all links cost the same), and the solve were what it was. Means over the frames built both ways.
#[derive(Debug, Serialize)]
struct Bound {
    /// Links with a moved end by all links, in the cold build.
    dynamic_share: f64,
    /// Their part of the cold build's evaluation.
    evaluate_s: f64,
    /// The solve of the frame itself.
    solve_s: f64,
    /// Cold build by bound: the largest ratio that can be hoped for.
    ratio: f64,
    /// The frame by its bound: 1 is as good as it gets.
    frame_by_bound: f64,
}

/// The mean of a counter over the frames, and over their builds from scratch.
#[derive(Debug, Serialize)]
struct Counter {
    name: &'static str,
    frame: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    from_scratch: Option<f64>,
}

/// The mean time of a phase, seconds.
#[derive(Debug, Serialize)]
struct Phase {
    name: &'static str,
    frame_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    from_scratch_s: Option<f64>,
}

/// Bytes for each.
#[derive(Debug, Serialize)]
struct Each {
    pair_bytes: f64,
    element_bytes: f64,
    /// Everything by links.
    link_bytes: f64,
}

/// The file.
#[derive(Serialize)]
struct File<'a> {
    schema: &'static str,
    version: &'static str,
    scene: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    tolerance: Option<f64>,
    oracle: &'a str,
    update: &'a str,
    threads: usize,
    table: Vec<Row>,
    against_scratch: Against,
    phases: Vec<Phase>,
    counters: Vec<Counter>,
    memory: &'a Held,
    memory_each: Each,
    first: &'a Measured,
    frames: &'a [Measured],
}

/// A counter of a frame's report.
type Read = fn(&FrameReport) -> u64;

const COUNTERS: [(&str, Read); 21] = [
    ("links", |r| r.links),
    ("dynamic_links", |r| r.work.dynamic_links),
    ("visited", |r| r.work.visited),
    ("examined", |r| r.work.examined),
    ("followed", |r| r.work.followed),
    ("certified", |r| r.work.certified),
    ("extrapolated", |r| r.work.extrapolated),
    ("coarse_examined", |r| r.work.coarse_examined),
    ("reevaluated", |r| r.work.reevaluated),
    ("visibility_only", |r| r.work.visibility_only),
    ("brightness_only", |r| r.work.brightness_only),
    ("changed", |r| r.work.changed),
    ("promoted", |r| r.work.promoted),
    ("demoted", |r| r.work.demoted),
    ("occlusion_changed", |r| r.work.occlusion_changed),
    ("segments", |r| r.work.segments),
    ("elements_made", |r| r.work.elements_made),
    ("elements_reaped", |r| r.elements_reaped),
    ("sweeps", |r| u64::from(r.sweeps)),
    ("gathers", |r| r.gathers),
    ("elements", |r| r.elements),
];

/// A phase of a frame's seconds.
type ReadSeconds = fn(&Seconds) -> f64;

const PHASES: [(&str, ReadSeconds); 6] = [
    ("move", |s| s.moving),
    ("predict", |s| s.predict),
    ("evaluate", |s| s.evaluate),
    ("judge", |s| s.edit),
    ("solve", |s| s.solve),
    ("tally", |s| s.total - s.moving - s.predict - s.evaluate - s.edit - s.solve),
];

impl Measured {
    fn with_picture(&self) -> Option<f64> {
        Some(self.seconds + self.picture_seconds?)
    }
}

impl Cold {
    /// Share of its links with an end that moved since the frame before, and its time there.
    fn dynamic(&self) -> (f64, f64) {
        let share = by(self.report.work.dynamic_links as f64, self.report.links as f64, 0.0);
        (share, share * self.report.seconds.evaluate)
    }
}

impl Figures {
    /// The tables as text.
    pub(crate) fn text(&self) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(
            out,
            "{}: {}, update {}, {}\n",
            self.sequence,
            self.settings,
            self.update,
            counted(self.threads, "thread")
        )?;
        self.write_table(out)?;
        self.write_against(out)?;
        self.write_means(out)?;
        self.write_memory(out)
    }

    fn write_table(&self, out: &mut String) -> fmt::Result {
        let rows = self.rows();
        let width = rows.iter().map(|r| r.sequence.chars().count()).max().unwrap_or(0).max(8);
        writeln!(
            out,
            "{:width$}  {:>6}  {:>9}  {:>9}  {:>9}  {:>13}  {:>6}",
            "", "", "average", "standard", "median", "set up and", ""
        )?;
        writeln!(
            out,
            "{:width$}  {:>6}  {:>9}  {:>9}  {:>9}  {:>13}  {:>6}",
            "sequence", "frames", "a frame", "deviation", "a frame", "solve frame 1", "ratio"
        )?;
        for row in rows {
            writeln!(
                out,
                "{:width$}  {:>6}  {:>9}  {:>9}  {:>9}  {:>13}  {:>6}",
                row.sequence,
                row.frames,
                time(row.mean_s),
                time(row.standard_deviation_s),
                time(row.median_s),
                time(row.first_s),
                times(row.ratio)
            )?;
        }
        Ok(())
    }

    fn write_against(&self, out: &mut String) -> fmt::Result {
        let against = self.against();
        let bound = &against.bound;
        writeln!(
            out,
            "\nfrom scratch  {} built both ways: average {}, median {} from scratch; \
             a frame is {} cheaper by the averages, {} by the medians",
            counted(against.frames, "frame"),
            time(against.cold_mean_s),
            time(against.cold_median_s),
            times(against.ratio_of_means),
            times(against.ratio_of_medians)
        )?;
        writeln!(
            out,
            "bound         {} = {} for the {:.1} % of links with a moved end at the price of a cold \
             build, and {} to solve: {} cheaper; a frame takes {:.2} of it",
            time(bound.evaluate_s + bound.solve_s),
            time(bound.evaluate_s),
            100.0 * bound.dynamic_share,
            time(bound.solve_s),
            times(bound.ratio),
            bound.frame_by_bound
        )
    }

    fn write_means(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "\n{:<18}{:>14}{:>14}", "means of", "a frame", "from scratch")?;
        let mut line = |name: &str, warm: String, cold: Option<String>| {
            let name = name.replace('_', " ");
            writeln!(out, "{name:<18}{warm:>14}{:>14}", cold.unwrap_or_default())
        };
        for phase in self.phases() {
            line(phase.name, time(phase.frame_s), phase.from_scratch_s.map(time))?;
        }
        for counter in self.counters() {
            line(counter.name, whole(counter.frame), counter.from_scratch.map(whole))?;
        }
        let sum = |read: Read| self.frames.iter().map(|m| read(&m.report) as f64).sum::<f64>();
        let examined = sum(|r| r.work.examined);
        writeln!(
            out,
            "examined are {:.2} % of all pairs, {:.2} for each pair changed",
            100.0 * by(examined, sum(|r| r.pairs.active + r.pairs.refined + r.pairs.culled), 0.0),
            by(examined, sum(|r| r.work.changed), 0.0)
        )
    }

    fn write_memory(&self, out: &mut String) -> fmt::Result {
        let each = self.each();
        let held = &self.held;
        writeln!(
            out,
            "\nmemory        {:.1} bytes a pair ({} pairs), {:.1} bytes an element ({}), {:.1} bytes a \
             link all included ({})",
            each.pair_bytes,
            count(held.pairs),
            each.element_bytes,
            count(held.elements),
            each.link_bytes,
            count(held.links)
        )?;
        writeln!(
            out,
            "              engine {}; peak of the process {}, builds from scratch included",
            HumanBytes(held.total()),
            HumanBytes(held.peak_bytes)
        )
    }

    /// Everything as JSON.
    pub(crate) fn json(&self) -> Result<String, Failure> {
        let file = File {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            scene: &self.sequence,
            tolerance: self.tolerance,
            oracle: &self.oracle,
            update: &self.update,
            threads: self.threads,
            table: self.rows(),
            against_scratch: self.against(),
            phases: self.phases(),
            counters: self.counters(),
            memory: &self.held,
            memory_each: self.each(),
            first: &self.first,
            frames: &self.frames,
        };
        serde_json::to_string_pretty(&file)
            .map(|text| text + "\n")
            .map_err(|error| Failure::new(format_args!("cannot write the figures: {error}")))
    }

    /// The rows of the paper's table: without and with pictures.
    pub(crate) fn rows(&self) -> Vec<Row> {
        let seconds: Vec<f64> = self.frames.iter().map(|m| m.seconds).collect();
        let mut rows = vec![Row::new(self.sequence.clone(), &seconds, self.first.seconds)];
        let drawn: Option<Vec<f64>> = self.frames.iter().map(Measured::with_picture).collect();
        if let (Some(drawn), Some(first)) = (drawn, self.first.with_picture()) {
            rows.push(Row::new(format!("{} with pictures", self.sequence), &drawn, first));
        }
        rows
    }

    fn against(&self) -> Against {
        let both: Vec<(&Measured, &Cold)> =
            self.frames.iter().filter_map(|m| Some((m, m.cold.as_ref()?))).collect();
        let of = |read: &dyn Fn(&Measured, &Cold) -> f64| -> Vec<f64> {
            both.iter().map(|(m, cold)| read(m, cold)).collect()
        };
        let cold = of(&|_, cold| cold.seconds);
        let warm = of(&|m, _| m.seconds);
        let evaluate_s = mean(&of(&|_, cold| cold.dynamic().1));
        let solve_s = mean(&of(&|m, _| m.report.seconds.solve));
        Against {
            frames: both.len(),
            cold_mean_s: mean(&cold),
            cold_median_s: median(&cold),
            ratio_of_means: ratio(mean(&cold), mean(&warm)),
            ratio_of_medians: ratio(median(&cold), median(&warm)),
            bound: Bound {
                dynamic_share: mean(&of(&|_, cold| cold.dynamic().0)),
                evaluate_s,
                solve_s,
                ratio: ratio(mean(&cold), evaluate_s + solve_s),
                frame_by_bound: ratio(mean(&warm), evaluate_s + solve_s),
            },
        }
    }

    fn phases(&self) -> Vec<Phase> {
        let phase = |&(name, read): &(&'static str, ReadSeconds)| {
            let (frame_s, from_scratch_s) = self.means(&|r| read(&r.seconds));
            Phase { name, frame_s, from_scratch_s }
        };
        PHASES.iter().map(phase).collect()
    }

    fn counters(&self) -> Vec<Counter> {
        let counter = |&(name, read): &(&'static str, Read)| {
            let (frame, from_scratch) = self.means(&|r| read(r) as f64);
            Counter { name, frame, from_scratch }
        };
        COUNTERS.iter().map(counter).collect()
    }

    /// Means over the frames and, if there are any, over their builds from scratch.
    fn means(&self, read: &dyn Fn(&FrameReport) -> f64) -> (f64, Option<f64>) {
        let frames: Vec<f64> = self.frames.iter().map(|m| read(&m.report)).collect();
        let cold = |m: &Measured| Some(read(&m.cold.as_ref()?.report));
        let cold: Vec<f64> = self.frames.iter().filter_map(cold).collect();
        (mean(&frames), (!cold.is_empty()).then(|| mean(&cold)))
    }

    fn each(&self) -> Each {
        let held = &self.held;
        Each {
            pair_bytes: by(held.pair_bytes as f64, held.pairs as f64, 0.0),
            element_bytes: by(held.element_bytes as f64, held.elements as f64, 0.0),
            link_bytes: by(held.total() as f64, held.links as f64, 0.0),
        }
    }
}

impl Held {
    fn total(&self) -> u64 {
        self.pair_bytes + self.element_bytes + self.fixed_bytes
    }
}

impl Row {
    fn new(sequence: String, seconds: &[f64], first_s: f64) -> Row {
        let mean_s = mean(seconds);
        Row {
            sequence,
            frames: seconds.len(),
            mean_s,
            standard_deviation_s: standard_deviation(seconds),
            median_s: median(seconds),
            first_s,
            ratio: ratio(first_s, mean_s),
        }
    }
}

/// Quotient, or `otherwise` where there is nothing to divide by.
fn by(one: f64, two: f64, otherwise: f64) -> f64 {
    if two > 0.0 { one / two } else { otherwise }
}

/// Quotient of two times.
pub(crate) fn ratio(one_s: f64, two_s: f64) -> f64 {
    one_s / two_s.max(INSTANT_S)
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    by(values.iter().sum(), values.len() as f64, 0.0)
}

/// Of a sample: divided by one less than its size; 0 for one value.
pub(crate) fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    by(squares, values.len() as f64 - 1.0, 0.0).sqrt()
}

/// The middle value; the mean of the two in the middle of an even number.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => 0.0,
        n if n.is_multiple_of(2) => (sorted[middle - 1] + sorted[middle]) / 2.0,
        _ => sorted[middle],
    }
}

/// A time with three significant digits.
pub(crate) fn time(seconds: f64) -> String {
    match seconds {
        s if s >= 0.9995 => format!("{} s", three(s)),
        s if s >= 0.999_5e-3 => format!("{} ms", three(s * 1e3)),
        s => format!("{} us", three(s * 1e6)),
    }
}

/// Three significant digits of an everyday number.
fn three(x: f64) -> String {
    match x {
        x if x >= 99.95 => format!("{x:.0}"),
        x if x >= 9.995 => format!("{x:.1}"),
        x => format!("{x:.2}"),
    }
}

/// A ratio: 18.1x.
pub(crate) fn times(ratio: f64) -> String {
    format!("{}x", three(ratio))
}

/// A mean count: whole where it is large.
pub(crate) fn whole(mean: f64) -> String {
    if mean == mean.round() || mean >= 100.0 {
        count(mean.round() as u64)
    } else {
        format!("{mean:.1}")
    }
}

#[cfg(test)]
mod tests {
    use relume::session::PairCounts;

    use super::*;

    /// Two frames after the first: 10 and 30 ms, against 200 ms from scratch for one of them.
    fn figures() -> Figures {
        let report = |dynamic_links, examined| {
            let mut report = FrameReport::default();
            let (work, seconds) = (&mut report.work, &mut report.seconds);
            (work.dynamic_links, work.examined, work.changed) = (dynamic_links, examined, 5);
            (seconds.evaluate, seconds.solve) = (0.1, 0.004);
            report.links = 1_000;
            report.pairs = PairCounts { active: 100, refined: 30, culled: 20 };
            report
        };
        let frame = |seconds, cold| Measured {
            seconds,
            picture_seconds: Some(0.01),
            report: report(20, 30),
            cold,
        };
        let cold = Cold { seconds: 0.2, report: report(100, 200) };
        Figures {
            sequence: "room".into(),
            tolerance: Some(0.02),
            oracle: "error".into(),
            settings: "tolerance 0.02, oracle error".into(),
            update: "reinspect".into(),
            threads: 2,
            first: frame(0.4, None),
            frames: vec![frame(0.01, Some(cold)), frame(0.03, None)],
            held: Held {
                pair_bytes: 6_000,
                element_bytes: 1_000,
                fixed_bytes: 3_000,
                peak_bytes: 1 << 20,
                pairs: 150,
                elements: 10,
                links: 100,
            },
        }
    }

    #[test]
    fn the_rows_are_those_of_the_paper() {
        let rows = figures().rows();
        assert_eq!(rows.len(), 2);
        assert_eq!((rows[0].sequence.as_str(), rows[0].frames), ("room", 2));
        let near = |x: f64, y: f64| assert!((x - y).abs() < 1e-12, "{x} is not {y}");
        near(rows[0].mean_s, 0.02);
        near(rows[0].standard_deviation_s, 0.02 / 2f64.sqrt());
        near(rows[0].ratio, 20.0);
        near(rows[1].mean_s, 0.03);
        near(rows[1].first_s, 0.41);
    }

    #[test]
    fn the_bound_is_the_dynamic_share_of_the_cold_work_and_the_solve() {
        let against = figures().against();
        let near = |x: f64, y: f64| assert!((x - y).abs() < 1e-12, "{x} is not {y}");
        assert_eq!(against.frames, 1);
        near(against.ratio_of_means, 20.0);
        near(against.bound.dynamic_share, 0.1);
        near(against.bound.evaluate_s, 0.01);
        near(against.bound.ratio, 0.2 / 0.014);
        near(against.bound.frame_by_bound, 0.01 / 0.014);
    }

    #[test]
    fn the_text_says_it_all() {
        let text = figures().text();
        for part in [
            "room: tolerance 0.02, oracle error, update reinspect, 2 threads",
            "room with pictures       2    30.0 ms    14.1 ms    30.0 ms         410 ms   13.7x",
            "1 frame built both ways: average 200 ms, median 200 ms",
            "14.0 ms = 10.0 ms for the 10.0 % of links",
            "examined are 20.00 % of all pairs, 6.00 for each pair changed",
            "40.0 bytes a pair (150 pairs), 100.0 bytes an element (10), 100.0 bytes a link",
        ] {
            assert!(text.contains(part), "`{part}` is missing in:\n{text}");
        }
    }

    #[test]
    fn the_file_holds_no_null() {
        let json = figures().json().unwrap();
        assert!(!json.contains("null"), "{json}");
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(value["schema"], SCHEMA);
        assert_eq!(value["frames"][0]["from_scratch"]["seconds"], 0.2);
        assert!(value["frames"][1].get("from_scratch").is_none());
    }

    #[test]
    fn middles_and_digits() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!((median(&[]), mean(&[]), standard_deviation(&[7.0])), (0.0, 0.0, 0.0));
        assert_eq!(time(30.95), "30.9 s");
        assert_eq!(time(0.0421), "42.1 ms");
        assert_eq!(time(2.5e-6), "2.50 us");
        assert!(ratio(1.0, 0.0).is_finite());
    }
}
