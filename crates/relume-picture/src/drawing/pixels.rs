//! A drawing as pixels, and pictures in turn as an animated PNG.

use crate::picture::Image;

use super::palette::Palette;
use super::{Colour, Drawing, Shape};

impl Drawing {
    /// The drawing as a picture, each of its pixels `scale` by `scale` pixels there.
    pub fn to_image(&self, scale: u32) -> Image {
        let (width, height) = (self.width * scale, self.height * scale);
        let mut canvas = Canvas {
            width: width as usize,
            height: height as usize,
            pixels: vec![[255.0; 3]; (width * height) as usize],
        };
        let s = f64::from(scale);
        let at = |p: [f64; 2]| [p[0] * s, p[1] * s];
        for shape in &self.shapes {
            match shape.clone() {
                Shape::Picture { at, image } => canvas.picture(at, &image, scale),
                Shape::Stroke { from, to, width, colour, opacity } => {
                    canvas.stroke(at(from), at(to), 0.5 * width * s, (colour, opacity));
                }
                Shape::Disc { centre, radius, colour } => {
                    canvas.stroke(at(centre), at(centre), radius * s, (colour, 1.0));
                }
            }
        }
        let pixels = canvas.pixels.iter().map(|p| p.map(|v| v.round() as u8)).collect();
        Image { width, height, pixels }
    }
}

struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

impl Canvas {
    /// Each pixel of a picture as a square.
    fn picture(&mut self, at: [u32; 2], image: &Image, scale: u32) {
        for y in 0..image.height * scale {
            for x in 0..image.width * scale {
                let (column, row) = ((at[0] * scale + x) as usize, (at[1] * scale + y) as usize);
                if column < self.width && row < self.height {
                    let pixel = image.pixel(x / scale, y / scale);
                    self.pixels[row * self.width + column] = pixel.map(f32::from);
                }
            }
        }
    }

    /// Covers what is within `half` pixels of a line; the edge is softened over one pixel.
    fn stroke(&mut self, from: [f64; 2], to: [f64; 2], half: f64, (colour, ink): (Colour, f64)) {
        let reach = half + 1.0;
        let span = |k: usize, len: usize| {
            let lo = (from[k].min(to[k]) - reach).floor().max(0.0) as usize;
            let hi = (from[k].max(to[k]) + reach).ceil().max(0.0) as usize;
            lo..hi.min(len)
        };
        let along = [to[0] - from[0], to[1] - from[1]];
        let square = along[0] * along[0] + along[1] * along[1];
        for y in span(1, self.height) {
            for x in span(0, self.width) {
                let d = [x as f64 + 0.5 - from[0], y as f64 + 0.5 - from[1]];
                let share = if square > 0.0 {
                    ((d[0] * along[0] + d[1] * along[1]) / square).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let off = [d[0] - along[0] * share, d[1] - along[1] * share];
                let distance = (off[0] * off[0] + off[1] * off[1]).sqrt();
                // A stroke thinner than a pixel is fainter.
                let thin = (2.0 * half).min(1.0);
                let cover = (half.max(0.5) + 0.5 - distance).clamp(0.0, 1.0) * ink * thin;
                if cover > 0.0 {
                    let pixel = &mut self.pixels[y * self.width + x];
                    for c in 0..3 {
                        pixel[c] += (f32::from(colour[c]) - pixel[c]) * cover as f32;
                    }
                }
            }
        }
    }
}

/// Pictures of one size in turn, without end, as an animated PNG (what does not know of animation shows
/// the first), in at most 255 colours. Only pixels that change are stored.
///
/// # Errors
/// What the encoder says; none for pictures of one size.
pub fn animation(pictures: &[Image], milliseconds: u16) -> Result<Vec<u8>, String> {
    let text = |error: png::EncodingError| error.to_string();
    let first = pictures.first().ok_or("no pictures")?;
    let palette = Palette::of(pictures);
    let mut opaque = vec![255; usize::from(palette.len())];
    // The last number is of no colour.
    opaque.push(0);
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, first.width, first.height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette([palette.bytes(), vec![0; 3]].concat());
    encoder.set_trns(opaque);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_animated(pictures.len() as u32, 0).map_err(text)?;
    encoder.set_frame_delay(milliseconds, 1000).map_err(text)?;
    encoder.set_blend_op(png::BlendOp::Over).map_err(text)?;
    encoder.set_dispose_op(png::DisposeOp::None).map_err(text)?;
    let mut writer = encoder.write_header().map_err(text)?;
    let mut shown: Vec<u8> = Vec::new();
    for picture in pictures {
        let numbers: Vec<u8> = picture.pixels.iter().map(|&pixel| palette.number(pixel)).collect();
        let changed = |(k, &number): (usize, &u8)| match shown.get(k) == Some(&number) {
            true => palette.len(),
            false => number,
        };
        let data: Vec<u8> = numbers.iter().enumerate().map(changed).collect();
        writer.write_image_data(&data).map_err(text)?;
        shown = numbers;
    }
    writer.finish().map_err(text)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::Pen;
    use super::*;

    fn sample() -> Drawing {
        let mut drawing = Drawing::new(20, 10);
        drawing.stroke([2.0, 5.0], [18.0, 5.0], Pen::new(2.0, [0, 0, 0]));
        drawing.disc([10.0, 5.0], 2.0, [255, 0, 0]);
        drawing
    }

    #[test]
    fn strokes_cover_what_they_should() {
        let image = sample().to_image(1);
        assert_eq!(image.pixel(4, 4), [0, 0, 0]);
        assert_eq!(image.pixel(4, 5), [0, 0, 0]);
        assert_eq!(image.pixel(4, 7), [255, 255, 255]);
        assert_eq!(image.pixel(10, 5), [255, 0, 0]);
        assert_eq!(sample().to_image(2).width, 40);
    }

    #[test]
    fn pictures_are_where_they_are_put() {
        let mut drawing = Drawing::new(8, 6);
        let pixels = vec![[1, 2, 3], [4, 5, 6]];
        drawing.picture([3, 2], Image { width: 2, height: 1, pixels });
        let mut whole = Drawing::new(20, 10);
        whole.add(&drawing, [10.0, 4.0]);
        let image = whole.to_image(2);
        for (x, y, colour) in [(26, 12, [1, 2, 3]), (27, 13, [1, 2, 3]), (28, 12, [4, 5, 6])] {
            assert_eq!(image.pixel(x, y), colour);
        }
        assert_eq!(image.pixel(25, 12), [255; 3]);
        let svg = whole.to_svg();
        let begin =
            "<image x=\"13\" y=\"6\" width=\"2\" height=\"1\" href=\"data:image/png;base64,iVBOR";
        assert!(svg.contains(begin), "{svg}");
    }

    #[test]
    fn svg_has_the_same_shapes() {
        let svg = sample().to_svg();
        assert!(svg.contains("stroke-width=\"2\" d=\"M2 5L18 5\""), "{svg}");
        assert!(svg.contains("<circle cx=\"10\" cy=\"5\" r=\"2\" fill=\"#ff0000\"/>"), "{svg}");
    }

    #[test]
    fn every_letter_of_labels_has_strokes() {
        for letter in ('a'..='z').chain('0'..='9').chain(".,:-=+<>/()^".chars()) {
            let mut drawing = Drawing::new(10, 10);
            drawing.letters([1.0, 9.0], 6.0, &letter.to_string(), [0; 3]);
            assert!(!drawing.shapes.is_empty(), "{letter}");
        }
    }

    #[test]
    fn an_animation_has_all_its_frames() {
        let images = [sample().to_image(1), Drawing::new(20, 10).to_image(1)];
        let bytes = animation(&images, 100).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 2);
    }
}
