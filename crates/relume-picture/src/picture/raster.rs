//! Which primitive each sample of each pixel sees: a tiled z-buffer with many samples a pixel.
//!
//! Must not know what a primitive is a picture of. The result depends on the order of the
//! primitives and on nothing else: tiles are independent, and within a tile primitives are drawn
//! in order, the earlier one winning where two are equally near, up to rounding. So the bits are the same for
//! every number of threads.

use std::num::NonZeroU32;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Width and height of a tile, pixels: its samples fit the first-level cache.
const TILE: usize = 16;

/// Edges are moved outwards by this much, pixels, so that no sample falls between neighbours
/// whose common edge is rounded differently (T-vertices, single-precision input).
const OVERLAP: f64 = 1.0 / 1024.0;

/// What is nearer by less than this share is as near: rounding of what lies in one plane.
const AS_NEAR: f32 = 1.0 / 1_048_576.0;

/// Most samples a pixel: they fit the bits of a mask.
pub(crate) const SAMPLES_MAX: usize = 64;

/// Most corners of a primitive: a quadrilateral cut by the near plane.
const EDGES_MAX: usize = 5;

/// A convex polygon on the screen, with its nearness.
#[derive(Clone, Debug)]
pub(crate) struct Primitive {
    /// `(a, b, c)`: `a x + b y + c` is the distance inside the edge, pixels.
    edges: [DVec3; EDGES_MAX],
    edge_count: usize,
    /// First and one past the last pixel that it may touch.
    x_range: [usize; 2],
    y_range: [usize; 2],
    /// Larger is nearer; affine in the pixel.
    nearness: DVec3,
    nearness_range: [f32; 2],
}

/// Size of the picture and positions of the samples within a pixel.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Offsets from the pixel's centre, each coordinate in (-0.5, 0.5).
    offsets: Vec<DVec2>,
    mean_offset: DVec2,
}

/// The samples of one pixel that see the same primitive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment {
    /// Index of the primitive; `None` for the background.
    pub(crate) primitive: Option<usize>,
    /// Number of samples.
    pub(crate) samples: u32,
    /// Their mean position, pixels: within the primitive, as that is convex.
    pub(crate) position: DVec2,
}

impl Grid {
    /// A grid with `samples` (clamped to 1 ..= [`SAMPLES_MAX`]) a pixel, in the Hammersley pattern:
    /// no two in one column or row of the pixel, evenly spread.
    pub(crate) fn new(width: u32, height: u32, samples: u32) -> Grid {
        let n = samples.clamp(1, SAMPLES_MAX as u32);
        let offset = |i: u32| {
            let radical_inverse = f64::from(i.reverse_bits()) / 4_294_967_296.0;
            let along = (f64::from(i) + 0.5) / f64::from(n);
            DVec2::new(along - 0.5, radical_inverse + 0.5 / f64::from(n) - 0.5)
                .clamp(DVec2::splat(-0.499), DVec2::splat(0.499))
        };
        let offsets: Vec<DVec2> = (0..n).map(offset).collect();
        let mean_offset = offsets.iter().sum::<DVec2>() / f64::from(n);
        Grid { width: width as usize, height: height as usize, offsets, mean_offset }
    }

    /// Samples a pixel.
    pub(crate) fn samples(&self) -> u32 {
        self.offsets.len() as u32
    }
}

impl Primitive {
    /// A convex polygon with `corners` in pixels, of either winding, three to five.
    ///
    /// `None` if it has no area or lies outside the picture.
    pub(crate) fn new(grid: &Grid, corners: &[DVec2], nearness: DVec3) -> Option<Primitive> {
        let n = corners.len();
        debug_assert!(n <= EDGES_MAX, "a primitive has at most {EDGES_MAX} corners");
        let twice_area: f64 = (1..n.max(2) - 1)
            .map(|i| (corners[i] - corners[0]).perp_dot(corners[i + 1] - corners[0]))
            .sum();
        if !twice_area.is_finite() || twice_area == 0.0 {
            return None;
        }
        let mut edges = [DVec3::ZERO; EDGES_MAX];
        let mut edge_count = 0;
        for (i, &a) in corners.iter().enumerate() {
            let along = (corners[(i + 1) % n] - a) * twice_area.signum();
            if let Some(inward) = along.perp().try_normalize() {
                edges[edge_count] = inward.extend(OVERLAP - inward.dot(a));
                edge_count += 1;
            }
        }
        let (low, high) =
            corners.iter().fold((corners[0], corners[0]), |(l, h), &c| (l.min(c), h.max(c)));
        let range = |low: f64, high: f64, size: usize| {
            // Saturating casts: what lies left of or above the picture starts at its first pixel.
            [(low - OVERLAP) as usize, ((high + OVERLAP).ceil().max(0.0) as usize).min(size)]
        };
        let x_range = range(low.x, high.x, grid.width);
        let y_range = range(low.y, high.y, grid.height);
        if edge_count < 3 || x_range[0] >= x_range[1] || y_range[0] >= y_range[1] {
            return None;
        }
        let near = corners.iter().map(|c| nearness.dot(c.extend(1.0)) as f32);
        let nearness_range =
            near.fold([f32::INFINITY, f32::NEG_INFINITY], |[l, h], k| [l.min(k), h.max(k)]);
        Some(Primitive { edges, edge_count, x_range, y_range, nearness, nearness_range })
    }

    /// Brings it nearer by `share` of its greatest nearness, to be drawn over what it lies on.
    pub(crate) fn lift(mut self, share: f64) -> Primitive {
        let [low, high] = self.nearness_range;
        let lift = f64::from(low.abs().max(high.abs())) * share;
        self.nearness.z += lift;
        self.nearness_range = [low + lift as f32, high + lift as f32];
        self
    }
}

/// Draws the primitives and hands each pixel's fragments to `resolve`; row by row.
///
/// Fragments come in the order of their first sample; their sample counts add up to the grid's.
pub(crate) fn rasterise<T: Copy + Default + Send + Sync>(
    grid: &Grid,
    primitives: &[Primitive],
    resolve: impl Fn(&[Fragment]) -> T + Sync,
) -> Vec<T> {
    let (columns, rows) = (grid.width.div_ceil(TILE), grid.height.div_ceil(TILE));
    let bins = Bins::new(columns, rows, primitives);
    let tiles: Vec<[T; TILE * TILE]> = (0..columns * rows)
        .into_par_iter()
        .map(|tile| {
            let mut buffer =
                TileBuffer::new(grid, (tile % columns) * TILE, (tile / columns) * TILE);
            for &index in bins.of(tile) {
                buffer.draw(index, &primitives[index as usize]);
            }
            buffer.resolve(&resolve)
        })
        .collect();
    let mut pixels = Vec::with_capacity(grid.width * grid.height);
    for y in 0..grid.height {
        for (column, first) in (0..grid.width).step_by(TILE).enumerate() {
            let row = (y % TILE) * TILE;
            let count = TILE.min(grid.width - first);
            pixels.extend_from_slice(&tiles[(y / TILE) * columns + column][row..row + count]);
        }
    }
    pixels
}

/// For each tile the primitives whose bounds touch it, in order.
struct Bins {
    offsets: Vec<u32>,
    indices: Vec<u32>,
}

impl Bins {
    fn new(columns: usize, rows: usize, primitives: &[Primitive]) -> Bins {
        let tiles_of = |p: &Primitive| {
            let [x, y] = [p.x_range, p.y_range].map(|[a, b]| a / TILE..b.div_ceil(TILE));
            y.flat_map(move |row| x.clone().map(move |column| row * columns + column))
        };
        let mut offsets = vec![0_u32; columns * rows + 1];
        for primitive in primitives {
            tiles_of(primitive).for_each(|tile| offsets[tile + 1] += 1);
        }
        for tile in 0..columns * rows {
            offsets[tile + 1] += offsets[tile];
        }
        let mut next = offsets.clone();
        let mut indices = vec![0; offsets[columns * rows] as usize];
        for (index, primitive) in primitives.iter().enumerate() {
            for tile in tiles_of(primitive) {
                indices[next[tile] as usize] = index as u32;
                next[tile] += 1;
            }
        }
        Bins { offsets, indices }
    }

    fn of(&self, tile: usize) -> &[u32] {
        &self.indices[self.offsets[tile] as usize..self.offsets[tile + 1] as usize]
    }
}

/// The samples of one tile.
struct TileBuffer<'a> {
    grid: &'a Grid,
    x: usize,
    y: usize,
    nearness: Vec<f32>,
    /// Index of the primitive seen, plus one.
    seen: Vec<Option<NonZeroU32>>,
}

impl<'a> TileBuffer<'a> {
    fn new(grid: &'a Grid, x: usize, y: usize) -> Self {
        let count = TILE * TILE * grid.offsets.len();
        TileBuffer { grid, x, y, nearness: vec![f32::MIN / 2.0; count], seen: vec![None; count] }
    }

    fn draw(&mut self, index: u32, p: &Primitive) {
        let samples = self.grid.offsets.len();
        let mut steps = [0_f32; SAMPLES_MAX];
        for (step, offset) in steps.iter_mut().zip(&self.grid.offsets) {
            *step = p.nearness.truncate().dot(*offset) as f32;
        }
        let [low, high] = p.nearness_range;
        let seen = NonZeroU32::new(index + 1);
        let within = |[a, b]: [usize; 2], start: usize| a.max(start)..b.min(start + TILE);
        for y in within(p.y_range, self.y) {
            for x in within(p.x_range, self.x) {
                let centre = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 1.0);
                let mask = self.coverage(p, centre);
                if mask == 0 {
                    continue;
                }
                let nearness = p.nearness.dot(centre) as f32;
                let first = ((y - self.y) * TILE + x - self.x) * samples;
                let pixel = first..first + samples;
                let slots = self.nearness[pixel.clone()].iter_mut().zip(&mut self.seen[pixel]);
                // Without branches, so that it is done for several samples at a time.
                for (s, ((slot, slot_seen), step)) in slots.zip(&steps).enumerate() {
                    let k = (nearness + step).max(low).min(high);
                    let wins = (mask >> s & 1 == 1) & (k > *slot + slot.abs() * AS_NEAR);
                    *slot = if wins { k } else { *slot };
                    *slot_seen = if wins { seen } else { *slot_seen };
                }
            }
        }
    }

    /// Bit mask of the samples of the pixel around `centre` that lie in the polygon.
    fn coverage(&self, p: &Primitive, centre: DVec3) -> u64 {
        let mut mask = u64::MAX >> (SAMPLES_MAX - self.grid.offsets.len());
        for edge in &p.edges[..p.edge_count] {
            let inside = edge.dot(centre);
            let reach = (edge.x.abs() + edge.y.abs()) / 2.0;
            if inside < -reach {
                return 0;
            }
            if inside < reach {
                for (s, offset) in self.grid.offsets.iter().enumerate() {
                    let outside = inside + edge.truncate().dot(*offset) < 0.0;
                    mask &= !(u64::from(outside) << s);
                }
            }
        }
        mask
    }

    fn resolve<T: Copy + Default>(&self, resolve: impl Fn(&[Fragment]) -> T) -> [T; TILE * TILE] {
        let samples = self.grid.offsets.len();
        let mut fragments = Vec::with_capacity(samples);
        let mut pixels = [T::default(); TILE * TILE];
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let (x, y) = (self.x + i % TILE, self.y + i / TILE);
            if x < self.grid.width && y < self.grid.height {
                let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                self.group(&self.seen[i * samples..(i + 1) * samples], centre, &mut fragments);
                *pixel = resolve(&fragments);
            }
        }
        pixels
    }

    /// Groups the samples of one pixel by what they see.
    fn group(&self, seen: &[Option<NonZeroU32>], centre: DVec2, fragments: &mut Vec<Fragment>) {
        fragments.clear();
        let primitive = |seen: Option<NonZeroU32>| seen.map(|index| index.get() as usize - 1);
        let samples = self.grid.samples();
        if seen.iter().all(|&s| s == seen[0]) {
            let position = centre + self.grid.mean_offset;
            fragments.push(Fragment { primitive: primitive(seen[0]), samples, position });
            return;
        }
        let mut left = u64::MAX >> (SAMPLES_MAX - seen.len());
        while left != 0 {
            let first = seen[left.trailing_zeros() as usize];
            let (mut sum, mut samples) = (DVec2::ZERO, 0);
            for (s, offset) in self.grid.offsets.iter().enumerate() {
                if seen[s] == first {
                    left &= !(1 << s);
                    sum += *offset;
                    samples += 1;
                }
            }
            fragments.push(Fragment {
                primitive: primitive(first),
                samples,
                position: centre + sum / f64::from(samples),
            });
        }
    }
}
