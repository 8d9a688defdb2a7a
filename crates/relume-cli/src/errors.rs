//! `relume errors`: where the error of a solution comes from.

use std::collections::BTreeMap;

use relume::scene::Scene;
use relume::session::PointError;

use crate::args::{ErrorsArgs, UpdateChoice, UpdateFlag};
use crate::clip::{Clip, solved, step_failure};
use crate::failure::Failure;
use crate::interrupt;
use crate::output;

/// Rows and places that are shown.
const SHOWN: usize = 12;

/// Runs the command.
pub(crate) fn errors(args: &ErrorsArgs) -> Result<(), Failure> {
    let clip = Clip::open(&args.source, &args.clip)?;
    clip.warn();
    let clip = clip.without_dark_sides();
    let mut session = clip.session(UpdateChoice::of(UpdateFlag::Certificate), false)?;
    for &frame in &clip.frames {
        if interrupt::requested() {
            return Err(Failure::interrupted("stopped"));
        }
        session.step(frame, clip.time_of(frame)).map_err(|error| step_failure(error, ""))?;
        let found = solved(&session).errors(args.points as usize);
        output::print(&format!("frame {frame}\n{}", table(&clip.scene, &found)))?;
    }
    Ok(())
}

/// What some points add up to.
#[derive(Clone, Copy, Default)]
struct Sum {
    share: f64,
    /// Squared errors: all, of the light of lamps, of all other light; and the error itself.
    all: f64,
    lamps: f64,
    reflected: f64,
    signed: f64,
}

impl Sum {
    fn add(&mut self, point: &PointError) {
        let error = point.relative();
        let lamps = point.direct / point.said.max(point.arrives);
        self.share += point.share;
        self.all += point.share * error * error;
        self.lamps += point.share * lamps * lamps;
        self.reflected += point.share * (error - lamps).powi(2);
        self.signed += point.share * error;
    }

    /// A row of the table: beside the whole.
    fn row(&self, name: &str, whole: &Sum) -> String {
        let percent = |square: f64| 100.0 * (square / self.share.max(f64::MIN_POSITIVE)).sqrt();
        format!(
            "{:>8.1} {:>8.1} {:>8.2} {:>8.2} {:>9.2} {:>+8.2}  {name}\n",
            100.0 * self.share / whole.share.max(f64::MIN_POSITIVE),
            100.0 * self.all / whole.all.max(f64::MIN_POSITIVE),
            percent(self.all),
            percent(self.lamps),
            percent(self.reflected),
            100.0 * self.signed / self.share.max(f64::MIN_POSITIVE),
        )
    }
}

/// Surfaces by their part of the squared error, then places.
fn table(scene: &Scene, found: &[PointError]) -> String {
    let (mut whole, mut dim) = (Sum::default(), Sum::default());
    let mut surfaces: BTreeMap<u32, Sum> = BTreeMap::new();
    let share = found.iter().map(|point| point.share).sum::<f64>().max(f64::MIN_POSITIVE);
    let mean = found.iter().map(|point| point.share * point.arrives).sum::<f64>() / share;
    for point in found {
        let surface = scene.patches[point.patch.0 as usize].surface;
        surfaces.entry(surface.0).or_default().add(point);
        whole.add(point);
        if point.arrives < 0.1 * mean {
            dim.add(point);
        }
    }
    let mut out = "  area %  error %    RMS %  lamps %  others %   mean %\n".to_owned();
    out += &whole.row("all", &whole);
    out += &dim.row("(where less than a tenth of the mean arrives)", &whole);
    let mut rows: Vec<(u32, Sum)> = surfaces.into_iter().collect();
    rows.sort_by(|a, b| b.1.all.total_cmp(&a.1.all));
    for (surface, sum) in rows.iter().take(SHOWN) {
        out += &sum.row(&output::name(&scene.surfaces[*surface as usize].name), &whole);
    }
    out + &places(scene, found, whole.all)
}

/// The places that most of the squared error is at.
fn places(scene: &Scene, found: &[PointError], whole: f64) -> String {
    let square = |point: &PointError| point.share * point.relative().powi(2);
    let mut worst: Vec<&PointError> = found.iter().collect();
    worst.sort_by(|a, b| square(b).total_cmp(&square(a)));
    let row = |point: &&PointError| {
        let at = scene.origin + point.at;
        let patch = &scene.patches[point.patch.0 as usize];
        format!(
            "{:>17.1} {:>8.4} W/m2 said, {:>8.4} arrive at {:.3},{:.3},{:.3} on {}\n",
            100.0 * square(point) / whole.max(f64::MIN_POSITIVE),
            point.said / 3.0,
            point.arrives / 3.0,
            at.x,
            at.y,
            at.z,
            output::name(&scene.surfaces[patch.surface.0 as usize].name)
        )
    };
    worst.iter().take(SHOWN).map(row).collect()
}
