//! A drawing as SVG.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::{Colour, Drawing, Shape};

impl Drawing {
    /// The text of an SVG file.
    pub fn to_svg(&self) -> String {
        let Drawing { width, height, shapes } = self;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <g fill=\"none\" stroke-linecap=\"round\">\n"
        );
        let mut pen = None;
        for shape in shapes {
            match shape.clone() {
                Shape::Picture { at: [x, y], image } => {
                    close(&mut out, &mut pen);
                    let (w, h) = (image.width, image.height);
                    let _ = write!(
                        out,
                        "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" \
                         href=\"data:image/png;base64,"
                    );
                    // A picture that cannot be encoded has no pixels.
                    STANDARD.encode_string(image.to_png().unwrap_or_default(), &mut out);
                    out.push_str("\"/>\n");
                }
                Shape::Stroke { from, to, width, colour, opacity } => {
                    let style = (width, colour, opacity);
                    if pen != Some(style) {
                        close(&mut out, &mut pen);
                        let _ = write!(
                            out,
                            "<path stroke=\"{}\" stroke-width=\"{}\"{} d=\"",
                            hex(colour),
                            short(width),
                            if opacity < 1.0 {
                                format!(" stroke-opacity=\"{}\"", short(opacity))
                            } else {
                                String::new()
                            }
                        );
                        pen = Some(style);
                    }
                    let [x0, y0, x1, y1] = [from[0], from[1], to[0], to[1]].map(short);
                    let _ = write!(out, "M{x0} {y0}L{x1} {y1}");
                }
                Shape::Disc { centre, radius, colour } => {
                    close(&mut out, &mut pen);
                    let [x, y, r] = [centre[0], centre[1], radius].map(short);
                    let colour = hex(colour);
                    let _ = writeln!(
                        out,
                        "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{colour}\"/>"
                    );
                }
            }
        }
        close(&mut out, &mut pen);
        out + "</g>\n</svg>\n"
    }
}

fn close(out: &mut String, pen: &mut Option<(f64, Colour, f64)>) {
    if pen.take().is_some() {
        out.push_str("\"/>\n");
    }
}

fn hex([r, g, b]: Colour) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Two digits after the point, without zeros at the end.
fn short(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_owned() }
}
