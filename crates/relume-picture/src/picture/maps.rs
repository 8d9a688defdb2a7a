//! Colour maps: numbers in [0, 1] to colours, and pictures of numbers.
//!
//! Must not know what the numbers are.

use super::image::Image;

/// A colour map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourMap {
    /// From dark violet over green to yellow, evenly for the eye, also in grey and for the colour-blind (van der Walt and Smith 2015).
    #[default]
    Viridis,
    /// From blue over green to red: more steps can be told apart (Mikhailov 2019).
    Turbo,
    /// From black to white.
    Grey,
}

/// Colours at equal steps from 0 to 1, sRGB.
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 74, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [109, 205, 89],
    [253, 231, 37],
];
const TURBO: [[u8; 3]; 9] = [
    [48, 18, 59],
    [70, 107, 227],
    [40, 187, 236],
    [49, 242, 153],
    [162, 252, 60],
    [237, 208, 58],
    [251, 128, 34],
    [210, 49, 5],
    [122, 4, 3],
];

impl ColourMap {
    /// The colour of a number, sRGB; below 0 and above 1 that of the end.
    pub fn colour(self, share: f64) -> [u8; 3] {
        let share = share.clamp(0.0, 1.0);
        let of = |colours: &[[u8; 3]; 9]| {
            let at = share * 8.0;
            let k = (at as usize).min(7);
            let t = at - k as f64;
            [0, 1, 2].map(|c| {
                let (low, high) = (f64::from(colours[k][c]), f64::from(colours[k + 1][c]));
                (low + (high - low) * t).round() as u8
            })
        };
        match self {
            ColourMap::Viridis => of(&VIRIDIS),
            ColourMap::Turbo => of(&TURBO),
            ColourMap::Grey => [(255.0 * share).round() as u8; 3],
        }
    }
}

/// How numbers become colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The colours.
    pub map: ColourMap,
    /// Number that has the first colour, and all below.
    pub low: f64,
    /// Number that has the last colour, and all above.
    pub high: f64,
    /// Parts that lines of equal numbers divide the scale into; 0: none.
    pub lines: u32,
}

impl Scale {
    /// Where a number is on the scale: 0 at its low end, 1 at its high end.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// A picture of numbers; what has none is `background`.
    pub fn picture(&self, numbers: &Numbers, background: [u8; 3]) -> Image {
        let Numbers { width, height, values } = numbers;
        let colour = |k: usize| match values[k] {
            None => background,
            Some(_) if self.is_line(numbers, k) => [0; 3],
            Some(value) => self.map.colour(self.share(f64::from(value))),
        };
        Image { width: *width, height: *height, pixels: (0..values.len()).map(colour).collect() }
    }

    /// Whether a line of equal numbers runs between a pixel and the one after or below it.
    fn is_line(&self, numbers: &Numbers, k: usize) -> bool {
        if self.lines == 0 {
            return false;
        }
        let part = |value: f32| {
            let last = f64::from(self.lines - 1);
            (self.share(f64::from(value)) * f64::from(self.lines)).floor().clamp(0.0, last)
        };
        let width = numbers.width as usize;
        let right = (!(k + 1).is_multiple_of(width)).then_some(k + 1);
        let own = numbers.values[k].map(part);
        let differs = |other: usize| {
            let other = numbers.values.get(other).copied().flatten().map(part);
            other.is_some() && other != own
        };
        right.is_some_and(differs) || differs(k + width)
    }
}

/// A number for each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row from the top left; `None` where there is nothing.
    pub values: Vec<Option<f32>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_begin_and_end_where_they_should_and_get_lighter_where_they_claim_to() {
        assert_eq!(ColourMap::Viridis.colour(-1.0), [68, 1, 84]);
        assert_eq!(ColourMap::Viridis.colour(2.0), [253, 231, 37]);
        assert_eq!(ColourMap::Turbo.colour(0.0), [48, 18, 59]);
        assert_eq!(ColourMap::Grey.colour(0.5), [128; 3]);
        let light = |map: ColourMap, k: u32| {
            let [r, g, b] = map.colour(f64::from(k) / 64.0).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for map in [ColourMap::Viridis, ColourMap::Grey] {
            assert!((0..64).all(|k| light(map, k + 1) > light(map, k)), "{map:?}");
        }
    }

    #[test]
    fn lines_run_where_numbers_pass_a_part_and_not_along_the_edge_of_nothing() {
        let values =
            vec![Some(0.1), Some(0.4), Some(0.6), None, Some(0.2), Some(0.3), Some(0.9), Some(5.0)];
        let numbers = Numbers { width: 4, height: 2, values };
        let scale = Scale { map: ColourMap::Grey, low: 0.0, high: 1.0, lines: 2 };
        let picture = scale.picture(&numbers, [7; 3]);
        let black: Vec<bool> = picture.pixels.iter().map(|&p| p == [0; 3]).collect();
        assert_eq!(black, [false, true, false, false, false, true, false, false]);
        assert_eq!(picture.pixels[3], [7; 3]);
        assert_eq!(picture.pixels[7], [255; 3]);
    }
}
