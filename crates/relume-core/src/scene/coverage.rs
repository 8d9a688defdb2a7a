//! Integrals of an image over polygons of texture coordinates, by exact coverage.
//!
//! Whole blocks count with their means, what lies on an edge is clipped, down to the single texel. The image is taken
//! as constant within a texel. Must not know what the image is of.

use glam::DVec2;

use super::pyramid::{BLOCK, Pyramid, Sums};

/// What texture coordinates beyond the image mean, along one axis (glTF 2.0, sampler.wrapS).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    Repeat,
    /// The image again, every second one mirrored.
    MirroredRepeat,
    /// The texels at the edge.
    ClampToEdge,
}

/// Periods of an image that are told apart at most along an axis: beyond, everything counts as the mean.
const PERIODS_MAX: f64 = 1_048_576.0;

/// Texels from which on nothing is told apart.
const FAR: f64 = 1e15;

/// Strips into which what lies beyond a clamped edge is cut.
const STRIPS: f64 = 1024.0;

/// Texture coordinates that span less than this share of the square of their extent are a line, and less than that
/// many texels a point.
const FLAT: f64 = 1e-7;
const POINT: f64 = 1e-4;

/// An image under texture coordinates.
pub struct Cover<'a> {
    /// The image.
    pub pyramid: &'a Pyramid,
    /// What texture coordinates beyond it mean, along its width and height.
    pub wrap: [Wrap; 2],
    /// Blocks smaller than the extent of a polygon by this factor are not cut any further: they count with their
    /// mean, in proportion to what the polygon covers of them, so that sums over polygons that tile stay exact.
    pub resolution: f64,
}

impl Cover<'_> {
    /// The mean over a triangle of texture coordinates; where they lie on a line or in a point, over what the
    /// triangle has of it (up to 4096 points, nearest texels). Exact up to rounding where the triangle is less than
    /// `resolution` texels across.
    pub fn mean(&self, triangle: [DVec2; 3]) -> Sums {
        let corners = triangle.map(|p| self.texels(p));
        let piece = Piece::of(&corners);
        let extent = piece.extent();
        if extent > FAR {
            return self.pyramid.mean();
        }
        if extent < POINT || piece.area() < FLAT * extent * extent {
            return self.sampled(corners, extent);
        }
        let (area, sums) = self.over(piece);
        sums.map(|s| s / area)
    }

    /// Area in texels and integral over a convex polygon of texture coordinates that has an area.
    pub fn integral(&self, polygon: &[DVec2]) -> (f64, Sums) {
        let corners: Vec<DVec2> = polygon.iter().map(|&p| self.texels(p)).collect();
        let mut all = (0.0, [0.0; 5]);
        for k in 1..corners.len().max(1) - 1 {
            let (area, sums) = self.over(Piece::of(&[corners[0], corners[k], corners[k + 1]]));
            all.0 += area;
            (0..5).for_each(|c| all.1[c] += sums[c]);
        }
        all
    }

    fn texels(&self, p: DVec2) -> DVec2 {
        p * DVec2::new(self.pyramid.size[0] as f64, self.pyramid.size[1] as f64)
    }

    fn sampled(&self, corners: [DVec2; 3], extent: f64) -> Sums {
        let n = (extent.ceil() as usize).clamp(1, 64);
        let mut sums = [0.0; 5];
        for_each_third(n, |weights| {
            let p = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
            let value = self.nearest(p);
            (0..5).for_each(|c| sums[c] += value[c]);
        });
        sums.map(|s| s / (n * n) as f64)
    }

    fn nearest(&self, p: DVec2) -> Sums {
        let at = |axis: usize| {
            let (n, x) = (self.pyramid.size[axis] as i64, p[axis].floor() as i64);
            let x = match self.wrap[axis] {
                Wrap::Repeat => x.rem_euclid(n),
                Wrap::ClampToEdge => x.clamp(0, n - 1),
                Wrap::MirroredRepeat => {
                    let x = x.rem_euclid(2 * n);
                    x.min(2 * n - 1 - x)
                }
            };
            x as usize
        };
        self.pyramid.texel(at(0), at(1))
    }

    /// Area and integral over a triangle in texels.
    fn over(&self, piece: Piece) -> (f64, Sums) {
        let size = self.pyramid.size.map(|n| n as f64);
        let finest = (piece.extent() / self.resolution).max(1.0);
        let mut walk = Walk { cover: self, finest, area: 0.0, sums: [0.0; 5] };
        let (low, high) = piece.bounds();
        let periods =
            [0, 1].map(|k| (high[k] / size[k]).floor() - (low[k] / size[k]).floor() + 1.0);
        let far = [low, high].iter().any(|p| p.abs().max_element() > FAR);
        if far || periods[0].max(periods[1]) > PERIODS_MAX {
            walk.add(self.pyramid.mean(), piece.area());
            return (walk.area, walk.sums);
        }
        let inside = walk.clamped(piece);
        let first = [0, 1].map(|k| (low[k] / size[k]).floor() as i64);
        let side = (periods[0].max(periods[1]) as u64).next_power_of_two() as i64;
        walk.periods(inside, first, side);
        (walk.area, walk.sums)
    }
}

/// Barycentric weights of the middles of the n x n triangles that a triangle is cut into.
pub fn for_each_third(n: usize, mut each: impl FnMut([f64; 3])) {
    let third = 1.0 / (3.0 * n as f64);
    for i in 0..n {
        for j in 0..n - i {
            let (a, b) = ((3 * i + 1) as f64 * third, (3 * j + 1) as f64 * third);
            each([1.0 - a - b, a, b]);
            if i + j + 1 < n {
                let (a, b) = ((3 * i + 2) as f64 * third, (3 * j + 2) as f64 * third);
                each([1.0 - a - b, a, b]);
            }
        }
    }
}

/// What has been summed on a walk over blocks.
struct Walk<'a> {
    cover: &'a Cover<'a>,
    finest: f64,
    area: f64,
    sums: Sums,
}

/// Share of a block's area that counts as all of it.
const WHOLE: f64 = 1.0 - 1e-9;

impl Walk<'_> {
    fn add(&mut self, value: Sums, area: f64) {
        self.area += area;
        (0..5).for_each(|c| self.sums[c] += value[c] * area);
    }

    /// Sums what lies beyond clamped edges; what is left is inside along those axes.
    fn clamped(&mut self, piece: Piece) -> Piece {
        let mut inside = piece;
        for axis in 0..2 {
            if self.cover.wrap[axis] == Wrap::ClampToEdge {
                let end = self.cover.pyramid.size[axis] as f64;
                self.beyond(inside.below(axis, 0.0), axis, 0.5);
                self.beyond(inside.above(axis, end), axis, end - 0.5);
                inside = inside.above(axis, 0.0).below(axis, end);
            }
        }
        inside
    }

    /// Sums a piece that lies beyond an edge: strips, of whole texels where they are not too many, of what the edge shows.
    fn beyond(&mut self, piece: Piece, axis: usize, edge: f64) {
        let other = 1 - axis;
        if piece.n < 3 {
            return;
        }
        let (low, high) = piece.bounds();
        let (mut low, mut high) = (low[other].floor(), high[other].ceil());
        if self.cover.wrap[other] == Wrap::ClampToEdge {
            let end = self.cover.pyramid.size[other] as f64;
            (low, high) = (low.clamp(0.0, end), high.clamp(0.0, end));
        }
        let step = ((high - low) / STRIPS).ceil().max(1.0);
        let shown = |x: f64| if other == 0 { DVec2::new(x, edge) } else { DVec2::new(edge, x) };
        let (mut at, mut rest) = (low, piece.above(other, low));
        self.add(self.cover.nearest(shown(low - 0.5)), piece.below(other, low).area());
        while at < high {
            let strip = rest.below(other, at + step);
            self.add(self.cover.nearest(shown(at + 0.5 * step)), strip.area());
            at += step;
            rest = rest.above(other, at);
        }
        self.add(self.cover.nearest(shown(high + 0.5)), rest.area());
    }

    /// A piece within `side` x `side` periods of the image from `first` on.
    fn periods(&mut self, piece: Piece, first: [i64; 2], side: i64) {
        let area = piece.area();
        let size = self.cover.pyramid.size.map(|n| n as f64);
        let far = side as f64 * size[0].max(size[1]) <= self.finest;
        if area <= 0.0 {
            return;
        }
        if far || area >= WHOLE * (side * side) as f64 * size[0] * size[1] {
            return self.add(self.cover.pyramid.mean(), area);
        }
        if side == 1 {
            let top = self.cover.pyramid.top();
            return self.block(self.in_image(piece, first), top, [0, 0]);
        }
        let half = side / 2;
        let middle = [0, 1].map(|k| (first[k] + half) as f64 * size[k]);
        for (row, y) in [(piece.below(1, middle[1]), 0), (piece.above(1, middle[1]), half)] {
            self.periods(row.below(0, middle[0]), [first[0], first[1] + y], half);
            self.periods(row.above(0, middle[0]), [first[0] + half, first[1] + y], half);
        }
    }

    /// The piece in the coordinates of the image whose period it lies in.
    fn in_image(&self, piece: Piece, period: [i64; 2]) -> Piece {
        let mut moved = piece;
        for axis in 0..2 {
            let size = self.cover.pyramid.size[axis] as f64;
            let turned =
                self.cover.wrap[axis] == Wrap::MirroredRepeat && period[axis].rem_euclid(2) == 1;
            for p in &mut moved.corners[..piece.n] {
                let x = p[axis] - period[axis] as f64 * size;
                p[axis] = if turned { size - x } else { x };
            }
        }
        moved
    }

    /// A piece within a block of the image.
    fn block(&mut self, piece: Piece, level: usize, at: [usize; 2]) {
        let area = piece.area();
        if area <= 0.0 {
            return;
        }
        let pyramid = self.cover.pyramid;
        let side = BLOCK << level;
        let spans = [0, 1].map(|k| pyramid.size[k].min((at[k] + 1) * side) - at[k] * side);
        if side as f64 <= self.finest || area >= WHOLE * (spans[0] * spans[1]) as f64 {
            return self.add(pyramid.block(level, at[0], at[1]), area);
        }
        if level == 0 {
            return self.texels(piece, at.map(|k| k * BLOCK), spans);
        }
        let middle = [0, 1].map(|k| ((2 * at[k] + 1) * side / 2) as f64);
        let there = pyramid.blocks(level - 1);
        for (b, row) in [piece.below(1, middle[1]), piece.above(1, middle[1])].iter().enumerate() {
            for (a, part) in [row.below(0, middle[0]), row.above(0, middle[0])].iter().enumerate() {
                let at = [2 * at[0] + a, 2 * at[1] + b];
                if at[0] < there[0] && at[1] < there[1] {
                    self.block(*part, level - 1, at);
                }
            }
        }
    }

    /// A piece within a few texels.
    fn texels(&mut self, piece: Piece, first: [usize; 2], spans: [usize; 2]) {
        let mut rest = piece;
        for y in first[1]..first[1] + spans[1] {
            let end = (y + 1) as f64;
            let mut row = rest.below(1, end);
            for x in first[0]..first[0] + spans[0] {
                let area = row.below(0, (x + 1) as f64).area();
                if area > 0.0 {
                    self.add(self.cover.pyramid.texel(x, y), area);
                }
                row = row.above(0, (x + 1) as f64);
            }
            rest = rest.above(1, end);
        }
    }
}

/// A convex polygon: a triangle within a box has seven corners at most; one more for rounding.
#[derive(Clone, Copy)]
struct Piece {
    n: usize,
    corners: [DVec2; 8],
}

impl Piece {
    fn of(corners: &[DVec2; 3]) -> Piece {
        let mut piece = Piece { n: 3, corners: [DVec2::ZERO; 8] };
        piece.corners[..3].copy_from_slice(corners);
        piece
    }

    fn area(&self) -> f64 {
        let c = &self.corners[..self.n];
        let fan = (2..self.n).map(|k| (c[k - 1] - c[0]).perp_dot(c[k] - c[0]));
        0.5 * fan.sum::<f64>().abs()
    }

    fn bounds(&self) -> (DVec2, DVec2) {
        let all = self.corners[..self.n].iter();
        all.fold((DVec2::MAX, DVec2::MIN), |(low, high), &p| (low.min(p), high.max(p)))
    }

    fn extent(&self) -> f64 {
        let (low, high) = self.bounds();
        if self.corners[..self.n].iter().all(|p| p.is_finite()) {
            (high - low).max_element()
        } else {
            f64::INFINITY
        }
    }

    fn below(&self, axis: usize, at: f64) -> Piece {
        self.cut(|p| at - p[axis])
    }

    fn above(&self, axis: usize, at: f64) -> Piece {
        self.cut(|p| p[axis] - at)
    }

    /// Where `inside` is not negative (Sutherland and Hodgman 1974).
    fn cut(&self, inside: impl Fn(DVec2) -> f64) -> Piece {
        let mut out = Piece { n: 0, corners: [DVec2::ZERO; 8] };
        let mut push = |p: DVec2| {
            if out.n < out.corners.len() {
                out.corners[out.n] = p;
                out.n += 1;
            }
        };
        for k in 0..self.n {
            let (p, q) = (self.corners[k], self.corners[(k + 1) % self.n]);
            let (a, b) = (inside(p), inside(q));
            if a >= 0.0 {
                push(p);
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                push(p + (q - p) * (a / (a - b)));
            }
        }
        out
    }
}

#[cfg(test)]
mod tests;
