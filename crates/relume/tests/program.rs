//! A program against the face alone: a lamp is moved by hand and back.

use relume::{Command, Grouping, NewBody, Options, Pose, SceneBuilder, Session};

/// Corners, metres, and triangles.
type Shape = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Corners and triangles of a cube of side 2 `half`, counter-clockwise seen from outside, or from inside.
fn cube(half: f64, inward: bool) -> Shape {
    let corner = |k: u32| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { half } else { -half });
    let sides =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let turned = |[a, b, c]: [u32; 3]| if inward { [a, c, b] } else { [a, b, c] };
    let of_side = |[a, b, c, d]: [u32; 4]| [turned([a, b, c]), turned([a, c, d])];
    ((0..8).map(corner).collect(), sides.into_iter().flat_map(of_side).collect())
}

/// The program that the face was asked to run, word for word.
#[rustfmt::skip]
#[allow(unused_variables)]
fn as_it_was_asked_for(
    (positions, triangles): Shape,
    (lamp_positions, lamp_triangles): Shape,
) -> Result<(), Box<dyn std::error::Error>> {
    use relume::{Command, Options, Pose, SceneBuilder, Session};
    let mut b = SceneBuilder::new("two");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [1.0; 3]);
    let room = b.body("room"); let ball = b.body("ball");
    b.mesh(room, "walls", grey, &positions, &triangles);          // [[f64; 3]], [[u32; 3]]
    b.mesh(ball, "lamp", glow, &lamp_positions, &lamp_triangles);
    let scene = b.build()?;
    let mut session = Session::new(scene, Options::default())?;
    let first = session.solve()?.hash();
    let undo = session.apply(Command::set_pose(ball, Pose::translation([0.1, 0.0, 0.0])))?;
    let frame = session.solve()?;                                   // only what changed
    println!("{:?} {:?}", frame.report().links, frame.irradiance_at([0.0, 0.1, 0.0], [0.0, 1.0, 0.0]));
    session.apply(undo)?; assert_eq!(session.solve()?.hash(), first);
    let mesh = session.solve()?.snapshot();                         // flat arrays: corners, radiosity, patch, revision
    Ok(())
}

#[test]
fn the_program_that_was_asked_for_runs() {
    as_it_was_asked_for(cube(1.0, true), cube(0.2, false)).unwrap();
}

#[test]
fn a_body_is_moved_and_put_back() -> Result<(), Box<dyn std::error::Error>> {
    let (positions, triangles) = cube(1.0, true);
    let (lamp_positions, lamp_triangles) = cube(0.2, false);
    let mut b = SceneBuilder::new("two");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [1.0; 3]);
    let room = b.body("room");
    let ball = b.body("ball");
    b.mesh(room, "walls", grey, &positions, &triangles);
    b.mesh(ball, "lamp", glow, &lamp_positions, &lamp_triangles);
    let scene = b.build()?;
    let mut session = Session::new(scene, Options::default())?;
    let first = session.solve()?.hash();
    let undo = session.apply(Command::set_pose(ball, Pose::translation([0.1, 0.0, 0.0])))?;
    let frame = session.solve()?;
    assert_ne!(frame.hash(), first);
    assert!(frame.report().links > 0);
    // What a closed room of reflectance 1/2 receives on average is twice what the lamp sends, by area; the floor's middle more.
    assert!(frame.irradiance_at([0.0, -1.0, 0.0], [0.0, 1.0, 0.0])[0] > 0.08);
    session.apply(undo)?;
    assert_eq!(session.solve()?.hash(), first);
    let mesh = session.solve()?.snapshot();
    assert_eq!(mesh.radiosity.len(), mesh.patch.len());
    Ok(())
}

#[test]
fn a_grouping_of_another_scene_is_an_error_until_the_next_solve()
-> Result<(), Box<dyn std::error::Error>> {
    let mut b = SceneBuilder::new("one");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [1.0; 3]);
    let (room, lamp) = (b.body("room"), b.body("lamp"));
    let (walls, small) = (cube(1.0, true), cube(0.1, false));
    b.mesh(room, "walls", grey, &walls.0, &walls.1);
    b.mesh(lamp, "lamp", glow, &small.0, &small.1);
    let mut session = Session::new(b.build()?, Options::default())?;
    let block =
        |name| Command::Insert(NewBody::new(name).with_mesh(name, grey, &small.0, &small.1));
    let take_away = session.apply(block("one"))?;
    session.solve()?;
    let before = Grouping::by_body(session.scene());
    session.apply(take_away)?;
    session.apply(block("other"))?;
    // As many patches as before, of other bodies.
    let after = Grouping::by_body(session.scene());
    let frame = session.frame().expect("the last solution is kept");
    assert_eq!(frame.factors(&before)?.len(), 3);
    assert!(frame.factors(&after).is_err() && frame.fluxes(&after).is_err());
    let frame = session.solve()?;
    assert_eq!(frame.factors(&after)?.len(), 3);
    let error = frame.fluxes(&before).unwrap_err().to_string();
    assert!(error.contains("make it of the scene that the frame has"), "{error}");
    Ok(())
}
