//! Tutorial of space, part 4: a clip is followed frame by frame, at a sensor and as a table of form factors.
//! `cargo run --release -p relume --example tutorial_4_clip`

use std::error::Error;
use std::fmt::Write as _;

use relume::{Grouping, ImportOptions, Options, Session, import};

/// What this part prints.
pub(crate) fn text() -> Result<String, Box<dyn Error>> {
    let mut out = String::new();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/box_room.glb");
    let scene = import(file, &ImportOptions::default())?;
    let bodies = Grouping::by_body(&scene);
    let mut session = Session::new(scene, Options { tolerance: 0.1, ..Options::default() })?;
    for k in 0..4 {
        let frame = session.solve_at(f64::from(k) / 24.0)?;
        let [red, ..] = frame.irradiance_at([0.5, 0.3, 0.2], [0.0, 1.0, 0.0]);
        let report = frame.report();
        writeln!(
            out,
            "frame {k}: {} links, {} judged, {red:.3} W/m2",
            report.links, report.work.examined
        )?;
    }
    let mut cold = Session::new(session.scene().clone(), session.options().clone())?;
    let hash = cold.solve_at(3.0 / 24.0)?.hash();
    let frame = session.solve()?;
    writeln!(
        out,
        "from scratch: {}",
        if frame.hash() == hash { "the same links" } else { "others" }
    )?;
    let factors = frame.factors(&bodies)?;
    for k in 0..bodies.names.len() as u32 {
        writeln!(
            out,
            "{}: form factors sum to {:.2}",
            bodies.names[k as usize],
            factors.row_sum(k)
        )?;
    }
    Ok(out)
}

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", text()?);
    Ok(())
}
