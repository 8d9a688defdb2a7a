//! The `transform` attribute.

use glam::{DAffine2, DMat2, DVec2};
use roxmltree::Node;

use super::path::numbers;
use super::{Fault, fault};

/// Where an element's own transformation takes its points.
pub(super) fn of(node: Node<'_, '_>) -> Result<DAffine2, Fault> {
    let mut out = DAffine2::IDENTITY;
    let mut rest = node.attribute("transform").unwrap_or("").trim();
    while !rest.is_empty() {
        let parts = rest.split_once('(').and_then(|(name, rest)| {
            let (inside, rest) = rest.split_once(')')?;
            Some((name.trim(), inside, rest))
        });
        let Some((name, inside, after)) = parts else {
            return fault(format!("transform has `{rest}`"), "write such as translate(1 2)");
        };
        out *= one(name, &numbers(inside)?)?;
        rest = after.trim_start_matches([' ', ',', '\n', '\t', '\r']);
    }
    if out.matrix2.determinant() == 0.0 || !out.is_finite() {
        return fault("its transform leaves nothing of it", "scale by something other than 0");
    }
    Ok(out)
}

fn one(name: &str, numbers: &[f64]) -> Result<DAffine2, Fault> {
    Ok(match (name, numbers) {
        ("translate", &[x]) => DAffine2::from_translation(DVec2::new(x, 0.0)),
        ("translate", &[x, y]) => DAffine2::from_translation(DVec2::new(x, y)),
        ("scale", &[s]) => DAffine2::from_scale(DVec2::splat(s)),
        ("scale", &[x, y]) => DAffine2::from_scale(DVec2::new(x, y)),
        ("rotate", &[degrees]) => rotation(degrees, DVec2::ZERO),
        ("rotate", &[degrees, x, y]) => rotation(degrees, DVec2::new(x, y)),
        ("matrix", &[a, b, c, d, e, f]) => DAffine2::from_cols_array(&[a, b, c, d, e, f]),
        ("skewX", &[degrees]) => {
            DAffine2::from_cols_array(&[1.0, 0.0, libm::tan(degrees.to_radians()), 1.0, 0.0, 0.0])
        }
        ("skewY", &[degrees]) => {
            DAffine2::from_cols_array(&[1.0, libm::tan(degrees.to_radians()), 0.0, 1.0, 0.0, 0.0])
        }
        _ => {
            return fault(
                format!("transform has {name} with {} numbers", numbers.len()),
                "write translate, rotate, scale, skewX, skewY or matrix, with their numbers",
            );
        }
    })
}

/// By degrees about a point.
fn rotation(degrees: f64, about: DVec2) -> DAffine2 {
    let (sin, cos) = libm::sincos(degrees.to_radians());
    let turn = DMat2::from_cols(DVec2::new(cos, sin), DVec2::new(-sin, cos));
    DAffine2 { matrix2: turn, translation: about - turn * about }
}
