//! What the engine finds of a case, measured against the judge.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use relume_core::scene::{Scene, check};
use relume_core::session::{
    Aim, Factors, FrameReport, Grouping, MountedSensor, Options, Sensor, Session, compare,
};
use relume_judge::path::{self, Estimate, Site};
use relume_judge::rows;

use crate::outside::case::Case;

/// The balance of energy that is kept, of what is emitted.
const BALANCE: f64 = 0.01;

/// Standard errors of the reference that are allowed for.
const NOISE: f64 = 4.0;

/// The engine's own memory, at most.
const MEMORY_BYTES: u64 = 1_000_000_000;

/// What begins a line about a frame that is solved.
pub(crate) const STEP: &str = "STEP ";

/// One thing that was measured.
#[derive(Clone, Debug)]
pub(crate) struct Measure {
    /// `row`, `factor`, `contact`, `sensor`, `energy`, `element` or `hash`.
    pub(crate) class: &'static str,
    pub(crate) what: String,
    pub(crate) off: f64,
    pub(crate) allowed: f64,
}

impl Measure {
    /// 1 at the limit; not a number where it makes no sense.
    pub(crate) fn share(&self) -> f64 {
        self.off / self.allowed
    }
}

/// All that was measured of a case.
#[derive(Clone, Debug, Default)]
pub(crate) struct Verdict {
    pub(crate) measures: Vec<Measure>,
    /// What cannot be measured: refused, or not finite.
    pub(crate) refused: Option<String>,
    /// Largest row sum of an element.
    pub(crate) element: f64,
    /// Seconds that the engine took for its frames.
    pub(crate) engine_s: f64,
    pub(crate) links: u64,
}

impl Verdict {
    pub(crate) fn passes(&self) -> bool {
        // A number that is not one does not pass.
        self.refused.is_none() && self.measures.iter().all(|m| m.share() <= 1.0)
    }

    /// The measure furthest beyond (or nearest to) its limit.
    pub(crate) fn worst(&self) -> Option<&Measure> {
        let rank = |m: &&Measure| if m.share().is_nan() { f64::INFINITY } else { m.share() };
        self.measures.iter().max_by(|a, b| rank(a).total_cmp(&rank(b)))
    }

    /// The worst share of each class of measures.
    pub(crate) fn by_class(&self) -> BTreeMap<&'static str, f64> {
        let mut out = BTreeMap::new();
        for m in &self.measures {
            let share = if m.share().is_nan() { f64::INFINITY } else { m.share() };
            let worst = out.entry(m.class).or_insert(share);
            *worst = f64::max(*worst, share);
        }
        out
    }

    fn add(&mut self, class: &'static str, what: impl Into<String>, off: f64, allowed: f64) {
        self.measures.push(Measure { class, what: what.into(), off, allowed });
    }
}

/// Solves a case and measures everything that it asks for.
#[allow(clippy::disallowed_methods)] // the time of a scene is among what is asked for
pub(crate) fn judge(case: &Case) -> Verdict {
    let mut verdict = Verdict::default();
    let scene = case.scene();
    let options = Options {
        tolerance: case.tolerance,
        // What fluxes and energies say is about the mesh; sensors keep their limits with both.
        aim: match std::env::var("RELUME_AIM").as_deref() {
            Ok("points") => Aim::Points,
            Ok("sensors") => {
                let mounted = |sensor: &Sensor| MountedSensor { body: None, sensor: *sensor };
                Aim::Sensors(case.world_sensors().iter().map(mounted).collect())
            }
            _ => Aim::Mesh,
        },
        max_memory_bytes: Some(MEMORY_BYTES),
        ..Options::default()
    };
    if case.factors {
        let dark = Arc::new(scene.without_light());
        run(case, &dark, &options, &mut verdict, &mut |session, _, time_s, verdict| {
            factors(case, session, time_s, verdict);
        });
    }
    if case.lit && verdict.refused.is_none() {
        run(case, &scene, &options, &mut verdict, &mut |session, report, time_s, verdict| {
            energy(case, report, time_s, verdict);
            sensors(case, session, time_s, verdict);
            fluxes(case, session, time_s, verdict);
        });
    }
    verdict
}

type Look<'a> = dyn FnMut(&Session, &FrameReport, f64, &mut Verdict) + 'a;

#[allow(clippy::disallowed_methods)]
fn run(case: &Case, scene: &Arc<Scene>, options: &Options, verdict: &mut Verdict, look: &mut Look) {
    let mut session = match Session::new(Arc::clone(scene), options.clone()) {
        Ok(session) => session,
        Err(why) => {
            verdict.refused = Some(why.to_string());
            return;
        }
    };
    for (frame, &time_s) in case.times_s.iter().enumerate() {
        let start = Instant::now();
        let report = match session.step(frame as u32, time_s) {
            Ok(report) => report,
            Err(why) => {
                verdict.refused = Some(format!("at {time_s} s: {why}"));
                return;
            }
        };
        verdict.engine_s += start.elapsed().as_secs_f64();
        verdict.links = verdict.links.max(report.links);
        if case.says_steps {
            println!("{STEP}at {time_s} s: {:.1} s, {} links", verdict.engine_s, report.links);
        }
        let highest = session.frame().unwrap().rows().iter().map(|r| r.1).fold(0.0, f64::max);
        verdict.element = verdict.element.max(highest);
        look(&session, &report, time_s, verdict);
        if case.cold {
            let mut cold = Session::new(Arc::clone(scene), options.clone()).expect("as before");
            match cold.step(frame as u32, time_s) {
                Ok(found) => {
                    let is_equal = found.hash == report.hash;
                    let between = [&session, &cold].map(|s| s.solved().expect("both have one"));
                    let why = (!is_equal).then(|| compare(between[0], between[1])).flatten();
                    let why = why.map_or_else(String::new, |why| format!(": {why}"));
                    let what = format!("hash at {time_s} s is not that of a cold build{why}");
                    verdict.add("hash", what, f64::from(u8::from(!is_equal)), 0.5);
                }
                Err(why) => verdict.refused = Some(format!("cold at {time_s} s: {why}")),
            }
        }
    }
}

/// A matrix by names, with what goes to the environment.
pub(crate) struct Table {
    rows: BTreeMap<String, BTreeMap<String, f64>>,
    sums: BTreeMap<String, f64>,
}

impl Table {
    pub(crate) fn new(names: &[String], factors: &Factors) -> Table {
        let (mut rows, mut sums) = (BTreeMap::new(), BTreeMap::new());
        for (k, name) in names.iter().enumerate() {
            let row = factors.row(k as u32).map(|(to, f)| (names[to as usize].clone(), f));
            rows.insert(name.clone(), row.collect());
            sums.insert(name.clone(), factors.row_sum(k as u32));
        }
        Table { rows, sums }
    }

    pub(crate) fn factor(&self, from: &str, to: &str) -> f64 {
        let row = self.rows.get(from).unwrap_or_else(|| panic!("no row `{from}`"));
        row.get(to).copied().unwrap_or(0.0)
    }

    /// The names of all rows.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.sums.keys().map(String::as_str)
    }

    pub(crate) fn environment(&self, from: &str) -> f64 {
        1.0 - self.sums.get(from).unwrap_or_else(|| panic!("no row `{from}`"))
    }
}

fn factors(case: &Case, session: &Session, time_s: f64, verdict: &mut Verdict) {
    let scene = session.scene();
    let grouping = Grouping::by_surface(scene);
    let table =
        Table::new(&grouping.names, &session.frame().unwrap().factors(&grouping).expect("it fits"));
    let allowed = case.tolerance / 4.0;
    let touching = case.contact.as_ref().filter(|c| time_s >= c.since_s);
    for k in &case.known {
        let off = (table.factor(&k.from, &k.to) - k.factor).abs();
        let what = format!("{} -> {} at {time_s} s, exactly {:.6}", k.from, k.to, k.factor);
        verdict.add("factor", what, off, allowed + k.error);
    }
    let said = case.may_overlap && overlap_is_said(scene);
    for (name, sum) in &table.sums {
        let in_contact = touching.is_some_and(|c| [&c.bottom, &c.floor].contains(&name));
        if case.sealed && !in_contact && !said {
            verdict.add("row", format!("row of {name} at {time_s} s"), (sum - 1.0).abs(), allowed);
        } else if !said {
            verdict.add("row", format!("row of {name} at {time_s} s above 1"), sum - 1.0, allowed);
        }
    }
    if let Some(contact) = touching {
        contact_holds(contact, &table, allowed, verdict);
    }
    let (world, names) = case.world(time_s);
    for (k, from) in case.rows.iter().enumerate() {
        if touching.is_some_and(|c| [&c.bottom, &c.floor].contains(&from)) {
            continue;
        }
        let of = |name: &str| -> Vec<usize> {
            (0..names.len()).filter(|&k| names[k] == *name).collect()
        };
        let row = rows::row(&world, &of(from), rays(case.tolerance), 1000 + k as u64);
        for to in table.rows.keys() {
            let (exact, error) = row.to(&of(to));
            let off = (table.factor(from, to) - exact).abs();
            let what = format!("{from} -> {to} at {time_s} s, {exact:.5} +- {error:.0e}");
            verdict.add("factor", what, off, allowed + NOISE * error);
        }
        let off = (table.environment(from) - row.lost).abs();
        let what = format!(
            "{from} -> environment at {time_s} s, {:.5} +- {:.0e}",
            row.lost, row.lost_error
        );
        if !said {
            verdict.add("row", what, off, allowed + NOISE * row.lost_error);
        }
    }
}

/// Whether reading or checking a scene says that things lie in one place.
pub(crate) fn overlap_is_said(scene: &Scene) -> bool {
    let words = ["overlap", "coincid", "coplanar", "duplicate", "same plane"];
    let found = check(scene);
    let mut notes = scene.notes.iter().chain(&found);
    notes.any(|n| words.iter().any(|w| n.message.contains(w)))
}

/// Rays of a row at a tolerance.
fn rays(tolerance: f64) -> u32 {
    match tolerance {
        t if t > 0.05 => 1 << 15,
        t if t > 0.01 => 1 << 17,
        _ => 1 << 18,
    }
}

/// The covered part of the floor and the bottom see each other, or nothing; neither sees the environment.
fn contact_holds(
    contact: &crate::outside::case::Contact,
    table: &Table,
    allowed: f64,
    verdict: &mut Verdict,
) {
    let (bottom, floor) = (&contact.bottom, &contact.floor);
    let escapes = [table.environment(bottom), table.environment(floor)];
    let off = escapes.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
    verdict.add(
        "contact",
        format!("contact: {bottom} and {floor} -> environment {escapes:.5?}"),
        off,
        allowed,
    );
    let to_floor = table.factor(bottom, floor);
    if to_floor > allowed {
        verdict.add(
            "contact",
            format!("contact: {bottom} -> {floor}, not 1"),
            (to_floor - 1.0).abs(),
            allowed,
        );
        let off = (table.factor(floor, bottom) - contact.share).abs();
        verdict.add(
            "contact",
            format!("contact: {floor} -> {bottom}, not {:.5}", contact.share),
            off,
            allowed,
        );
    }
}

fn energy(case: &Case, report: &FrameReport, time_s: f64, verdict: &mut Verdict) {
    let e = report.energy.expect("balance is asked for");
    let words = format!(
        "at {time_s} s {:.4e} W emitted, {:.4e} absorbed, {:.4e} escaped",
        e.emitted_w, e.absorbed_w, e.escaped_w
    );
    let allowed = BALANCE * e.emitted_w;
    verdict.add(
        "energy",
        format!("balance {words}"),
        (e.emitted_w - e.absorbed_w - e.escaped_w).abs(),
        allowed,
    );
    verdict.add("energy", format!("absorbed {words}"), e.absorbed_w - e.emitted_w, allowed);
    verdict.add("energy", format!("escaped {words}"), -e.escaped_w, allowed);
    if case.sealed {
        verdict.add(
            "energy",
            format!("escaped {words}"),
            e.escaped_w,
            f64::max(BALANCE, case.tolerance) * e.emitted_w,
        );
    }
}

/// Batches of particles.
const PARTICLES: u32 = 4_000;

/// Surfaces with less of the exposed area than this are looked at together alone.
const SMALL: f64 = 0.01;

/// What is darker than this share of the mean is measured by it.
const DARK: f64 = 0.1;

/// By how many tolerances the mean irradiance of one surface may be off.
const OF_ONE: f64 = 2.0;

/// Mean irradiances of surfaces: the root of their mean square error over the area within the tolerance, none off by much more, and all
/// together by a quarter of it.
fn fluxes(case: &Case, session: &Session, time_s: f64, verdict: &mut Verdict) {
    if !case.fluxes {
        return;
    }
    let grouping = Grouping::by_surface(session.scene());
    let found = session.frame().unwrap().fluxes(&grouping).expect("it fits");
    let (world, names) = case.world(time_s);
    let particles = path::arriving(&world, PARTICLES, 78);
    let (mut exact, mut noise) = (BTreeMap::new(), BTreeMap::new());
    for (name, e) in names.iter().zip(&particles) {
        *exact.entry(name.as_str()).or_insert(0.0) += e.irradiance[0];
        *noise.entry(name.as_str()).or_insert(0.0_f64) += e.standard_error[0].powi(2);
    }
    let mut areas = BTreeMap::new();
    for (name, polygon) in names.iter().zip(world.polygons()) {
        *areas.entry(name.as_str()).or_insert(0.0) += polygon.area_m2();
    }
    let area_m2: f64 = areas.values().sum();
    let all_w: f64 = exact.values().sum();
    let (mut sum, mut squares, mut noises) = (0.0, 0.0, 0.0);
    for (name, found) in grouping.names.iter().zip(&found) {
        let (Some(&w), Some(&square)) = (exact.get(name.as_str()), noise.get(name.as_str())) else {
            continue;
        };
        let (off, error) = (found.arriving_w[0] - w, square.sqrt());
        sum += off;
        noises += square;
        let share = areas[name.as_str()] / area_m2;
        // What is dark beside the rest is measured by a tenth of that.
        let here = w.max(DARK * all_w * share);
        if here > 0.0 {
            squares += share * ((off.abs() - error).max(0.0) / here).powi(2);
        }
        if share > SMALL {
            let what = format!(
                "{name} at {time_s} s: {:.4} W arrive, not {w:.4} +- {error:.0e}",
                found.arriving_w[0]
            );
            verdict.add("flux", what, off.abs(), OF_ONE * case.tolerance * here + NOISE * error);
        }
    }
    let what = format!("irradiance of surfaces at {time_s} s, root mean square");
    verdict.add("rms", what, squares.sqrt(), case.tolerance);
    let what =
        format!("all that arrives at {time_s} s: {:+.3} % of {all_w:.4} W", 100.0 * sum / all_w);
    verdict.add("all", what, sum.abs(), case.tolerance / 4.0 * all_w + NOISE * noises.sqrt());
}

/// Batches of paths of the first try and the last, which has a sixth of the tolerance or is as good as it gets.
const BATCHES: [u32; 2] = [500, 8_000];

fn sensors(case: &Case, session: &Session, time_s: f64, verdict: &mut Verdict) {
    if case.sensors.is_empty() {
        return;
    }
    let sensors = case.world_sensors();
    let found = session.frame().unwrap().irradiances_at(&sensors);
    let (world, _) = case.world(time_s);
    let site = |s: &Sensor| Site::point(s.at, s.normal);
    let sites: Vec<Site> = sensors.iter().map(site).collect();
    let trace = if case.by_particles { path::irradiance_by_particles } else { path::irradiance };
    let mut batches = BATCHES[0];
    let exact = loop {
        if let Some(e) = case.irradiance {
            break vec![Estimate { irradiance: [e; 3], ..Estimate::default() }; sites.len()];
        }
        let exact = trace(&world, &sites, batches, 77);
        let good = |e: &Estimate| e.standard_error[0] <= case.tolerance / 6.0 * e.irradiance[0];
        if batches >= BATCHES[1] || exact.iter().all(good) {
            break exact;
        }
        batches *= 4;
    };
    for (k, (exact, found)) in exact.iter().zip(found).enumerate() {
        let (exact, error) = (exact.irradiance[0], exact.standard_error[0]);
        let found = found[0];
        let what = format!("sensor {k} at {time_s} s: {found:.5}, not {exact:.5} +- {error:.0e}");
        let allowed = case.tolerance * exact + NOISE * error;
        verdict.add("sensor", what, (found - exact).abs(), allowed);
    }
}
