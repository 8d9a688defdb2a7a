//! How good a run's frames are, estimated and said.

use relume::session::{Accuracy, Frame, Sensor};

use crate::args::AccuracyFlag;

/// The estimates of a run, if any are wanted, and the worst of them.
#[derive(Debug)]
pub(crate) struct Estimates {
    how: AccuracyFlag,
    /// What was looked at, for the line.
    where_: &'static str,
    /// That of the frame before, which a still frame repeats.
    last: Option<Accuracy>,
    worst: Option<(u32, Accuracy)>,
}

impl Estimates {
    pub(crate) fn new(how: AccuracyFlag) -> Estimates {
        Estimates { how, where_: "points of the mesh", last: None, worst: None }
    }

    /// Estimates the error of the frame just solved: at an even share of the sensors, or else at points spread over what is lit.
    pub(crate) fn of(
        &mut self,
        solved: Frame<'_>,
        frame: u32,
        sensors: Option<&[Sensor]>,
    ) -> Option<Accuracy> {
        // Nothing changed, so neither has the error.
        let is_still = solved.report().sweeps == 0 && sensors.is_none();
        let found = match (self.how, sensors) {
            (AccuracyFlag::Off, _) => return None,
            (AccuracyFlag::Quick | AccuracyFlag::Points(_), None)
                if is_still && self.last.is_some() =>
            {
                return self.last;
            }
            (AccuracyFlag::Quick, _) => solved.estimate(),
            (AccuracyFlag::Points(points), None) => solved.accuracy(points as usize),
            (AccuracyFlag::Points(points), Some(sensors)) => {
                self.where_ = "sensors";
                solved.accuracy_at(&some(sensors, points as usize))
            }
        };
        self.last = Some(found);
        if self.worst.is_none_or(|(_, worst)| found.rms > worst.rms) {
            self.worst = Some((frame, found));
        }
        Some(found)
    }

    /// A line about the worst frame; empty if no error was estimated, or nothing is lit.
    pub(crate) fn line(&self, tolerance: f64) -> String {
        let Some((frame, found)) = self.worst.filter(|(_, found)| found.points > 0) else {
            return String::new();
        };
        let Accuracy { points, rms, nine_tenths, resolved, largest, largest_at, .. } = found;
        let [x, y, z] = largest_at;
        let percent = |error: f64| match error < resolved {
            true => format!("less than {}", in_percent(resolved)),
            false => format!("about {}", in_percent(error)),
        };
        let mut line = format!(
            "\nframe {frame}: irradiance is off by {} (RMS at {points} {}; nine tenths within {}; \
             largest {} too {} at {x:.3} {y:.3} {z:.3})",
            percent(rms),
            self.where_,
            in_percent(nine_tenths),
            in_percent(largest.abs()),
            if largest > 0.0 { "bright" } else { "dark" },
        );
        if rms > tolerance && rms > resolved {
            line += &format!(
                "\nnote: that is more than the tolerance of {tolerance}: try --tolerance {}",
                finer(tolerance, rms)
            );
        }
        line
    }
}

/// An even share of some sensors, at most so many.
fn some(sensors: &[Sensor], most: usize) -> Vec<Sensor> {
    let count = sensors.len().min(most);
    (0..count).map(|k| sensors[k * sensors.len() / count]).collect()
}

/// A tolerance at which the error may come down to `tolerance`: errors fall about as the root of it, and no faster than a
/// fifth at once is worth trying.
fn finer(tolerance: f64, rms: f64) -> f64 {
    let wanted = tolerance * (tolerance / rms).powi(2).clamp(0.2, 0.5);
    let unit = 10_f64.powf(wanted.log10().floor());
    unit * (wanted / unit).floor().max(1.0)
}

/// A share in per cent, to two digits.
fn in_percent(share: f64) -> String {
    match 100.0 * share {
        x if x < 1.0 => format!("{x:.2} %"),
        x if x < 10.0 => format!("{x:.1} %"),
        x => format!("{x:.0} %"),
    }
}
