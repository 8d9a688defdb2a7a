//! Relume: diffuse interreflection (radiosity) in scenes whose objects and lights move.
//!
//! A [`Scene`] is read from a file ([`import`]) or built in code ([`SceneBuilder`]). A [`Session`] solves it, frame by
//! frame or command by command, and pays for what changed; whatever came before, the links are those of a cold build,
//! bit for bit, on any number of threads. A [`Frame`] is what is read from a solution.
//!
//! A clip, and the irradiance at a sensor in each of its frames:
//!
//! ```
//! use relume::{ImportOptions, Options, Session, import};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/box_room.glb");
//! let scene = import(file, &ImportOptions::default())?;
//! let mut session = Session::new(scene, Options { tolerance: 0.1, ..Options::default() })?;
//! for k in 0..3 {
//!     let frame = session.solve_at(f64::from(k) / 24.0)?;
//!     let [red, green, blue] = frame.irradiance_at([0.5, 0.3, 0.2], [0.0, 1.0, 0.0]);
//!     println!("{k}: {red:.3} {green:.3} {blue:.3} W/m2");
//! }
//! # Ok(())
//! # }
//! ```
//!
//! A scene of one's own, in which a body is moved by hand and back:
//!
//! ```
//! use relume::{Command, Options, Pose, SceneBuilder, Session};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # fn cube(half: f64, inward: bool) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
//! #     let corner = |k: u32| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { half } else { -half });
//! #     let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
//! #     let turned = |[a, b, c]: [u32; 3]| if inward { [a, c, b] } else { [a, b, c] };
//! #     let of_side = |[a, b, c, d]: [u32; 4]| [turned([a, b, c]), turned([a, c, d])];
//! #     ((0..8).map(corner).collect(), sides.into_iter().flat_map(of_side).collect())
//! # }
//! # let (room_corners, room_triangles) = cube(1.0, true);
//! # let (lamp_corners, lamp_triangles) = cube(0.1, false);
//! let mut b = SceneBuilder::new("two");
//! let grey = b.material("grey", [0.5; 3], [0.0; 3]); // reflectance, exitance in W/m2
//! let glow = b.material("glow", [0.0; 3], [1.0; 3]);
//! let room = b.body("room");
//! let ball = b.body("ball");
//! b.mesh(room, "walls", grey, &room_corners, &room_triangles); // &[[f64; 3]] in metres, &[[u32; 3]]
//! b.mesh(ball, "lamp", glow, &lamp_corners, &lamp_triangles);
//! let mut session = Session::new(b.build()?, Options { tolerance: 0.1, ..Options::default() })?;
//! let first = session.solve()?.hash();
//!
//! let undo = session.apply(Command::set_pose(ball, Pose::translation([0.1, 0.0, 0.0])))?;
//! let frame = session.solve()?; // only what changed
//! println!("{} links, {:?} W/m2", frame.report().links, frame.irradiance_at([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]));
//!
//! session.apply(undo)?;
//! assert_eq!(session.solve()?.hash(), first);
//! let mesh = session.solve()?.snapshot(); // flat arrays, an entry a leaf: corners, radiosity, patch; and revision
//! # assert_eq!(mesh.corners.len(), mesh.radiosity.len());
//! # Ok(())
//! # }
//! ```
//!
//! Triangles are counter-clockwise seen from their front, the side that is lit and shines: the walls of a room are seen from inside,
//! a lamp from outside. The back is black and hides what is behind it; [`SceneBuilder::double_sided_material`] makes both sides fronts.
//!
//! Lengths are metres, times seconds, light is radiometric (W, W/m2, W/sr) in three linear channels. Work is done on
//! rayon's global pool; inside `ThreadPool::install` on that pool. Results are the same on any. [`Session::watch`] shows a
//! solve under way to other threads, and calls it off.
//!
//! The engine is the crate `relume-core`. Its rooms are re-exported here for the command and the tests of this repository,
//! hidden: not part of the interface, and free to change.

#[doc(hidden)]
pub use relume_core::{element, pair, session, space};

pub use relume_io::export;

/// The plane: scenes that do not change along one direction, with that direction integrated out.
pub mod flat {
    pub use relume_core::flat::{
        Body, BodyIndex, FlatElement, FlatFrame, FlatLink, FlatOptions, FlatScene, FlatSession,
        Key, Material, Motion, OptionError, PlanePose, SceneError, Segment, Wall, WallIndex,
    };
    #[doc(hidden)]
    pub use relume_core::flat::{FlatForest, FlatSolved, PlaneState, PlaneView, Shaft};
    pub use relume_io::flat::{SvgError, TextError, parse, parse_svg};
}

#[doc(hidden)]
pub mod scene {
    pub use relume_core::scene::*;
    pub use relume_io::{FrameRange, ImportOptions, Instants, import, read_file};
}

pub use relume_core::geometry::{Aabb, Pose};
pub use relume_core::glam;
pub use relume_core::scene::{
    Body, BodyId, Camera, Edits, Held, Interpolation, Light, LightId, LightKind, Material,
    MaterialId, NewBody, Note, Patch, PatchId, Projection, RotationTrack, Scene, SceneBuilder,
    SceneError, Severity, Surface, SurfaceId, Track, World, outside,
};
pub use relume_core::session::{
    Accuracy, Aim, Closure, Command, CommandError, Energy, Estimate, Event, EventKind, Factors,
    Flux, Frame, FrameReport, Gathered, Grouping, Hash, LampLight, Leaf, Memory, Mesh, Open,
    Options, Oracle, PairCounts, PointError, Removed, RowSumError, Seconds, Sensor, Session,
    SessionError, Snapshot, Update, Watch, Work,
};
pub use relume_io::{ImportOptions, Log, LogError, import, read_environment};
