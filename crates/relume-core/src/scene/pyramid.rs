//! An image with the means of its blocks, for means over any part of it.
//!
//! Must not know files, materials or texture coordinates.

/// What is summed over an image: red, green and blue in linear light, how much of it is there, and the square of the
/// mean of the three colours; all of texels that are there.
pub type Sums = [f64; 5];

/// Texels along a side of the smallest blocks whose means are kept.
pub const BLOCK: usize = 4;

/// Bytes that each pixel of an image needs while it is kept; its means need less than what it was decoded to.
pub const BYTES_A_PIXEL: u64 = 4;

/// Texels of an image, and means of square blocks of 4, 8, 16 ... of them up to the whole.
#[derive(Debug)]
pub struct Pyramid {
    /// Width and height, texels.
    pub size: [usize; 2],
    /// Rows from the top: sRGB colour and alpha, four bytes a texel.
    texels: Vec<u8>,
    /// Texels of less alpha are not there.
    least_alpha: u16,
    linear: Vec<f64>,
    levels: Vec<Level>,
}

/// Means of the blocks of one size; those along the right and lower edges are what is left of blocks.
#[derive(Debug)]
struct Level {
    size: [usize; 2],
    means: Vec<[f32; 5]>,
}

impl Pyramid {
    /// `None` for an image without pixels. `rgba` holds `size[0]` x `size[1]` texels by rows.
    pub fn new(size: [usize; 2], texels: Vec<u8>, least_alpha: u16) -> Option<Pyramid> {
        if texels.is_empty() || texels.len() != 4 * size[0] * size[1] {
            return None;
        }
        let linear = (0..256).map(linear).collect();
        let mut pyramid = Pyramid { size, texels, least_alpha, linear, levels: Vec::new() };
        loop {
            let level = pyramid.next_level();
            let is_top = level.size == [1, 1];
            pyramid.levels.push(level);
            if is_top {
                return Some(pyramid);
            }
        }
    }

    /// Blocks twice as large as those of the last level.
    fn next_level(&self) -> Level {
        let number = self.levels.len();
        let side = BLOCK << number;
        let size = self.size.map(|n| n.div_ceil(side));
        let mut means = Vec::with_capacity(size[0] * size[1]);
        for j in 0..size[1] {
            for i in 0..size[0] {
                let mut sum = [0.0; 5];
                self.for_each_part(number, i, j, |value, texels| {
                    (0..5).for_each(|c| sum[c] += value[c] * texels);
                });
                let texels = self.texels_of(number, i, j);
                means.push(sum.map(|s| (s / texels) as f32));
            }
        }
        Level { size, means }
    }

    /// What a block is made of, with the number of texels of each: blocks of the level below, or texels.
    fn for_each_part(&self, level: usize, i: usize, j: usize, mut each: impl FnMut(Sums, f64)) {
        if level == 0 {
            for y in BLOCK * j..self.size[1].min(BLOCK * (j + 1)) {
                for x in BLOCK * i..self.size[0].min(BLOCK * (i + 1)) {
                    each(self.texel(x, y), 1.0);
                }
            }
            return;
        }
        let below = self.levels[level - 1].size;
        for b in 2 * j..below[1].min(2 * j + 2) {
            for a in 2 * i..below[0].min(2 * i + 2) {
                each(self.block(level - 1, a, b), self.texels_of(level - 1, a, b));
            }
        }
    }

    fn texels_of(&self, level: usize, i: usize, j: usize) -> f64 {
        let side = BLOCK << level;
        let of = |k: usize, axis: usize| (self.size[axis].min((k + 1) * side) - k * side) as f64;
        of(i, 0) * of(j, 1)
    }

    /// One texel.
    pub fn texel(&self, x: usize, y: usize) -> Sums {
        let at = 4 * (y * self.size[0] + x);
        let texel = &self.texels[at..at + 4];
        let (r, g, b, alpha) = (texel[0], texel[1], texel[2], texel[3]);
        if u16::from(alpha) < self.least_alpha {
            return [0.0; 5];
        }
        let [r, g, b] = [r, g, b].map(|v| self.linear[usize::from(v)]);
        let mean = (r + g + b) / 3.0;
        [r, g, b, 1.0, mean * mean]
    }

    /// The mean over a block of [`BLOCK`] x 2^level texels a side.
    pub fn block(&self, level: usize, i: usize, j: usize) -> Sums {
        let level = &self.levels[level];
        level.means[j * level.size[0] + i].map(f64::from)
    }

    /// The number of the last level, whose one block is the whole image.
    pub fn top(&self) -> usize {
        self.levels.len() - 1
    }

    /// How many blocks a level has along each axis.
    pub fn blocks(&self, level: usize) -> [usize; 2] {
        self.levels[level].size
    }

    /// The mean over the whole image.
    pub fn mean(&self) -> Sums {
        self.block(self.top(), 0, 0)
    }

    /// Bytes that it holds, about.
    pub fn bytes(&self) -> usize {
        self.texels.len() * 3 / 2
    }
}

/// Linear value of an 8-bit sRGB one (IEC 61966-2-1). `libm`, so that it is the same on every machine.
fn linear(value: u32) -> f64 {
    let c = f64::from(value) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_taken_in_linear_light() {
        let pyramid = Pyramid::new([2, 1], vec![0, 128, 255, 255, 255, 128, 255, 255], 0).unwrap();
        let mean = pyramid.mean();
        let right = [0.5, 0.215_860_500, 1.0, 1.0];
        (0..4).for_each(|c| assert!((mean[c] - right[c]).abs() < 1e-7, "{mean:?}"));
        assert!(Pyramid::new([0, 0], Vec::new(), 0).is_none());
    }

    #[test]
    fn blocks_at_ragged_edges_count_by_their_texels() {
        let size = [13, 7];
        let rgba: Vec<u8> = (0..13 * 7).flat_map(|k| [(k * 37 % 256) as u8, 0, 9, 200]).collect();
        let pyramid = Pyramid::new(size, rgba, 0).unwrap();
        let texels = (0..7).flat_map(|y| (0..13).map(move |x| (x, y)));
        let sum: f64 = texels.map(|(x, y)| pyramid.texel(x, y)[0]).sum();
        assert!((pyramid.mean()[0] - sum / 91.0).abs() < 1e-7);
        assert_eq!(pyramid.blocks(0), [4, 2]);
    }

    #[test]
    fn texels_below_the_least_alpha_are_not_there() {
        let pyramid = Pyramid::new([2, 1], vec![255, 255, 255, 127, 255, 0, 0, 128], 128).unwrap();
        assert_eq!(pyramid.mean()[..4], [0.5, 0.0, 0.0, 0.5]);
    }
}
