//! Tutorial of space, part 3: a box is moved by hand and put back; only what changed is found anew.
//! `cargo run --release -p relume --example tutorial_3_by_hand`

use std::error::Error;
use std::fmt::Write as _;

use relume::glam::{DQuat, DVec3};
use relume::{Command, Options, Pose, Scene, SceneBuilder, Session};

/// The room of part 2.
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
    let options = Options { tolerance: 0.05, events: true, ..Options::default() };
    let mut session = Session::new(room()?, options)?;
    let first = session.solve()?.hash();
    let all = session.solve()?.report().pairs;
    let all = all.active + all.refined + all.culled;

    let body = session.scene().body_named("box").ok_or("there is a box")?;
    let aside = Command::set_pose(body, Pose::translation([0.0, 0.0, 0.2]));
    let undo = session.apply(aside)?;
    let frame = session.solve()?;
    let work = frame.report().work;
    writeln!(out, "moved: {} of {all} pairs looked at again", work.examined)?;
    writeln!(
        out,
        "{} links were refined, {} became one again, of {} another part is hidden",
        work.demoted, work.promoted, work.occlusion_changed
    )?;
    let event = frame.events().into_iter().next().ok_or("something happened")?;
    writeln!(out, "first event: {:?}, {} and {}", event.kind, event.receiver, event.source)?;

    session.apply(undo)?;
    let same = session.solve()?.hash() == first;
    writeln!(out, "put back: {}", if same { "the links of before, bit for bit" } else { "not" })?;
    Ok(out)
}

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", text()?);
    Ok(())
}
