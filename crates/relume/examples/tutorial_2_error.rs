//! Tutorial of space, part 2: links, elements and errors by tolerance.
//! `cargo run --release -p relume --example tutorial_2_error`

use std::error::Error;
use std::fmt::Write as _;

use relume::glam::{DQuat, DVec3};
use relume::{Options, Scene, SceneBuilder, Session};

/// A room with a lamp below its ceiling and a box on its floor.
fn room() -> Result<Scene, Box<dyn Error>> {
    let mut b = SceneBuilder::new("room");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [10.0; 3]);
    let node = |b: &mut SceneBuilder, name| b.node(name, None, DVec3::ZERO, DQuat::IDENTITY);
    let at = DVec3::new;
    let room = node(&mut b, "room");
    b.cuboid_inward(room, "walls", grey, DVec3::ZERO, at(4.0, 2.5, 3.0));
    let lamp = node(&mut b, "lamp");
    b.cuboid(lamp, "lamp", glow, at(1.5, 2.2, 1.2), at(2.1, 2.3, 1.8));
    let crate_ = node(&mut b, "box");
    b.cuboid(crate_, "box", grey, at(2.4, 0.0, 1.0), at(3.2, 0.8, 1.8));
    Ok(b.build()?)
}

/// What this part prints.
pub(crate) fn text() -> Result<String, Box<dyn Error>> {
    let mut out = String::new();
    for tolerance in [0.2, 0.1, 0.05] {
        let mut session = Session::new(room()?, Options { tolerance, ..Options::default() })?;
        let frame = session.solve()?;
        let report = frame.report();
        let energy = report.energy.ok_or("balance is asked for by default")?;
        let error = frame.accuracy(64).rms;
        writeln!(
            out,
            "tolerance {tolerance}: {} elements, {} links, balance off by {:.1e}, error {}",
            report.elements,
            report.links,
            energy.unbalanced(),
            if error < tolerance { "below it" } else { "above it" },
        )?;
    }
    Ok(out)
}

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", text()?);
    Ok(())
}
