//! A lit scene as one page that any browser plays by itself, without a network: `player.html` with the scene in it.
//!
//! The page needs WebGL2 and `DecompressionStream`. Knows nothing of how light was found.

use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::{DQuat, DVec3};
use relume_core::scene::BodyId;
use serde_json::{Value, json};

use super::lit::{Lit, LitPart};

const PLAYER: &str = include_str!("player.html");

/// Irradiance is stored as its square root in so many steps up to the largest of a part: a step at the largest is 1/2000 of it,
/// at a hundredth of that 1/200.
const STEPS: f64 = 4095.0;

/// First view of a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PageView {
    /// Where from, metres.
    pub eye: DVec3,
    /// Point in the middle of the view, metres: the view turns about it.
    pub target: DVec3,
    /// Direction that is up in the view.
    pub up: DVec3,
    /// Vertical field of view, radians.
    pub yfov: f64,
}

/// A lit scene as the text of an HTML page.
///
/// Light is linear between the instants, and so are places; `exposure_ev` is what the page starts with. The page shows
/// irradiance and radiosity of what is under the pointer, at its place in the scene's file. Size: some 3 to 6 bytes for each point and instant where light changes.
///
/// Error: half a step of the square root of irradiance, of which there are 4095 up to the largest of a part.
///
/// # Errors
/// Those of packing in memory.
pub fn page(lit: &Lit, view: PageView, exposure_ev: f64) -> io::Result<String> {
    let mut data = Vec::new();
    let mut parts = Vec::new();
    for part in &lit.parts {
        parts.push(describe(lit, part, &mut data));
    }
    let size_m = lit.scene.bounds(lit.times_s[0]).map_or(0.0, |bounds| bounds.diagonal());
    let bodies: Vec<Value> =
        (0..lit.scene.bodies.len()).map(|k| body(lit, BodyId(k as u32))).collect();
    let scene = json!({
        "name": lit.scene.name, "times": lit.times_s, "exposure_ev": exposure_ev, "steps": STEPS,
        "size": size_m.max(f64::MIN_POSITIVE), "origin": lit.scene.origin.to_array(), "bodies": bodies, "parts": parts,
        "view": {
            "eye": view.eye.to_array(), "target": view.target.to_array(), "up": view.up.to_array(), "yfov": view.yfov
        }
    });
    let mut packer = ZlibEncoder::new(Vec::new(), Compression::best());
    packer.write_all(&data)?;
    let light = STANDARD.encode(packer.finish()?);
    // No name may end the element that it stands in.
    let scene = scene.to_string().replace('<', "\\u003c");
    Ok(PLAYER.replace("{{light}}", &light).replace("{{scene}}", &scene))
}

/// Poses of a body by instant, one if they are all the same: quaternion (x, y, z, w), then translation; null while it is absent.
fn body(lit: &Lit, id: BodyId) -> Value {
    let pose = |&time_s: &f64| {
        lit.scene.pose(id, time_s).map(|pose| {
            let q = DQuat::from_mat3(&pose.rotation).normalize();
            q.to_array().into_iter().chain(pose.translation.to_array()).collect::<Vec<f64>>()
        })
    };
    let mut poses: Vec<Option<Vec<f64>>> = lit.times_s.iter().map(pose).collect();
    if poses.windows(2).all(|w| w[0] == w[1]) {
        poses.truncate(1);
    }
    json!({ "name": lit.scene.bodies[id.0 as usize].name, "poses": poses })
}

/// What is said of a part; its arrays go to `data`: points, triangles, and irradiance by instant.
fn describe(lit: &Lit, part: &LitPart, data: &mut Vec<u8>) -> Value {
    data.extend(part.points.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    data.extend(part.triangles.as_flattened().iter().flat_map(|k| k.to_le_bytes()));
    let is_same = part.irradiance.windows(2).all(|w| w[0] == w[1]);
    let instants = if is_same { &part.irradiance[..1] } else { &part.irradiance[..] };
    let values = instants.iter().flat_map(|h| h.as_flattened());
    let top = values.fold(0.0_f32, |most, &h| most.max(h));
    let mut before = vec![0; 3 * part.points.len()];
    for irradiance in instants {
        let now: Vec<i32> = irradiance.as_flattened().iter().map(|&h| root(h, top)).collect();
        let steps = now.iter().zip(&before).map(|(now, before)| now - before);
        // Small steps of either sign are small numbers.
        let steps: Vec<u16> = steps.map(|s| ((s << 1) ^ (s >> 31)) as u16).collect();
        data.extend(steps.iter().map(|s| s.to_le_bytes()[0]));
        data.extend(steps.iter().map(|s| s.to_le_bytes()[1]));
        before = now;
    }
    let mut exitance = part.exitance.clone();
    if exitance.windows(2).all(|w| w[0] == w[1]) {
        exitance.truncate(1);
    }
    json!({
        "name": lit.name(part), "body": lit.body(part).0, "points": part.points.len(),
        "triangles": part.triangles.len(), "instants": instants.len(), "top": top,
        "exitance": exitance, "reflectance": part.reflectance
    })
}

/// Steps of the square root of an irradiance.
fn root(irradiance: f32, top: f32) -> i32 {
    if top <= 0.0 {
        return 0;
    }
    (STEPS * f64::from(irradiance / top).max(0.0).sqrt()).round() as i32
}
