//! Path-traced irradiance at sensors, frame by frame, as a reference for tests.
//!
//! `cargo run --release -p relume-core --example path_traced -- SCENE.glb SENSORS.pts OUT.csv 0,8,16 400`
//!
//! Sensors are lines `x y z nx ny nz` in the world; the last number is how many batches of 64 paths each
//! gets. Columns: `frame,sensor,x,y,z,nx,ny,nz,E_r,E_g,E_b,se_r,se_g,se_b`, W/m2. Frames are 1/24 s. The
//! light transport is the judge's alone: of Relume only the reader of scenes is used.

use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;
use relume_io::{ImportOptions, import};
use relume_judge::World;
use relume_judge::path::{Site, irradiance};

#[path = "../tests/common/judged.rs"]
mod judged;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, sensors, out, frames, batches] = &arguments[..] else {
        return Err("usage: path_traced SCENE.glb SENSORS.pts OUT.csv FRAMES BATCHES".into());
    };
    let scene = import(Path::new(scene), &ImportOptions::default())?;
    let sites = sites(&std::fs::read_to_string(sensors)?)?;
    let mut text = String::from("frame,sensor,x,y,z,nx,ny,nz,E_r,E_g,E_b,se_r,se_g,se_b\n");
    for frame in frames.split(',') {
        let frame: u32 = frame.parse()?;
        let world = World::new(judged::polygons(&scene, f64::from(frame) / 24.0));
        let found = irradiance(&world, &sites, batches.parse()?, u64::from(frame));
        for (k, (site, e)) in sites.iter().zip(found).enumerate() {
            write!(text, "{frame},{k}")?;
            for x in site.origin.to_array().into_iter().chain(site.normal.to_array()) {
                write!(text, ",{x:.6}")?;
            }
            for x in e.irradiance {
                write!(text, ",{x:.7}")?;
            }
            for x in e.standard_error {
                write!(text, ",{x:.2e}")?;
            }
            text.push('\n');
        }
    }
    std::fs::write(out, text)?;
    Ok(())
}

/// The sensors of a text; comments with #.
fn sites(text: &str) -> Result<Vec<Site>, String> {
    let lines = text.lines().map(|l| l.split('#').next().unwrap_or("").trim());
    let site = |(k, line): (usize, &str)| {
        let numbers: Option<Vec<f64>> = line
            .split_whitespace()
            .map(|x| x.parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        match numbers.as_deref() {
            Some(&[x, y, z, nx, ny, nz]) if nx != 0.0 || ny != 0.0 || nz != 0.0 => {
                Ok(Site::point(DVec3::new(x, y, z), DVec3::new(nx, ny, nz).normalize()))
            }
            _ => Err(format!("line {}: not `x y z nx ny nz`: {line}", k + 1)),
        }
    };
    lines.enumerate().filter(|l| !l.1.is_empty()).map(site).collect()
}
