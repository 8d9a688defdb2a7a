//! A lamp in a room is moved by hand, and back: `cargo run --release -p relume --example by_hand`.

use relume::{Command, Options, Pose, SceneBuilder, Session};

/// Corners of a cube of side 2 about the origin.
const CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];

/// Its sides, counter-clockwise seen from inside.
const SIDES: [[u32; 4]; 6] =
    [[2, 6, 4, 0], [5, 7, 3, 1], [4, 5, 1, 0], [3, 7, 6, 2], [1, 3, 2, 0], [6, 7, 5, 4]];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let triangles: Vec<[u32; 3]> =
        SIDES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    // An octahedron, seen from outside.
    let r = 0.2;
    let lamp_positions = [
        [r, 0.0, 0.0],
        [-r, 0.0, 0.0],
        [0.0, r, 0.0],
        [0.0, -r, 0.0],
        [0.0, 0.0, r],
        [0.0, 0.0, -r],
    ];
    let lamp_triangles =
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];

    let mut b = SceneBuilder::new("two");
    let grey = b.material("grey", [0.5; 3], [0.0; 3]);
    let glow = b.material("glow", [0.0; 3], [1.0; 3]);
    let room = b.body("room");
    let ball = b.body("ball");
    b.mesh(room, "walls", grey, &CORNERS, &triangles);
    b.mesh(ball, "lamp", glow, &lamp_positions, &lamp_triangles);
    let mut session = Session::new(b.build()?, Options::default())?;

    let frame = session.solve()?;
    let first = frame.hash();
    println!(
        "from scratch: {} pairs judged, {} links",
        frame.report().work.examined,
        frame.report().links
    );

    let undo = session.apply(Command::set_pose(ball, Pose::translation([0.1, 0.0, 0.0])))?;
    let frame = session.solve()?;
    let lit = frame.irradiance_at([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]);
    println!("moved: {} pairs judged, {lit:.4?} W/m2 on the floor", frame.report().work.examined);

    session.apply(undo)?;
    let frame = session.solve()?;
    println!("and back: {} as before", if frame.hash() == first { "links" } else { "not" });
    let mesh = frame.snapshot();
    println!("{} leaves, {} corners each", mesh.radiosity.len(), mesh.corners[0].len());
    Ok(())
}
