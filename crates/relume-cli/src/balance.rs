//! What is said of frames in which light is unaccounted for, or does not get in.

use relume::scene::Scene;
use relume::session::Energy;

use crate::frames;
use crate::output;
use crate::report::{self, Report};
use crate::tuning::UNBALANCED_SAID;

/// Share of what would come from outside if nothing were in the way, below which what arrives is rounding.
const GETS_IN: f64 = 1e-4;

pub(crate) const NO_LIGHT_GETS_IN: &str = "\nwarning: next to no light from outside gets in: open what is closed around the scene (--hide NODE) \
                                or light it from within (--emit MATERIAL=RADIANCE)";

/// Whether all light is from outside at the start, and next to nothing of it arrives.
pub(crate) fn gets_no_light(scene: &Scene, energy: &Energy) -> bool {
    let Some(now) = scene.outside.as_ref().and_then(|outside| outside.at(0.0).ok()) else {
        return false;
    };
    let arrives: f64 = now.horizontal_w_m2().iter().flatten().sum();
    !scene.without_outside().emits() && energy.emitted_w < GETS_IN * arrives * scene.area_m2()
}

/// A line about finished frames in which more of the light than [`UNBALANCED_SAID`] is unaccounted for.
pub(crate) fn said_of_unbalanced(report: &Report, wanted: &[u32]) -> Option<String> {
    let finished = wanted.iter().map(|&frame| (frame, report.finished(frame)));
    let off: Vec<(u32, report::Finished)> =
        finished.filter(|(_, of)| of.unbalanced > UNBALANCED_SAID).collect();
    let (worst, of) = off.iter().max_by(|a, b| a.1.unbalanced.total_cmp(&b.1.unbalanced))?;
    let numbers: Vec<u32> = off.iter().map(|(frame, _)| *frame).collect();
    let suspects = match &of.suspects[..] {
        [] => String::new(),
        some => format!(
            "; more light arrives at {} than can: they pierce each other or lie very close",
            named(some)
        ),
    };
    let frames = if numbers.len() == 1 { "frame" } else { "frames" };
    Some(format!(
        "warning: {frames} {}: up to {:.1} % of the light is unaccounted for (frame {worst}){suspects}; a finer --tolerance \
         makes it less",
        frames::describe(&numbers),
        100.0 * of.unbalanced
    ))
}

fn named(surfaces: &[String]) -> String {
    let names: Vec<String> = surfaces.iter().map(|s| format!("`{}`", output::name(s))).collect();
    names.join(" and ")
}

/// A line about the energy balance of a frame.
pub(crate) fn balance(frame: u32, energy: &Energy, suspects: &[String]) -> String {
    let Energy { emitted_w, absorbed_w, escaped_w } = *energy;
    let share = 100.0 * energy.unbalanced();
    let mut line = format!(
        "\nframe {frame}: {emitted_w:.4} W emitted, {absorbed_w:.4} W absorbed, {escaped_w:.4} W escaped, \
         {share:.2} % unbalanced"
    );
    // What is more is said of all frames.
    if !suspects.is_empty() && energy.unbalanced() <= UNBALANCED_SAID {
        line += &format!(
            "\nwarning: more light arrives at {} than can: they pierce each other or lie very close",
            named(suspects)
        );
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{RunOptions, SceneSummary};

    #[test]
    fn frames_whose_light_is_off_are_said_and_the_worst_is_named() {
        let summary = SceneSummary {
            name: "room".into(),
            bodies: 1,
            patches: 6,
            area_m2: 6.0,
            bounds: None,
            content: "00".into(),
        };
        let options = RunOptions {
            frames: "all".into(),
            fps: 24.0,
            animation: None,
            edits: Vec::new(),
            tolerance: 0.1,
            oracle: "error".into(),
            update: "certificate".into(),
            threads: 1,
            max_memory_bytes: None,
            outside: None,
            picture: None,
        };
        let mut report = Report::new(summary, options);
        let mut add = |frame, absorbed_w, suspects: &[&str]| {
            let energy = Some(Energy { emitted_w: 100.0, absorbed_w, escaped_w: 0.0 });
            let suspects = suspects.iter().map(|s| (*s).to_owned()).collect();
            let mut entry = relume::session::FrameReport::default();
            (entry.frame, entry.energy, entry.suspects) = (frame, energy, suspects);
            report.add(&entry, None).unwrap();
        };
        add(0, 99.5, &[]);
        add(1, 102.0, &["floor"]);
        add(2, 96.0, &["shelf", "wall"]);
        add(4, 98.0, &[]);
        let said = said_of_unbalanced(&report, &[0, 1, 2, 4]).unwrap();
        assert!(said.starts_with("warning: frames 1-2, 4: up to 4.0 % of the light"), "{said}");
        assert!(said.contains("`shelf` and `wall`"), "{said}");
        assert_eq!(said_of_unbalanced(&report, &[0]), None);
        // Frames that are not asked for are another run's.
        assert!(said_of_unbalanced(&report, &[0, 4]).unwrap().contains("warning: frame 4:"));
    }
}
