//! Materials: reflectance and exitance by their factors, and what varies them over a surface.
//!
//! Diffuse only: `baseColorFactor` is taken for the reflectance whatever the metallic factor says,
//! and layers (specular, clearcoat, sheen and so on) are ignored quietly. Must not know images.

use std::f64::consts::PI;

use super::animation::GlowKeys;
use super::document::Document;
use super::json;
use super::note;
use crate::tuning::{BLEND_CUTOFF, REFLECTANCE_MAX};
use relume_core::scene::{Material, Note, Severity};

/// What textures and vertex colours of a primitive are multiplied with, and where they are.
#[derive(Clone)]
pub(super) struct Paint {
    /// The material's name.
    pub(super) name: String,
    /// Linear base colour, not limited to [`REFLECTANCE_MAX`].
    pub(super) base_factor: [f64; 3],
    pub(super) base: Option<json::TextureRef>,
    /// Of what emits at some time.
    pub(super) emission: Option<json::TextureRef>,
    pub(super) see_through: Option<SeeThrough>,
}

/// A surface that lets light pass where its alpha is low.
#[derive(Clone, Copy)]
pub(super) struct SeeThrough {
    /// What the alpha of textures and vertex colours is multiplied with.
    pub(super) factor: f64,
    /// The alpha from which on light is blocked.
    pub(super) cutoff: f64,
}

/// All materials of the file, and one more behind them for primitives without one.
pub(super) fn materials(
    document: &Document,
    keys: &[GlowKeys],
    notes: &mut Vec<Note>,
) -> Vec<(Material, Paint)> {
    let read = |(i, m): (usize, &json::Material)| {
        let name =
            m.name.clone().filter(|n| !n.is_empty()).unwrap_or_else(|| format!("material {i}"));
        one(m, &keys[i], name, notes)
    };
    let mut materials: Vec<_> = document.root.materials.iter().enumerate().map(read).collect();
    let unset = json::Material::default();
    materials.push(one(&unset, &GlowKeys::default(), "no material".into(), notes));
    materials
}

fn one(
    material: &json::Material,
    keys: &GlowKeys,
    name: String,
    notes: &mut Vec<Note>,
) -> (Material, Paint) {
    let (base_factor, alpha, base) = base_colour(material);
    let strength = material
        .extensions
        .emissive_strength
        .as_ref()
        .and_then(|e| e.emissive_strength)
        .unwrap_or(1.0);
    let factor = material.emissive_factor.unwrap_or_default();
    let glows = keys.colour.is_some() || factor != [0.0; 3];
    note_metal(material, &name, notes);
    let paint = Paint {
        name: name.clone(),
        base_factor,
        base,
        emission: material.emissive_texture.filter(|_| glows),
        see_through: see_through(material, alpha),
    };
    let material = Material {
        name,
        reflectance: base_factor.map(|r| r.min(REFLECTANCE_MAX)),
        exitance: factor.map(|c| c * strength * PI),
        glow: keys.glow((factor, strength), [PI; 3]),
        double_sided: material.double_sided,
    };
    (material, paint)
}

/// The factor, its alpha and the texture of the diffuse colour.
fn base_colour(material: &json::Material) -> ([f64; 3], f64, Option<json::TextureRef>) {
    let (factor, texture) =
        match (&material.pbr_metallic_roughness, &material.extensions.specular_glossiness) {
            (_, Some(s)) => (s.diffuse_factor, s.diffuse_texture),
            (Some(p), None) => (p.base_color_factor, p.base_color_texture),
            (None, None) => (None, None),
        };
    let [r, g, b, alpha] = factor.unwrap_or([1.0; 4]);
    ([r, g, b], alpha, texture)
}

/// How a material lets light pass, if it does (glTF 2.0, alphaMode; KHR_materials_transmission as alpha).
fn see_through(material: &json::Material, alpha: f64) -> Option<SeeThrough> {
    let transmission = material.extensions.transmission.as_ref();
    let transmission = transmission.map_or(0.0, |t| t.transmission_factor.clamp(0.0, 1.0));
    let (factor, cutoff) = match material.alpha_mode.as_deref() {
        Some("MASK") => (alpha, material.alpha_cutoff.unwrap_or(0.5)),
        Some("BLEND") => (alpha * (1.0 - transmission), BLEND_CUTOFF),
        _ if transmission > 0.0 => (1.0 - transmission, BLEND_CUTOFF),
        _ => return None,
    };
    Some(SeeThrough { factor, cutoff })
}

fn note_metal(material: &json::Material, name: &str, notes: &mut Vec<Note>) {
    let metallic =
        material.pbr_metallic_roughness.as_ref().and_then(|p| p.metallic_factor).unwrap_or(0.0);
    if metallic > 0.0 {
        let message = format!(
            "metallicFactor {metallic} is ignored: the base colour is taken as diffuse reflectance"
        );
        notes.push(note(Severity::Info, "metallic", name, 1, message));
    }
}
