//! Calibration constants of the room `scene`: each with its unit, the range tried, and what gets worse either way.
//!
//! `docs/tuning.md` is made of this file. Constants that are exact, guard a representation or stand for rounding stay where
//! they are used.

/// Sum of the errors of a sky's facets, over the error of irradiance that they may make: a bound for any surface.
///
/// - Unit: 1
/// - Tried: shaped skies come to two thirds of the bound
/// - Larger: errors above the fineness
/// - Smaller: more facets
pub(super) const SKY_SHARE: f64 = 0.5;

/// Sum of the errors of facets all around, over the error of irradiance that they may make: a surface sees half of them.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: errors above the fineness
/// - Smaller: more facets
pub(super) const SKY_SHARE_ALL_ROUND: f64 = 0.25;

/// Width of the strip of a narrow gap that is lit as what is beside it, over the width of the gap: as much light as gets in.
///
/// - Unit: 1
/// - Tried: 2; what gets in is 0.5 between black faces, 4 between faces of reflectance 0.95
/// - Larger: gaps are too bright
/// - Smaller: too dark
pub(super) const GAP_STRIP: f64 = 2.0;

/// By how much that strip is wider, in widths of the gap, for each width of it over the length of its faces.
///
/// - Unit: 1
/// - Tried: 40 (sensors in gaps a seventieth as wide as long read 27 % too little), 160, 400
/// - Larger: gaps a hundredth as wide as long are lit as what is beside them
/// - Smaller: the middle of gaps a fiftieth as wide as long is dark
pub(super) const GAP_BEND: f64 = 400.0;

/// Size of faces between which gaps are looked for, over the largest coordinate of the scene.
///
/// - Unit: 1
/// - Tried: 0 (a sensor beside a device of 13 mm in a hall of 12 m read 3 % too much in place of 2 %), 0.01
/// - Larger: light fills gaps under small things
/// - Smaller: time; small things are looked at closely anyway
pub(super) const GAP_LEAST: f64 = 0.01;

/// Distance between parallel faces within which elements of one are divided along the outline of the other, over the size of the smaller.
///
/// - Unit: 1
/// - Tried: 0.033 (one more of 24 furnished rooms misses its limit), 0.1, 0.2 (no better)
/// - Larger: elements are divided along the edges of shadows that are wide and faint
/// - Smaller: what is bright or dark behind a panel close to a wall is handed to what lies beside it
pub(super) const END_WITHIN: f64 = 0.1;

/// Pairs of polygons of two bodies, of which one is moved, up to which gaps between them are looked for.
///
/// - Unit: pairs
/// - Tried: not varied
/// - Larger: time of a frame in which finely tessellated bodies move beside each other
/// - Smaller: light fills the gaps between such bodies
pub(super) const GAP_PAIRS_MAX: usize = 1 << 20;

/// Faces of a solid up to which it is looked whether it is convex.
///
/// - Unit: faces
/// - Tried: not varied
/// - Larger: time of reading: it grows as their square
/// - Smaller: bodies of more faces cast shadows patch by patch
pub(super) const SOLID_FACES_MAX: usize = 1_024;

/// Pieces that a polygon is cut into at most to see whether one is inside a shell; beyond it counts as inside.
///
/// - Unit: pieces
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: dark sides that are kept
pub(super) const SHELL_PIECES_MAX: usize = 256;

/// Corners looked at in one scene for shells; what is not settled by then counts as inside.
///
/// - Unit: corners
/// - Tried: not varied; this many take about a second
/// - Larger: time of reading
/// - Smaller: dark sides that are kept
pub(super) const SHELL_LOOKS_MAX: usize = 20_000_000;

/// Share of a patch from which on it is covered wholly: it is dark, and counts nowhere twice.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: slivers of patches that rounding leaves
/// - Smaller: patches that lose light at an edge
pub(super) const COVERED_WHOLLY: f64 = 0.999;

/// Cuts made in one scene to find what rests on what; what would be found after that is not.
///
/// - Unit: cuts
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: light under what rests on patches, in scenes of many contacts
pub(super) const COVERED_CUTS_MAX: usize = 2_000_000;

/// Polygons of a body up to which it is asked whether it is convex, so that what lies in front of one of them is outside it.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: time of reading: the question grows as their square
/// - Smaller: time of reading: bodies of more polygons are cut where one look would do
pub(super) const COVERING_POLYGONS_MAX: usize = 128;

/// Polygons of a surface, and covered parts of a patch, that are looked at.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: covered parts that stay lit
pub(super) const COVERED_PARTS_MAX: usize = 4_096;

/// Cuts made at one instant to find what bodies in motion cover; what would be found after that is not.
///
/// - Unit: cuts
/// - Tried: not varied
/// - Larger: time of a frame
/// - Smaller: light under bodies in motion, in scenes of many contacts
pub(super) const COVERING_CUTS_MAX: usize = 200_000;

/// Parts of an animation in which bounds of what moves are taken, to find sides that nothing ever sees.
///
/// - Unit: parts
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: dark sides that are kept
pub(super) const SLICES: u32 = 64;

/// Instants of an animation at which an edge must be in one place to count as at rest.
///
/// - Unit: instants
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: cuts along edges that move in between
pub(super) const HINGE_INSTANTS: u32 = 64;

/// Share of a scale by which it may be uneven and still count as uniform: what rigs in the wild have from rounding.
///
/// - Unit: 1
/// - Tried: not varied; a tenth of a millimetre of a metre
/// - Larger: places off by as much
/// - Smaller: scenes that are refused
pub(super) const UNEVEN_MAX: f64 = 1e-4;

/// Facets of a sky at most.
///
/// - Unit: facets
/// - Tried: not varied
/// - Larger: links with the sky
/// - Smaller: errors of skies of sharp contrast
pub(super) const SKY_FACETS_MAX: usize = 1024;

/// Samples along a side of a cell of a sky by formula.
///
/// - Unit: samples
/// - Tried: not varied
/// - Larger: time of making the sky
/// - Smaller: errors of its facets
pub(super) const SKY_SAMPLES: u32 = 8;

/// Samples along a side of a cell of a picture, at least and at most: as many as there are pixels, so that the sun is not
/// overlooked.
///
/// - Unit: samples
/// - Tried: not varied
/// - Larger: time of making the sky
/// - Smaller: suns of few pixels that are missed
pub(super) const SKY_SAMPLES_OF_PICTURES: (u32, u32) = (64, 1024);

/// Divisions of a cell of the sky at least: what stands before a large one is much to clip.
///
/// - Unit: divisions
/// - Tried: not varied
/// - Larger: links with the sky
/// - Smaller: time of visibilities
pub(super) const SKY_DEPTH_MIN: u32 = 1;

/// Divisions of a cell of the sky at most, of skies by formula and of pictures.
///
/// - Unit: divisions
/// - Tried: not varied
/// - Larger: facets
/// - Smaller: errors where a sky is bright in a small place
pub(super) const SKY_DEPTH_MAX: (u32, u32) = (5, 8);

/// Corners of the polygon that stands for the sun's disc.
///
/// - Unit: corners
/// - Tried: 8: a penumbra is off by up to 0.6 % of the sun's light
/// - Larger: time of visibilities
/// - Smaller: errors of penumbrae
pub(super) const SUN_CORNERS: u32 = 16;

/// Distance of what is outside over the extent of the scene: directions differ by half a thousandth from one end of it to the
/// other.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: rounding of what is outside
/// - Smaller: errors of directions
pub(super) const OUTSIDE_FAR: f64 = 2048.0;

/// Instants of the animation at which the scene's extent is looked at.
///
/// - Unit: instants
/// - Tried: not varied
/// - Larger: time of reading
/// - Smaller: an extent that misses what flies far in between
pub(super) const EXTENT_INSTANTS: u32 = 32;

/// Time between two keys of a day, between which the sun goes on evenly.
///
/// - Unit: s
/// - Tried: not varied
/// - Larger: errors of its direction in between
/// - Smaller: keys
pub(super) const SUN_KEY_S: f64 = 600.0;

/// Blocks of an image along a side of what a pixel covers.
///
/// - Unit: blocks
/// - Tried: not varied
/// - Larger: time of pictures
/// - Smaller: pictures whose textures flicker
pub(super) const PRINT_RESOLUTION: f64 = 4.0;

/// Rays from a point or a spot that is checked for lighting nothing.
///
/// - Unit: rays
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: lights that are said to light nothing and do
pub(super) const LIGHT_RAYS: u32 = 256;

/// Rays of a directional light that is checked: enough to find a window of a twentieth of the scene's width.
///
/// - Unit: rays
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: suns that are said to light nothing and do
pub(super) const SUN_RAYS: u32 = 1024;

/// Polygons of an object that emits from which rays are tried.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: lamps that are said to light nothing and do
pub(super) const LAMP_POLYGONS: usize = 16;

/// Rays from each of these.
///
/// - Unit: rays
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: as above
pub(super) const LAMP_RAYS: u32 = 24;

/// Polygons that rays of lights are tried against in all; with that spent, the rest of the lights is not tried.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: lights that are not tried in large scenes
pub(super) const LIGHT_TRIALS: usize = 400_000_000;

/// Instants of the animation at which a light that lights nothing at its start is tried again.
///
/// - Unit: instants
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: warnings of lights that are uncovered in between
pub(super) const LIGHT_INSTANTS: u32 = 8;

/// Distance of a polygon from a lamp over the width of the lamp up to which it lies right before it, if it is parallel.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: glass of lamps far from them that is named
/// - Smaller: glass that is overlooked
pub(super) const RIGHT_BEFORE: f64 = 0.05;

/// Extent of what is closed around a light, over the scene's diagonal, up to which it is the light's shade and no room.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: rooms that are named as shades
/// - Smaller: shades that are not named
pub(super) const SHADE: f64 = 0.25;

/// Size of a wall over the scene's diagonal at least, for checks of walls that look outwards.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: small walls that are overlooked
/// - Smaller: furniture that is named
pub(super) const WALL_MIN: f64 = 0.02;

/// Distance up to which something joins a wall, over the size of the wall (the root of its area).
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: furniture that joins walls
/// - Smaller: walls with gaps that are overlooked
pub(super) const JOINS: f64 = 0.02;

/// Share of the longer part from which on what lies on both sides of a wall lies on neither.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: walls that go on behind others count as neighbours
/// - Smaller: skirtings hide what joins
pub(super) const ON_BOTH_SIDES: f64 = 0.2;

/// Points of each side of a wall at which neighbours are sought.
///
/// - Unit: points
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: sides of several neighbours are taken for open
pub(super) const SIDE_POINTS: u32 = 8;

/// Share of a side that has to join something.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: walls beside doors are overlooked
/// - Smaller: things that touch a wall count as rooms
pub(super) const JOINED_SHARE: f64 = 0.6;

/// Share of a wall's sides along which neighbours may look the same way round as the wall: furniture that stands there.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: bodies seen from outside are named
/// - Smaller: rooms with furniture are overlooked
pub(super) const SAME_WAY_MAX: f64 = 0.1;

/// Cosine of the angle within which sides of a wall are one.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: walls of round rooms have too few sides
/// - Smaller: corners are overlooked
pub(super) const ONE_SIDE: f64 = 0.96;

/// Widest angle in the plane of a wall without a side that is joined: an open top.
///
/// - Unit: degrees
/// - Tried: not varied
/// - Larger: shelves count as rooms
/// - Smaller: rooms without a ceiling are overlooked
pub(super) const OPEN_MAX_DEG: f64 = 200.0;

/// Rays from each side of a wall.
///
/// - Unit: rays
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: chance decides on walls
pub(super) const WALL_RAYS: u32 = 192;

/// Share of the rays from the back of a wall that meet fronts at least.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: open rooms are overlooked
/// - Smaller: walls of the outside are named
pub(super) const SEEN_MIN: f64 = 0.08;

/// Backs met from the back of a wall, over the fronts met, at most.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: bodies seen from outside are named
/// - Smaller: rooms of which several walls look outwards are overlooked
pub(super) const BACKS_MAX: f64 = 0.6;

/// What the rays from the front of a wall meet, over the fronts met from its back, at most.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: walls between rooms are named
/// - Smaller: rooms in a landscape are overlooked
pub(super) const BEFORE_MAX: f64 = 0.25;

/// Polygons that rays and sides of walls are tried against in all.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: time of checks
/// - Smaller: walls that are not tried in large scenes
pub(super) const WALL_TRIALS: usize = 100_000_000;

/// Rays from each place in the air of a room.
///
/// - Unit: 1
/// - Tried: 192, 512 (with other changes at once: 242 and 287 of 300 rooms right)
/// - Larger: time
/// - Smaller: small objects are not met
pub(super) const AIR_RAYS: u32 = 512;

/// Share of the rays from a place that meet something, at least, for it to be in a room.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: rooms with large openings are overlooked
/// - Smaller: what stands in the open is judged
pub(super) const AIR_MET_MIN: f64 = 0.8;

/// Share of what is met from a place that is fronts, at least, for it to be in air and not in a body.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: rooms of which several walls face outwards are overlooked
/// - Smaller: where most walls face outwards the others are named
pub(super) const AIR_FRONTS_MIN: f64 = 0.5;

/// Rays from the air that meet backs of an object, at least, for it to be named.
///
/// - Unit: rays
/// - Tried: not varied
/// - Larger: small objects are overlooked
/// - Smaller: objects are named of which little is seen
pub(super) const BACKS_SEEN_MIN: u32 = 6;

/// Share of the rays that meet an object from the air that meet its backs, at least, for it to be named.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: bodies with something through them are overlooked
/// - Smaller: open bodies are named, whose insides are seen
pub(super) const BACKS_OF_ALL: f64 = 0.98;

/// Share of the rays from an object's fronts that meet fronts of others, at most, for it to be named.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: what stands free and is seen from behind is named
/// - Smaller: walls before a landscape are overlooked
pub(super) const FRONTS_BEFORE_MAX: f64 = 0.04;

/// Polygons that rays between air and objects are tried against in all.
///
/// - Unit: polygons
/// - Tried: not varied
/// - Larger: seconds
/// - Smaller: nothing is said of large scenes
pub(super) const AIR_TRIALS: usize = 100_000_000;

/// Reflectance from which on a material is reported: real paints stay below.
///
/// - Unit: 1
/// - Tried: not varied
/// - Larger: white that is a mistake passes
/// - Smaller: paints are named
pub(super) const REFLECTANCE_HIGH: f64 = 0.95;

/// Diagonals of a scene outside this range are likely a mistaken unit.
///
/// - Unit: m
/// - Tried: not varied
/// - Larger: mistaken units pass
/// - Smaller: landscapes and models are named
pub(super) const DIAGONAL_M: (f64, f64) = (1e-2, 1e3);

/// Exitance from which on a mistaken unit is likely: a glowing filament has about this.
///
/// - Unit: W/m2
/// - Tried: not varied
/// - Larger: mistaken units pass
/// - Smaller: lamps are named
pub(super) const EXITANCE_HIGH: f64 = 1e6;

/// Intensity of directional lights from which on a mistaken unit is likely: ten suns.
///
/// - Unit: W/m2
/// - Tried: not varied
/// - Larger: mistaken units pass
/// - Smaller: bright suns are named
pub(super) const SUN_HIGH: f64 = 1.4e4;

/// Distance of a scene's middle from the origin, over the scene's size, from which it is moved there when it is read.
///
/// - Unit: 1
/// - Tried: 8; left where it is, a room of 5 m is as at the origin at 600 times its size, and has lost 0.37 of its light at 600,000
/// - Larger: what is a share of the largest coordinate (one plane, one point) grows beside the scene
/// - Smaller: scenes are moved that need not be
pub(super) const FAR: f64 = 8.0;

/// Coordinates of 32-bit corners in their meshes, over the scene's size, from which it is said that they are coarse.
///
/// - Unit: 1
/// - Tried: 256, where they are 3e-5 of the scene apart
/// - Larger: gaps between walls that nobody was told of
/// - Smaller: warnings of what does not show
pub(super) const FAR_CORNERS: f64 = 256.0;

/// Exitance from which a patch is a lamp, over the mean exitance of all surfaces at the most of all time.
///
/// - Unit: 1
/// - Tried: 0, 4
/// - Larger: bright things among surfaces that glow light what is close to them unseen
/// - Smaller: time where everything glows: with 0 each pair of a model of 66,715 patches that all glow looked at thousands of lamps
pub(super) const LAMP_LEAST: f64 = 4.0;

/// Area that a lamp counts as where it lies in one plane with others, of which the smaller shows, over its own.
///
/// - Unit: 1
/// - Tried: 0.2; 1
/// - Larger: lamps in ceilings of tiles of their size are hidden
/// - Smaller: what lies on lamps is hidden
pub(super) const LAMP_AREA: f64 = 0.2;
