//! Few colours for pictures in motion.

use std::collections::BTreeSet;

use crate::picture::Image;

/// Most colours: the last number is that of a pixel that stays as it was.
const COLOURS_MAX: usize = 255;

/// Colours that all pixels of some pictures are near to.
pub(super) struct Palette {
    colours: Vec<[u8; 3]>,
    bits: u32,
}

impl Palette {
    /// The colours of the pictures, in as many bits a channel as leave no more than 255 of them.
    /// Black and white stay what they are.
    pub(super) fn of(pictures: &[Image]) -> Palette {
        let colours_at = |bits: u32| -> BTreeSet<[u8; 3]> {
            let all = pictures.iter().flat_map(|picture| &picture.pixels);
            all.map(|&pixel| rounded(pixel, bits)).collect()
        };
        // One bit a channel makes eight colours.
        let bits = (1..=8).rev().find(|&bits| colours_at(bits).len() <= COLOURS_MAX);
        let bits = bits.unwrap_or(1);
        Palette { colours: colours_at(bits).into_iter().collect(), bits }
    }

    /// Its colours as an encoder wants them.
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.colours.as_flattened().to_vec()
    }

    /// How many there are: also the number of a pixel that stays as it was.
    pub(super) fn len(&self) -> u8 {
        self.colours.len() as u8
    }

    /// The number of a pixel's colour.
    pub(super) fn number(&self, pixel: [u8; 3]) -> u8 {
        let colour = rounded(pixel, self.bits);
        self.colours.binary_search(&colour).expect("it is one of them") as u8
    }
}

/// The nearest colour of so many bits a channel.
fn rounded(pixel: [u8; 3], bits: u32) -> [u8; 3] {
    let most = f32::from((1_u16 << bits) - 1);
    pixel.map(|v| ((f32::from(v) / 255.0 * most).round() / most * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_are_kept_and_many_are_rounded() {
        let image = |pixels: Vec<[u8; 3]>| Image { width: pixels.len() as u32, height: 1, pixels };
        let few = Palette::of(&[image(vec![[1, 2, 3], [255; 3], [1, 2, 3]])]);
        assert_eq!((few.bytes(), few.len()), (vec![1, 2, 3, 255, 255, 255], 2));
        assert_eq!(few.number([255; 3]), 1);
        let ramp = image((0..=255).flat_map(|v| [[v, 0, 0], [0, v, 0], [v; 3]]).collect());
        let many = Palette::of(std::slice::from_ref(&ramp));
        assert!((32..=255).contains(&many.len()));
        for pixel in ramp.pixels {
            let near = many.colours[usize::from(many.number(pixel))];
            assert!(near.iter().zip(pixel).all(|(a, b)| a.abs_diff(b) <= 8), "{pixel:?} {near:?}");
        }
    }
}
