//! Calibration constants of pictures: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Display value of the log-average luminance.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: pictures wash out
/// - Smaller: pictures are dark
pub(super) const MIDDLE: f64 = 0.2;

/// Display value that all but the brightest 2 % stay below.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: lamps and bright walls turn white
/// - Smaller: dark pictures of scenes with few bright parts
pub(super) const BRIGHT: f64 = 0.9;

/// Display value that what the solution does not tell stays below.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: noise of the solution is shown where nothing is lit
/// - Smaller: dim scenes are black
pub(super) const UNTOLD: f64 = 0.1;

/// Cosine of the angle between neighbours up to which they stand for one curved surface: 35 degrees. A prism of twelve sides is a cylinder, a bevel of 45 degrees is an edge.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: curved surfaces show facets
/// - Smaller: edges are rounded
pub(super) const SMOOTH: f64 = 0.819;

/// Share of the area of the scene above which a patch is a surface of its own, and is left as it is.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: light of walls is spread over their edges
/// - Smaller: large facets of curved surfaces show
pub(super) const LARGE: f64 = 0.1;

/// Display value up to which tone is proportional; beyond it bright parts are compressed.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: bright walls turn white
/// - Smaller: contrast of bright parts is lost
pub(super) const KNEE: f64 = 0.6;

/// Rays from what a pixel shows to what lights it, lamps aside.
///
/// - Unit: rays
/// - Tried: not varied
/// - Larger: time
/// - Smaller: noise
pub(super) const RAYS: u32 = 16;

/// Points on surfaces, besides one on every patch or group of neighbours.
///
/// - Unit: points
/// - Tried: not varied
/// - Larger: time
/// - Smaller: coarse light
pub(super) const POINTS: f64 = 4096.0;

/// Points on one patch at most.
///
/// - Unit: points
/// - Tried: not varied
/// - Larger: few points are left for other patches
/// - Smaller: coarse light on large patches
pub(super) const POINTS_OF_PATCH: usize = 64;

/// Patches above which neighbours that face alike share a point.
///
/// - Unit: patches
/// - Tried: not varied
/// - Larger: time of scenes of many patches
/// - Smaller: coarse light
pub(super) const MANY: usize = 8192;

/// Cells that a unit of the scene is divided into where neighbours share a point.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time
/// - Smaller: neighbours that are far apart share light
pub(super) const CELLS: f32 = 40.0;

/// Points on lamps.
///
/// - Unit: points
/// - Tried: not varied
/// - Larger: time
/// - Smaller: coarse shadows
pub(super) const LAMP_POINTS: usize = 32;

/// Strongest punctual lights, those that count.
///
/// - Unit: lights
/// - Tried: not varied
/// - Larger: time
/// - Smaller: weak lights are left out
pub(super) const LIGHTS: usize = 64;

/// Bounces that are followed.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: time
/// - Smaller: dark corners
pub(super) const BOUNCES: usize = 4;

/// Stops below the typical radiosity at which a surface counts as black.
///
/// - Unit: stops
/// - Tried: not varied
/// - Larger: dim surfaces count as lit
/// - Smaller: lit surfaces count as black
pub(super) const STOPS: f64 = 8.0;

/// Distance below which something is right in front of the camera, in units of the scene.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: narrow rooms have no views
/// - Smaller: views into walls
pub(super) const CLOSE: f32 = 0.06;

/// Weight of black surfaces among those that a view is to show: where everything is dark, geometry decides.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: views of dark parts
/// - Smaller: views of one bright surface
pub(super) const BLACK: f64 = 0.05;

/// Surfaces of which a view need show no more.
///
/// - Unit: surfaces
/// - Tried: not varied
/// - Larger: views from afar
/// - Smaller: views of few things
pub(super) const SURFACES: usize = 24;

/// Pixels of a surface that is seen, at least.
///
/// - Unit: pixels
/// - Tried: not varied
/// - Larger: small things count for nothing
/// - Smaller: specks count as seen
pub(super) const PIXELS: u32 = 2;

/// Brightness (of the rough solution) above which a pixel or a surface counts as lit: six stops below the typical.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: dim parts count as dark
/// - Smaller: dark parts count as lit
pub(super) const LIT: f64 = 0.25;

/// Vertical field of view from outside.
///
/// - Unit: radians
/// - Tried: not varied
/// - Larger: perspective is exaggerated
/// - Smaller: perspective is lost
pub(super) const YFOV_OUTSIDE: f64 = 0.7;

/// Vertical field of view from inside.
///
/// - Unit: radians
/// - Tried: not varied
/// - Larger: perspective is exaggerated
/// - Smaller: little of a room is seen
pub(super) const YFOV_INSIDE: f64 = 1.1;

/// Share of directions in which a point sees fronts from which it is in a room.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: rooms with large openings have no views from inside
/// - Smaller: views from between objects
pub(super) const ROOM: f64 = 0.45;

/// Distance of things that a point in a room must see, in units of the scene: the inside of a double-sided object is no room.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: small rooms have no views
/// - Smaller: views from inside objects
pub(super) const SPAN: f32 = 0.4;

/// What views from inside, which fill the picture whatever they show, are worth less: for what is lit on the inside only.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: rooms are shown from outside
/// - Smaller: objects are shown from inside
pub(super) const INSIDE: f64 = 0.2;

/// How much less views from inside are worth where nothing is around the eye: what is open, as a cup, is looked into from outside.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: open rooms are shown from outside
/// - Smaller: cups are shown from inside
pub(super) const OPEN: f64 = 1.5;

/// What a view from behind (-Z) is worth less than one from the front of a file (+Z), from the sides half as much.
///
/// - Unit: 1
/// - Tried: 0.05 (of six figures and panels that were seen from behind all are seen from the front)
/// - Larger: things that face elsewhere are shown from their dark or empty side
/// - Smaller: figures are shown from behind
pub(super) const BEHIND: f64 = 0.05;

/// How many times larger than all else a plane is that views leave out.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: what stands on large grounds is a speck
/// - Smaller: rooms and yards are cut off
pub(super) const DWARFED: f64 = 8.0;

/// Thickness of a body up to which it may be such a ground, over the diagonal of the scene.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: buildings count as ground for what lies in them
/// - Smaller: what stands on thick floors is a speck
pub(super) const SLAB: f64 = 0.02;

/// Share of what emits that is seen from outside, from which on a scene glows outwards: what is within is no room.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: figures whose eyes glow are seen from within
/// - Smaller: rooms with glowing outsides are shown from outside
pub(super) const GLOW: f64 = 0.1;

/// What a view from inside is worth less there, for each picture full of reverse sides.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: nothing, beyond 2
/// - Smaller: figures whose eyes glow are seen from within
pub(super) const SKIN: f64 = 2.0;

/// Instants of an animation at which views are judged.
///
/// - Unit: instants
/// - Tried: not varied
/// - Larger: time
/// - Smaller: views that miss what moves
pub(super) const INSTANTS: u32 = 3;

/// Views that are looked at closely.
///
/// - Unit: views
/// - Tried: not varied
/// - Larger: time
/// - Smaller: a good view may be passed over
pub(super) const FINALISTS: usize = 8;

/// Share of what all lamps emit from which a lamp's light is found exactly in cleaned pictures.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: shadows of weak lamps are the mesh's
/// - Smaller: time
pub(super) const LAMP_SHARE: f64 = 1e-3;

/// Polygons of lamps whose light is found exactly, the strongest.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: time
/// - Smaller: shadows of finely tessellated lamps are the mesh's
pub(super) const LAMPS_MAX: usize = 256;

/// Exitance of a part of the sky, over the median of all parts, above which its light is found exactly.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: shadows in the light of windows are the mesh's
/// - Smaller: time
pub(super) const BRIGHT_SKY: f64 = 4.0;

/// Parts of the sky whose light is found exactly, the strongest.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: time
/// - Smaller: shadows in the light of bright skies are the mesh's
pub(super) const SKY_LAMPS_MAX: usize = 32;

/// Distance of a lamp, over the diameter of a leaf, from which its unhindered light is interpolated over the leaf.
///
/// - Unit: 1
/// - Tried: 2 (light off by 3e-3), 4
/// - Larger: time
/// - Smaller: seams between leaves below clear lamps
pub(super) const PATCHWORK_FAR: f64 = 4.0;

/// Lamps from which interpolating over a leaf is quicker than finding their light at every pixel.
///
/// - Unit: lamps
/// - Tried: not varied
/// - Larger: time
/// - Smaller: light of single lamps is interpolated for nothing
pub(super) const PATCHWORK_LAMPS: usize = 3;
