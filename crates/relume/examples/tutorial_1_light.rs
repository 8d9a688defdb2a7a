//! Tutorial of space, part 1: light in a closed room, beside a known answer.
//! `cargo run --release -p relume --example tutorial_1_light`

use std::error::Error;
use std::fmt::Write as _;

use relume::glam::{DQuat, DVec3};
use relume::{Options, SceneBuilder, Session};

/// What this part prints.
pub(crate) fn text() -> Result<String, Box<dyn Error>> {
    let mut out = String::new();
    for reflectance in [0.0, 0.5, 0.8] {
        let mut b = SceneBuilder::new("furnace");
        // Reflectance, and exitance in W/m2, of three channels.
        let glowing = b.material("glowing", [reflectance; 3], [1.0; 3]);
        let room = b.node("room", None, DVec3::ZERO, DQuat::IDENTITY);
        b.cuboid_inward(room, "walls", glowing, DVec3::ZERO, DVec3::new(4.0, 2.5, 3.0));
        let mut session = Session::new(b.build()?, Options::default())?;
        let frame = session.solve()?;
        let [red, ..] = frame.irradiance_at([1.0, 0.0, 0.5], [0.0, 1.0, 0.0]);
        let known = 1.0 / (1.0 - reflectance);
        writeln!(out, "reflectance {reflectance}: {red:.3} W/m2, known {known:.3}")?;
    }
    Ok(out)
}

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", text()?);
    Ok(())
}
