//! Line drawings: strokes, discs, lettering and pictures among them, as SVG and as pixels, and pixels in motion as APNG.
//!
//! Must not know what a drawing shows. Both forms come from the same list of shapes, lettering included,
//! which is drawn in strokes: no fonts are needed and both look alike.

use std::sync::Arc;

use crate::picture::Image;

mod legend;
mod letters;
mod palette;
mod pixels;
mod svg;

pub use legend::{with_key, with_legend};
pub use pixels::animation;

/// A colour: sRGB.
pub type Colour = [u8; 3];

/// One shape; lengths in pixels, y down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// A stroke with round ends.
    Stroke { from: [f64; 2], to: [f64; 2], width: f64, colour: Colour, opacity: f64 },
    /// A filled disc.
    Disc { centre: [f64; 2], radius: f64, colour: Colour },
    /// A picture, its upper left corner at a whole pixel.
    Picture { at: [u32; 2], image: Arc<Image> },
}

/// A drawing on white: shapes, later ones over earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    pub(crate) shapes: Vec<Shape>,
}

/// What a stroke looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    /// Pixels across.
    pub width: f64,
    /// Its colour.
    pub colour: Colour,
    /// 1 hides what is below, 0 is nothing.
    pub opacity: f64,
}

impl Pen {
    /// An opaque pen.
    pub const fn new(width: f64, colour: Colour) -> Pen {
        Pen { width, colour, opacity: 1.0 }
    }
}

impl Drawing {
    /// An empty sheet.
    pub fn new(width: u32, height: u32) -> Drawing {
        Drawing { width, height, shapes: Vec::new() }
    }

    /// A stroke from one point to another.
    pub fn stroke(&mut self, from: [f64; 2], to: [f64; 2], pen: Pen) {
        let Pen { width, colour, opacity } = pen;
        self.shapes.push(Shape::Stroke { from, to, width, colour, opacity });
    }

    /// A stroke in dashes, each as long as the gap after it.
    pub fn dashes(&mut self, from: [f64; 2], to: [f64; 2], dash: f64, pen: Pen) {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        let at = |d: f64| {
            let share = (d / length).min(1.0);
            [from[0] + along[0] * share, from[1] + along[1] * share]
        };
        for k in 0..(length / (2.0 * dash)).ceil() as u32 {
            let start = 2.0 * dash * f64::from(k);
            self.stroke(at(start), at(start + dash), pen);
        }
    }

    /// A filled disc.
    pub fn disc(&mut self, centre: [f64; 2], radius: f64, colour: Colour) {
        self.shapes.push(Shape::Disc { centre, radius, colour });
    }

    /// A picture, pixel by pixel, its upper left corner at a point.
    pub fn picture(&mut self, at: [u32; 2], image: Image) {
        self.shapes.push(Shape::Picture { at, image: Arc::new(image) });
    }

    /// Lettering in capitals, `height` pixels tall, from the left end of its base line. What has no
    /// letter is left blank.
    pub fn letters(&mut self, at: [f64; 2], height: f64, text: &str, colour: Colour) {
        let unit = height / letters::TALL;
        let pen = Pen::new((0.13 * height).max(1.0), colour);
        for (k, letter) in text.chars().enumerate() {
            let left = at[0] + letters::ADVANCE * unit * k as f64;
            for line in letters::lines(letter) {
                let place = |p: [f64; 2]| [left + p[0] * unit, at[1] - p[1] * unit];
                line.windows(2).for_each(|w| self.stroke(place(w[0]), place(w[1]), pen));
            }
        }
    }

    /// How wide lettering gets, pixels.
    pub fn letters_width(height: f64, text: &str) -> f64 {
        height / letters::TALL * letters::ADVANCE * text.chars().count() as f64
    }

    /// Another drawing on top, moved by an offset.
    pub fn add(&mut self, other: &Drawing, by: [f64; 2]) {
        let moved = |p: [f64; 2]| [p[0] + by[0], p[1] + by[1]];
        self.shapes.extend(other.shapes.iter().map(|shape| match shape.clone() {
            Shape::Stroke { from, to, width, colour, opacity } => {
                Shape::Stroke { from: moved(from), to: moved(to), width, colour, opacity }
            }
            Shape::Disc { centre, radius, colour } => {
                Shape::Disc { centre: moved(centre), radius, colour }
            }
            Shape::Picture { at, image } => {
                let at = moved(at.map(f64::from)).map(|x| x.round() as u32);
                Shape::Picture { at, image }
            }
        }));
    }
}
