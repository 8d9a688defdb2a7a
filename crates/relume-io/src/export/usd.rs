//! A lit scene as USD text whose light plays: `displayColor` and transforms with time samples. Blender plays it without an
//! add-on.
//!
//! Knows nothing of how light was found. Format: USD ASCII 1.0.

use std::fmt::Write as _;

use glam::DVec3;
use relume_core::geometry::Pose;
use relume_core::scene::BodyId;

use super::lit::{Lit, LitPart};

/// A lit scene as the text of a `.usda` file at so many frames a second.
///
/// `displayColor` of each mesh is radiance (W/m2/sr, linear Rec. 709) times the exposure, not cut off; it goes to the emission of a
/// material that reflects nothing. A scene that was read near the origin is where its file has it. Surfaces whose light does not change have one value. `radiosity = colour * pi / exposure`;
/// the exposure stands in `customLayerData`.
///
/// Error: single precision. Size: some 40 bytes for each point and instant where light changes.
pub fn usda(lit: &Lit, fps: f64) -> String {
    let mut text = String::new();
    let code = |instant: usize| lit.times_s[instant] * fps;
    let last = lit.times_s.len() - 1;
    line(&mut text, format_args!("#usda 1.0"));
    line(&mut text, format_args!("(\n    defaultPrim = \"{}\"", ROOT));
    line(
        &mut text,
        format_args!(
            "    customLayerData = {{\n        double exposure = {}\n    }}",
            lit.exposure
        ),
    );
    line(&mut text, format_args!("    metersPerUnit = 1\n    upAxis = \"Y\""));
    line(
        &mut text,
        format_args!("    startTimeCode = {}\n    endTimeCode = {}", code(0), code(last)),
    );
    line(
        &mut text,
        format_args!("    timeCodesPerSecond = {fps}\n    framesPerSecond = {fps}\n)\n"),
    );
    line(&mut text, format_args!("def Xform \"{ROOT}\"\n{{"));
    let origin = lit.scene.origin;
    if origin != DVec3::ZERO {
        // In double precision above all points: those stay near 0.
        let place = format_args!("({}, {}, {})", origin.x, origin.y, origin.z).to_string();
        line(&mut text, format_args!("    double3 xformOp:translate = {place}"));
        line(&mut text, format_args!("    uniform token[] xformOpOrder = [\"xformOp:translate\"]"));
    }
    text += MATERIAL;
    let mut names = Names::default();
    for body in (0..lit.scene.bodies.len()).map(|k| BodyId(k as u32)) {
        let parts: Vec<&LitPart> = lit.parts.iter().filter(|part| lit.body(part) == body).collect();
        if parts.is_empty() {
            continue;
        }
        let name = names.of(&lit.scene.bodies[body.0 as usize].name);
        line(&mut text, format_args!("    def Xform \"{name}\"\n    {{"));
        place(&mut text, lit, body, &code);
        let mut names = Names::default();
        for part in parts {
            mesh(&mut text, lit, part, &names.of(lit.name(part)), &code);
        }
        line(&mut text, format_args!("    }}"));
    }
    line(&mut text, format_args!("}}"));
    text
}

const ROOT: &str = "scene";

/// A material whose emission is the colour of the vertices. One block a line: readers refuse less.
const MATERIAL: &str = "    def Material \"light\"
    {
        token outputs:surface.connect = </scene/light/surface.outputs:surface>
        def Shader \"surface\"
        {
            uniform token info:id = \"UsdPreviewSurface\"
            color3f inputs:diffuseColor = (0, 0, 0)
            color3f inputs:emissiveColor.connect = </scene/light/colour.outputs:result>
            float inputs:roughness = 1
            token outputs:surface
        }
        def Shader \"colour\"
        {
            uniform token info:id = \"UsdPrimvarReader_float3\"
            string inputs:varname = \"displayColor\"
            float3 outputs:result
        }
    }
";

fn line(text: &mut String, what: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = text.write_fmt(what);
    text.push('\n');
}

/// Names that USD takes, each once among its siblings.
#[derive(Default)]
struct Names {
    taken: Vec<String>,
}

impl Names {
    fn of(&mut self, name: &str) -> String {
        let fit = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let mut plain: String = name.chars().map(fit).collect();
        if plain.starts_with(|c: char| c.is_ascii_digit()) || plain.is_empty() || plain == "light" {
            plain.insert(0, '_');
        }
        let mut own = plain.clone();
        let mut number = 1;
        while self.taken.contains(&own) {
            own = format!("{plain}_{number}");
            number += 1;
        }
        self.taken.push(own.clone());
        own
    }
}

/// Where a body is, and when it is there.
fn place(text: &mut String, lit: &Lit, body: BodyId, code: &dyn Fn(usize) -> f64) {
    let poses: Vec<Option<Pose>> = lit.times_s.iter().map(|&t| lit.scene.pose(body, t)).collect();
    let matrix = |pose: &Pose| {
        let row = |v: DVec3, w: f64| format!("({}, {}, {}, {w})", v.x, v.y, v.z);
        let m = pose.rotation;
        let rows = [
            row(m.x_axis, 0.0),
            row(m.y_axis, 0.0),
            row(m.z_axis, 0.0),
            row(pose.translation, 1.0),
        ];
        format!("({})", rows.join(", "))
    };
    let name = "matrix4d xformOp:transform";
    if poses.windows(2).all(|w| w[0] == w[1]) {
        let pose = poses[0].unwrap_or(Pose::IDENTITY);
        line(text, format_args!("        {name} = {}", matrix(&pose)));
    } else {
        line(text, format_args!("        {name}.timeSamples = {{"));
        for (k, pose) in poses.iter().enumerate() {
            if let Some(pose) = pose {
                line(text, format_args!("            {}: {},", code(k), matrix(pose)));
            }
        }
        line(text, format_args!("        }}"));
    }
    line(text, format_args!("        uniform token[] xformOpOrder = [\"xformOp:transform\"]"));
    if poses.iter().any(Option::is_none) {
        line(text, format_args!("        token visibility.timeSamples = {{"));
        for (k, pose) in poses.iter().enumerate() {
            let seen = if pose.is_some() { "inherited" } else { "invisible" };
            line(text, format_args!("            {}: \"{seen}\",", code(k)));
        }
        line(text, format_args!("        }}"));
    }
}

fn mesh(text: &mut String, lit: &Lit, part: &LitPart, name: &str, code: &dyn Fn(usize) -> f64) {
    let three = |v: &[f32; 3]| format!("({}, {}, {})", v[0], v[1], v[2]);
    let list = |items: Vec<String>| items.join(", ");
    line(
        text,
        format_args!(
            "        def Mesh \"{name}\" (\n            prepend apiSchemas = [\"MaterialBindingAPI\"]\n        )\n        {{"
        ),
    );
    line(
        text,
        format_args!(
            "            int[] faceVertexCounts = [{}]",
            list(vec!["3".into(); part.triangles.len()])
        ),
    );
    let indices = part.triangles.as_flattened().iter().map(u32::to_string).collect();
    line(text, format_args!("            int[] faceVertexIndices = [{}]", list(indices)));
    line(
        text,
        format_args!(
            "            point3f[] points = [{}]",
            list(part.points.iter().map(three).collect())
        ),
    );
    line(text, format_args!("            uniform bool doubleSided = 0"));
    line(text, format_args!("            uniform token subdivisionScheme = \"none\""));
    line(text, format_args!("            rel material:binding = </{ROOT}/light>"));
    let colours = |instant: usize| {
        list(lit.exposed(part, instant).map(|c| three(&c.map(|c| c as f32))).collect())
    };
    let of = "color3f[] primvars:displayColor";
    let how = "(\n                interpolation = \"vertex\"\n            )";
    if part.changes() {
        line(text, format_args!("            {of} {how}"));
        line(text, format_args!("            {of}.timeSamples = {{"));
        for instant in 0..lit.times_s.len() {
            line(text, format_args!("                {}: [{}],", code(instant), colours(instant)));
        }
        line(text, format_args!("            }}"));
    } else {
        line(text, format_args!("            {of} = [{}] {how}", colours(0)));
    }
    line(text, format_args!("        }}"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_plain_and_each_is_there_once() {
        let mut names = Names::default();
        let all =
            ["left wall", "left-wall", "3", "", "light", "\u{e9}t\u{e9}"].map(|n| names.of(n));
        assert_eq!(all, ["left_wall", "left_wall_1", "_3", "_", "_light", "_t_"]);
    }
}
