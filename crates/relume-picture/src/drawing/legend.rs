//! A legend drawn into a picture of numbers.
//!
//! Must not know what the numbers are.

use crate::picture::{Image, Scale};

use super::{Colour, Drawing, Pen};

/// Height of the letters, pixels.
const LETTERS: f64 = 8.0;
const BLACK: Colour = [30, 30, 30];

/// A picture with the colours of a scale along its right edge, numbers beside them and a title above, over the picture itself.
/// `steps` numbers are written, evenly from one end to the other; in small pictures every second of them, or fewer.
pub fn with_legend(mut image: Image, scale: &Scale, title: &str, steps: u32) -> Image {
    let (width, height) = (image.width, image.height);
    let tall = (0.6 * f64::from(height)).min(300.0);
    // Every so many of them, where there is not room for all.
    let room = (tall / (2.0 * LETTERS)).max(1.0) as u32;
    let steps = (1..=steps.min(room)).rev().find(|k| steps.is_multiple_of(*k)).unwrap_or(1);
    let labels: Vec<String> = (0..=steps)
        .map(|k| number(scale.low + (scale.high - scale.low) * f64::from(k) / f64::from(steps)))
        .collect();
    let widest = labels.iter().map(|l| Drawing::letters_width(LETTERS, l)).fold(0.0, f64::max);
    let inner = (22.0 + widest).max(Drawing::letters_width(LETTERS, title));
    let (left, top) = (f64::from(width) - inner - 12.0, 0.5 * (f64::from(height) - tall) + LETTERS);
    lighten(
        &mut image,
        [left - 6.0, top - 3.0 * LETTERS],
        [left + inner + 6.0, top + tall + 1.5 * LETTERS],
    );
    let mut out = Drawing::new(width, height);
    out.picture([0, 0], image);
    out.letters([left, top - 1.2 * LETTERS], LETTERS, title, BLACK);
    let rows = tall.round() as u32;
    for row in 0..rows {
        let share = 1.0 - (f64::from(row) + 0.5) / f64::from(rows);
        let y = top + f64::from(row) + 0.5;
        out.stroke([left + 0.5, y], [left + 13.5, y], Pen::new(1.0, scale.map.colour(share)));
    }
    for (k, label) in labels.iter().enumerate() {
        let y = top + tall * (1.0 - k as f64 / f64::from(steps));
        out.stroke([left + 14.0, y], [left + 18.0, y], Pen::new(1.0, BLACK));
        out.letters([left + 21.0, y + 0.5 * LETTERS], LETTERS, label, BLACK);
    }
    out.to_image(1)
}

/// A picture with a title and rows of a colour and a text each in its upper left corner, over the picture itself.
pub fn with_key(mut image: Image, title: &str, rows: &[(Colour, String)]) -> Image {
    let line = 1.75 * LETTERS;
    let widest = rows.iter().map(|(_, text)| Drawing::letters_width(LETTERS, text) + 21.0);
    let widest = widest.fold(Drawing::letters_width(LETTERS, title), f64::max);
    lighten(&mut image, [0.0, 0.0], [widest + 18.0, (rows.len() + 1) as f64 * line + LETTERS]);
    let mut out = Drawing::new(image.width, image.height);
    out.picture([0, 0], image);
    out.letters([8.0, line], LETTERS, title, BLACK);
    for (k, (colour, text)) in rows.iter().enumerate() {
        let y = (k + 2) as f64 * line;
        out.stroke([9.5, y - 4.0], [22.5, y - 4.0], Pen::new(4.0, *colour));
        out.letters([29.0, y], LETTERS, text, BLACK);
    }
    out.to_image(1)
}

/// Makes a part of a picture light, so that letters can be read on it.
fn lighten(image: &mut Image, low: [f64; 2], high: [f64; 2]) {
    let end = |at: f64, most: u32| at.round().clamp(0.0, f64::from(most)) as u32;
    for y in end(low[1], image.height)..end(high[1], image.height) {
        for x in end(low[0], image.width)..end(high[0], image.width) {
            let pixel = &mut image.pixels[(y * image.width + x) as usize];
            *pixel = pixel.map(|v| 204 + v / 5);
        }
    }
}

/// A number in few digits.
fn number(value: f64) -> String {
    let text = match value.abs() {
        0.0 => "0".to_owned(),
        v if !(1e-3..1e6).contains(&v) => format!("{value:.1e}"),
        v => format!("{value:.*}", (2 - v.log10().floor() as i32).max(0) as usize),
    };
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::ColourMap;

    #[test]
    fn numbers_have_three_digits() {
        let all = [0.0, 0.25, 1.0, 12.5, 133.3333, 2500.0, 1.23e-5, 0.001];
        assert_eq!(all.map(number), ["0", "0.25", "1", "12.5", "133", "2500", "1.2e-5", "0.001"]);
    }

    #[test]
    fn a_key_has_its_colours_in_order_within_its_corner() {
        let grey = Image { width: 200, height: 100, pixels: vec![[90; 3]; 20_000] };
        let colours: [Colour; 2] = [[200, 30, 30], [20, 150, 80]];
        let rows = colours.map(|colour| (colour, "WOKEN 12".to_owned()));
        let out = with_key(grey, "EVENTS", &rows);
        let row = |of: Colour| out.pixels.iter().position(|p| *p == of).map(|k| k / 200);
        let [one, other] = colours.map(|colour| row(colour).unwrap());
        assert!(one + 10 < other && other < 60, "{one}, {other}");
        assert!((0..100).all(|y| (110..200).all(|x| out.pixel(x, y) == [90; 3])));
        assert!((60..100).all(|y| out.pixel(20, y) == [90; 3]));
    }

    #[test]
    fn the_legend_shows_the_colours_with_the_highest_on_top_and_stays_within_the_picture() {
        let grey = Image { width: 200, height: 100, pixels: vec![[90; 3]; 20_000] };
        let scale = Scale { map: ColourMap::Turbo, low: 0.0, high: 4.0, lines: 0 };
        let out = with_legend(grey.clone(), &scale, "W/M2", 4);
        assert_eq!((out.width, out.height), (200, 100));
        let near = |share: f64| {
            let of = scale.map.colour(share);
            let is_near = |p: &[u8; 3]| p.iter().zip(of).all(|(a, b)| a.abs_diff(b) < 12);
            let found = out.pixels.iter().position(is_near);
            found.map(|k| k / 200)
        };
        let rows = [0.99, 0.75, 0.5, 0.25, 0.01].map(|share| near(share).unwrap());
        assert!(rows.windows(2).all(|w| w[0] < w[1]), "{rows:?}");
        // Of ten numbers there is room for every fifth.
        let shares = |steps| with_legend(grey.clone(), &scale, "W/M2", steps);
        assert_eq!(shares(10), shares(2));
        // What is left of it is as it was.
        assert!((0..100).all(|y| (0..120).all(|x| out.pixel(x, y) == [90; 3])));
    }
}
