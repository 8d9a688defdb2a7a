//! A solution as VTK reads it: `.vtp`, XML with the numbers as raw bytes behind it, and `.pvd`, which lists such files by time.
//!
//! Knows a snapshot and nothing of how it was found. Format: VTK File Formats, XML PolyData, version 1.0.

use std::fmt::Write as _;

use glam::DVec3;
use relume_core::geometry::Pose;
use relume_core::scene::{Patch, PatchId};
use relume_core::session::Snapshot;

/// A solution as the bytes of a `.vtp` file: a polygon for each leaf element, in the world of its file, metres (in
/// double precision where that was read near the origin and lies far from it).
///
/// Data of cells are the solution's own numbers: `irradiance_W_m2`, `radiosity_W_m2`, `exitance_W_m2` (three channels, linear RGB),
/// `reflectance`, `level` (how often its polygon was quartered), `body`, `surface` (names), `body_id`, `surface_id`, `patch_id`.
/// Points belong to one cell each and carry `irradiance_W_m2` as it is at that corner of the leaf: linear over it, with jumps from
/// leaf to leaf. Bodies that are absent are left out. `TimeValue` is the time, seconds.
pub fn vtp(snapshot: &Snapshot) -> Vec<u8> {
    let mut cells = Cells::default();
    let scene = &snapshot.scene;
    for (k, patch) in scene.patches.iter().enumerate() {
        if let Some(pose) = snapshot.world.pose(patch.body) {
            let pose = Pose { translation: pose.translation + scene.origin, ..pose };
            cells.add(snapshot, PatchId(k as u32), patch, pose);
        }
    }
    let mut file = File::default();
    let (points, polygons) = (cells.points.len() / 3, cells.offsets.len());
    let mut xml = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <PolyData>\n<FieldData>\n<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{}</DataArray>\n\
         </FieldData>\n<Piece NumberOfPoints=\"{points}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" \
         NumberOfPolys=\"{polygons}\">\n<PointData>\n",
        snapshot.time_s
    );
    xml += &file.floats("irradiance_W_m2", 3, &cells.at_points);
    xml += "</PointData>\n<CellData>\n";
    xml += &file.floats("irradiance_W_m2", 3, &cells.irradiance);
    xml += &file.floats("radiosity_W_m2", 3, &cells.radiosity);
    xml += &file.floats("exitance_W_m2", 3, &cells.exitance);
    xml += &file.floats("reflectance", 3, &cells.reflectance);
    for (name, values) in ["level", "body_id", "surface_id", "patch_id"].iter().zip(&cells.numbers)
    {
        xml += &file.numbers(name, values);
    }
    let names = |number: usize, of: &dyn Fn(usize) -> String| -> Vec<u8> {
        cells.numbers[number].iter().flat_map(|&k| (of(k as usize) + "\0").into_bytes()).collect()
    };
    xml += &file.texts("body", &names(1, &|k| scene.bodies[k].name.clone()));
    xml += &file.texts("surface", &names(2, &|k| scene.surfaces[k].name.clone()));
    xml += "</CellData>\n<Points>\n";
    // Far from the origin single precision would not do.
    xml += &match scene.origin == DVec3::ZERO {
        true => {
            file.floats("points", 3, &cells.points.iter().map(|&x| x as f32).collect::<Vec<f32>>())
        }
        false => file.doubles("points", 3, &cells.points),
    };
    xml += "</Points>\n<Polys>\n";
    xml += &file.numbers("connectivity", &(0..points as i64).collect::<Vec<i64>>());
    xml += &file.numbers("offsets", &cells.offsets);
    xml += "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    let mut bytes = xml.into_bytes();
    bytes.extend(file.appended);
    bytes.extend(b"\n</AppendedData>\n</VTKFile>\n");
    bytes
}

/// A list of `.vtp` files by their times (seconds) as the text of a `.pvd` file.
pub fn pvd(files: &[(f64, String)]) -> String {
    let mut text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n"
            .to_owned();
    for (time_s, file) in files {
        let file = escaped(file);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "<DataSet timestep=\"{time_s}\" part=\"0\" file=\"{file}\"/>");
    }
    text + "</Collection>\n</VTKFile>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// What is said of the leaves.
#[derive(Default)]
struct Cells {
    points: Vec<f64>,
    at_points: Vec<f32>,
    /// One past the last point of each.
    offsets: Vec<i64>,
    irradiance: Vec<f32>,
    radiosity: Vec<f32>,
    exitance: Vec<f32>,
    reflectance: Vec<f32>,
    /// Level, body, surface, patch.
    numbers: [Vec<i64>; 4],
}

impl Cells {
    fn add(&mut self, snapshot: &Snapshot, id: PatchId, patch: &Patch, pose: Pose) {
        let exitance = snapshot.world.exitance(&snapshot.scene, patch).map(|x| x as f32);
        let reflectance = snapshot.world.reflectance(&snapshot.scene, patch).map(|x| x as f32);
        for leaf in snapshot.leaves_of(id) {
            let corners = if leaf.corners[2] == leaf.corners[3] { 3 } else { 4 };
            for &corner in &leaf.corners[..corners] {
                let at = pose.point(patch.frame.point(corner));
                self.points.extend(at.to_array());
                self.at_points.extend(leaf.irradiance_at(corner));
            }
            self.offsets.push(self.points.len() as i64 / 3);
            self.irradiance.extend(leaf.irradiance);
            self.radiosity.extend(leaf.radiosity);
            self.exitance.extend(exitance);
            self.reflectance.extend(reflectance);
            let numbers = [leaf.level(), patch.body.0, patch.surface.0, id.0];
            self.numbers.iter_mut().zip(numbers).for_each(|(all, one)| all.push(i64::from(one)));
        }
    }
}

/// The numbers behind the text, each array after its length in bytes.
#[derive(Default)]
struct File {
    appended: Vec<u8>,
}

impl File {
    /// Appends an array; the line of text that says what it is.
    fn array(&mut self, name: &str, of: &str, bytes: impl Iterator<Item = u8>) -> String {
        let offset = self.appended.len();
        self.appended.extend([0; 8]);
        self.appended.extend(bytes);
        let length = (self.appended.len() - offset - 8) as u64;
        self.appended[offset..offset + 8].copy_from_slice(&length.to_le_bytes());
        format!("<DataArray {of} Name=\"{name}\" format=\"appended\" offset=\"{offset}\"/>\n")
    }

    fn floats(&mut self, name: &str, components: usize, values: &[f32]) -> String {
        let of = format!("type=\"Float32\" NumberOfComponents=\"{components}\"");
        self.array(name, &of, values.iter().flat_map(|x| x.to_le_bytes()))
    }

    fn doubles(&mut self, name: &str, components: usize, values: &[f64]) -> String {
        let of = format!("type=\"Float64\" NumberOfComponents=\"{components}\"");
        self.array(name, &of, values.iter().flat_map(|x| x.to_le_bytes()))
    }

    fn numbers(&mut self, name: &str, values: &[i64]) -> String {
        self.array(name, "type=\"Int64\"", values.iter().flat_map(|x| x.to_le_bytes()))
    }

    /// Texts, each with a zero behind it.
    fn texts(&mut self, name: &str, texts: &[u8]) -> String {
        self.array(name, "type=\"String\"", texts.iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_files_is_xml_whatever_they_are_called() {
        let text = pvd(&[(0.0, "a & \"b\"/frame-0000.vtp".into()), (0.5, "c.vtp".into())]);
        assert!(text.contains("timestep=\"0.5\""), "{text}");
        let xml = roxmltree::Document::parse(&text).unwrap();
        let files: Vec<&str> = xml.descendants().filter_map(|n| n.attribute("file")).collect();
        assert_eq!(files, ["a & \"b\"/frame-0000.vtp", "c.vtp"]);
    }
}
