//! Punctual lights (KHR_lights_punctual) and cameras.
//!
//! glTF states lights in photometric units: candela for point and spot lights, lux for directional
//! ones. They are divided by 683 lm/W, which undoes what Blender's exporter does by default (its
//! lighting mode "Standard"; the mode "Unitless" leaves the factor out, so such files come out 683
//! times too dark). What each light became is stated in [`Light::conversion`] and in a note.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use super::animation::GlowKeys;
use super::document::Document;
use super::{json, note};
use crate::photometry::PEAK_LUMENS_PER_WATT;
use relume_core::scene::{Light, LightKind, NodeId, Note, Projection, SceneError, Severity};

/// The light `index` of the file on a node.
pub(super) fn light(
    document: &Document,
    (index, keys): (usize, &GlowKeys),
    (node, name): (NodeId, &str),
    notes: &mut Vec<Note>,
) -> Result<Light, SceneError> {
    let lights = document.root.extensions.lights.as_ref().map_or(&[][..], |l| &l.lights);
    let light = lights.get(index).ok_or_else(|| document.out_of_range("light", index))?;
    let kind = kind_of(document, light, name)?;
    let colour = light.color.unwrap_or([1.0; 3]);
    let stated = light.intensity.unwrap_or(1.0);
    let intensity = colour.map(|c| c * stated / PEAK_LUMENS_PER_WATT);
    if intensity.iter().any(|i| !i.is_finite() || *i < 0.0) {
        return Err(document.malformed(format!(
            "light `{name}` has the intensity {stated} and the colour {colour:?}"
        )));
    }
    let (unit, becomes) = match kind {
        LightKind::Directional => ("lx", "W/m2"),
        _ => ("cd", "W/sr"),
    };
    let [r, g, b] = intensity;
    let mut conversion = format!(
        "{stated} {unit} x colour {colour:?} / 683 lm/W = ({r:.6}, {g:.6}, {b:.6}) {becomes}"
    );
    if light.range.is_some() {
        conversion.push_str("; its range is ignored");
    }
    let glow = keys.glow((colour, stated), [1.0 / PEAK_LUMENS_PER_WATT; 3]);
    if glow.is_some() {
        conversion.push_str("; it changes over time");
    }
    notes.push(note(Severity::Info, "light-units", name, 1, conversion.clone()));
    Ok(Light { name: name.to_owned(), node, kind, intensity, glow, conversion })
}

fn kind_of(document: &Document, light: &json::Light, name: &str) -> Result<LightKind, SceneError> {
    match light.kind.as_str() {
        "point" => Ok(LightKind::Point),
        "directional" => Ok(LightKind::Directional),
        "spot" => {
            let angles = light.spot.as_ref();
            let inner = angles.and_then(|s| s.inner_cone_angle).unwrap_or(0.0);
            let outer = angles.and_then(|s| s.outer_cone_angle).unwrap_or(FRAC_PI_4);
            // 32-bit exporters round pi/2 up.
            if 0.0 <= inner && inner <= outer && outer <= FRAC_PI_2 + 1e-5 {
                return Ok(LightKind::Spot { inner, outer });
            }
            Err(document.malformed(format!(
                "spot light `{name}` has cone angles {inner} (inner) and {outer} (outer)"
            )))
        }
        other => Err(document.malformed(format!("light `{name}` has the unknown type {other}"))),
    }
}

/// The projection of camera `index` of the file, and what is to be said of it; `None` where its numbers make no picture: that is
/// no reason to refuse what it looks at. Fields of view of half a turn and more are degrees, as some exporters write them.
pub(super) fn projection(
    document: &Document,
    index: usize,
) -> Result<(Option<Projection>, Option<String>), SceneError> {
    let camera =
        document.root.cameras.get(index).ok_or_else(|| document.out_of_range("camera", index))?;
    let left_out = |what: String| {
        Ok((None, Some(format!("{what}: the camera is left out; repair it or choose a view"))))
    };
    let sensible = |x: f64| x.is_finite() && x > 0.0;
    match (camera.kind.as_str(), &camera.perspective, &camera.orthographic) {
        ("perspective", Some(p), _) if sensible(p.yfov) && p.yfov < 180.0 => {
            let aspect = p.aspect_ratio.filter(|&a| sensible(a));
            let is_in_degrees = p.yfov >= std::f64::consts::PI;
            let yfov = if is_in_degrees { p.yfov.to_radians() } else { p.yfov };
            let said = format!(
                "its field of view is {} rad, which is taken as degrees; export radians",
                p.yfov
            );
            Ok((Some(Projection::Perspective { yfov, aspect }), is_in_degrees.then_some(said)))
        }
        ("perspective", Some(p), _) => left_out(format!("its field of view is {} rad", p.yfov)),
        // Negative extents are discouraged but legal; they mirror the picture, which is not done.
        ("orthographic", _, Some(o)) if sensible(o.xmag.abs()) && sensible(o.ymag.abs()) => {
            let (xmag, ymag) = (o.xmag.abs(), o.ymag.abs());
            Ok((Some(Projection::Orthographic { xmag, ymag }), None))
        }
        ("orthographic", _, Some(o)) => {
            left_out(format!("its extents are {} and {} m", o.xmag, o.ymag))
        }
        (kind, _, _) => left_out(format!("its type `{kind}` has no numbers to go with it")),
    }
}
