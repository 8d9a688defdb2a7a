//! Relume: diffuse interreflection (radiosity) in scenes whose objects and lights move.
//!
//! Surfaces are divided into elements, and pairs of elements that exchange light are joined by links (hierarchical radiosity,
//! Hanrahan et al. 1991). A [`Scene`] is read from a file ([`import`]) or built in code ([`SceneBuilder`]). A [`Session`]
//! solves it, frame by frame or command by command, and evaluates again only the links that a change concerns. The links do not
//! depend on what was solved before: they equal those of a new session, bit for bit, on any number of threads. A [`Frame`]
//! gives access to a solution.
//!
//! A clip, and the irradiance at a point of the room in each of its frames:
//!
//! ```
//! use relume::{ImportOptions, Options, Session, import};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/box_room.glb");
//! let scene = import(file, &ImportOptions::default())?;
//! let mut session = Session::new(scene, Options { tolerance: 0.1, ..Options::default() })?;
//! for k in 0..3 {
//!     let frame = session.solve_at(f64::from(k) / 24.0)?;
//!     let [red, green, blue] = frame.irradiance_at([0.5, 0.3, 0.2], [0.0, 1.0, 0.0]); // a point, a unit normal
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
//! // A cube of side 2 about the origin: corners in metres, and triangles, counter-clockwise seen from inside.
//! let corner = |k: u32| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { 1.0 } else { -1.0 });
//! let sides = [[2, 6, 4, 0], [5, 7, 3, 1], [4, 5, 1, 0], [3, 7, 6, 2], [1, 3, 2, 0], [6, 7, 5, 4]];
//! let room_corners: Vec<[f64; 3]> = (0..8).map(corner).collect();
//! let room_triangles: Vec<[u32; 3]> = sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
//! // An octahedron, seen from outside.
//! let r = 0.1;
//! let lamp_corners = [[r, 0.0, 0.0], [-r, 0.0, 0.0], [0.0, r, 0.0], [0.0, -r, 0.0], [0.0, 0.0, r], [0.0, 0.0, -r]];
//! let lamp_triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//!
//! let mut b = SceneBuilder::new("two");
//! let grey = b.material("grey", [0.5; 3], [0.0; 3]); // reflectance, exitance in W/m2
//! let glow = b.material("glow", [0.0; 3], [1.0; 3]);
//! let room = b.body("room");
//! let ball = b.body("ball");
//! b.mesh(room, "walls", grey, &room_corners, &room_triangles);
//! b.mesh(ball, "lamp", glow, &lamp_corners, &lamp_triangles);
//! let mut session = Session::new(b.build()?, Options { tolerance: 0.1, ..Options::default() })?;
//! let first = session.solve()?.hash(); // of all links
//!
//! let undo = session.apply(Command::set_pose(ball, Pose::translation([0.1, 0.0, 0.0])))?; // to x = 0.1 m
//! let frame = session.solve()?; // evaluates only what the move changed
//! println!("{} links, {:?} W/m2", frame.report().links, frame.irradiance_at([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]));
//!
//! session.apply(undo)?;
//! assert_eq!(session.solve()?.hash(), first);
//! let mesh = session.solve()?.snapshot(); // four corners, radiosity and patch of each leaf element (a triangle repeats its last corner); revision
//! # assert_eq!(mesh.corners.len(), mesh.radiosity.len());
//! # Ok(())
//! # }
//! ```
//!
//! Triangles are counter-clockwise seen from their front, the side that is lit and shines: the walls of a room are seen from inside,
//! a lamp from outside. The back is black and hides what is behind it; [`SceneBuilder::double_sided_material`] makes both sides fronts. [`check`] tells
//! of walls that show their backs, and of all else in a scene that may be a mistake.
//!
//! [`Options`] has the tolerance: the relative error of irradiance that is aimed at, 0.02 unless given. Refusals are [`SceneError`],
//! [`CommandError`] and [`SessionError`]; they name the thing and the remedy.
//!
//! Lengths are metres, times seconds, light is radiometric (W, W/m2, W/sr) in three linear channels. Work is done on
//! rayon's global thread pool; to use one of your own, call from within its `ThreadPool::install`. Results are the same on any number of threads. [`Session::watch`] shows a
//! solve under way to other threads, and calls it off.
//!
//! The engine is the crate `relume-core`. Its modules are re-exported here for the command and the tests of this repository,
//! hidden: not part of the interface, and free to change.

#[doc(hidden)]
pub use relume_core::{element, pair, session, space};

pub use relume_io::export;

/// What stands in a [`FrameReport`]: counts, energies, seconds and bytes of a solve.
pub mod report {
    pub use relume_core::session::{
        Energy, LinkKinds, Memory, PairCounts, RowSumError, Seconds, Work,
    };
}

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
    SceneError, Severity, Surface, SurfaceId, Track, World, check, outside,
};
pub use relume_core::session::{
    Accuracy, Aim, Closure, Command, CommandError, Estimate, Event, EventKind, Factors, Flux,
    Frame, FrameReport, Gathered, Grouping, GroupingError, Hash, LampLight, Leaf, Mesh,
    MountedSensor, Open, Options, Oracle, PointError, Removed, Sensor, Session, SessionError,
    Snapshot, Update, Watch,
};
pub use relume_io::{ImportOptions, Log, LogError, PEAK_LUMENS_PER_WATT, import, read_environment};
