//! Errors of pictures against path-traced ones, pixel by pixel.
//!
//! `cargo run --release -p relume-picture --example judged -- SCENE.glb TIME,TIME TOLERANCE WIDTHxHEIGHT BATCHES OUT`
//!
//! For each way of shading: root mean square error of irradiance at pixels (their middles), relative to its mean, over all of them and over
//! those in penumbrae, less what the reference itself may be off by; seconds from the solution to the pixels; and of what changes
//! from the first time to the second, how much is off. The reference is the judge's alone: a path tracer, and visible form factors, that are told polygons.
//! Writes OUT-smooth.png and so on.

use std::path::Path;
use std::time::Instant;

use glam::{DMat3, DVec3};
use relume_core::geometry::Pose;
use relume_core::scene::outside::{Outside, SUN_DIAMETER_DEG, Sky, Sun, SunPlace};
use relume_core::scene::{PatchId, Projection, Scene};
use relume_core::session::{Options, Session, Snapshot};
use relume_io::{ImportOptions, import};
use relume_judge::path::{Estimate, Site, irradiance};
use relume_judge::{Polygon, World};
use relume_picture::picture::{
    Exposure, Image, Settings, Shading, View, Viewpoint, direct_lamps, layers, render,
};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, times, tolerance, size, batches, out, eye @ ..] = &arguments[..] else {
        return Err("usage: judged SCENE.glb TIMES TOLERANCE WxH BATCHES OUT [EYE TARGET]".into());
    };
    let scene = lit(import(Path::new(scene), &ImportOptions::default())?)?;
    let times: Vec<f64> = times.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let (width, height) = size.split_once('x').ok_or("a size is WxH")?;
    let (width, height) = (width.parse()?, height.parse()?);
    let options = Options { tolerance: tolerance.parse()?, ..Options::default() };
    let mut session = Session::new(scene, options)?;
    let mut found: Vec<Vec<Seen>> = Vec::new();
    for &time_s in &times {
        let started = Instant::now();
        session.solve_at(time_s)?;
        println!("time {time_s}: solved in {:.3} s", started.elapsed().as_secs_f64());
        let scene = session.scene().clone();
        let view = view(&scene, time_s, eye)?;
        let base = Settings { width, height, samples: 1, ..Settings::default() };
        if batches == "0" {
            return pictures(&session, &view, out);
        }
        let seen = Seen::of(&session, &view, &base, batches.parse()?, time_s);
        if time_s == times[0] {
            maps(&seen, (width, height), out)?;
        }
        found.push(seen);
        if time_s == times[0] {
            pictures(&session, &view, out)?;
        }
    }
    println!(
        "{:12} {:>10} {:>10} {:>10} {:>10} {:>10}",
        "", "all", "penumbra", "median", "p99", "change"
    );
    for (k, (name, ..)) in MODES.iter().enumerate() {
        let one = &found[0];
        let all = error(one, k, |_| true);
        let penumbra = error(one, k, |seen| seen.partly);
        let mut off: Vec<f64> = one.iter().map(|s| s.off(k).abs()).collect();
        off.sort_by(f64::total_cmp);
        let at = |share: f64| off[((off.len() - 1) as f64 * share) as usize] / mean(one);
        let change = if found.len() > 1 { change(&found[0], &found[1], k) } else { 0.0 };
        println!(
            "{name:12} {:>9.3}% {:>9.3}% {:>9.3}% {:>9.3}% {:>9.3}%",
            100.0 * all,
            100.0 * penumbra,
            100.0 * at(0.5),
            100.0 * at(0.99),
            100.0 * change
        );
    }
    Ok(())
}

const MODES: [(&str, Shading, bool, bool); 4] = [
    ("flat", Shading::Flat, false, false),
    ("gouraud", Shading::Gouraud, false, false),
    ("smooth", Shading::Smooth, false, false),
    ("cleaned", Shading::Smooth, true, false),
];

fn snapshot(session: &Session, cleaned: bool, reconstruct: bool) -> Snapshot {
    let frame = session.frame().expect("it was solved");
    let lamps = direct_lamps(session.scene(), &session.world());
    match (cleaned, reconstruct) {
        (true, true) => frame.reconstruction_beside(&lamps),
        (true, _) => frame.solution_beside(&lamps),
        (_, true) => frame.reconstruction(),
        _ => frame.solution(),
    }
}

/// A scene without light under an overcast sky and a sun.
fn lit(scene: Scene) -> Result<Scene, Failure> {
    if scene.emits() {
        return Ok(scene);
    }
    let place = SunPlace::Direction { azimuth: 150.0, elevation: 40.0 };
    let sun = Sun { place, irradiance: Some([60.0; 3]), diameter_deg: SUN_DIAMETER_DEG };
    let sky = Some(Sky::Overcast { irradiance: 40.0 });
    let outside = Outside { sky, sun: Some(sun), ground: 0.2, fineness: 0.1, ..Outside::default() };
    Ok(scene.with_outside(outside)?)
}

/// From `x,y,z` to `x,y,z`, where they are given.
fn view(scene: &Scene, time_s: f64, from: &[String]) -> Result<View, Failure> {
    if let [eye, target] = from {
        let point = |text: &str| -> Result<DVec3, Failure> {
            let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
            Ok(DVec3::from_slice(&numbers))
        };
        let (eye, target) = (point(eye)?, point(target)?);
        let back = (eye - target).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let rotation = DMat3::from_cols(right, back.cross(right), back);
        let world_from_camera = Pose { rotation, translation: eye };
        let projection = Projection::Perspective { yfov: 1.1, aspect: None };
        return Ok(View { world_from_camera, projection });
    }
    Ok(Viewpoint::new(scene, None)?.at(scene, time_s)?)
}

fn pictures(session: &Session, view: &View, out: &str) -> Result<(), Failure> {
    let exposure = Exposure::automatic(&snapshot(session, false, false), view);
    for (name, shading, cleaned, reconstruct) in MODES {
        let settings = Settings { shading, exposure, ..Settings::default() };
        let mut best = [f64::INFINITY; 2];
        for _ in 0..3 {
            let started = Instant::now();
            let snapshot = snapshot(session, cleaned, reconstruct);
            let read = started.elapsed().as_secs_f64();
            let image = render(&snapshot, view, &settings);
            let all = started.elapsed().as_secs_f64();
            best = [best[0].min(read), best[1].min(all)];
            image.write_png(format!("{out}-{name}.png"))?;
        }
        println!("{name:12} read {:.1} ms, drawn after {:.1} ms", 1e3 * best[0], 1e3 * best[1]);
    }
    Ok(())
}

/// Pictures of errors: red where too much is shown, blue where too little, full at a tenth of the mean irradiance.
fn maps(seen: &[Seen], (width, height): (u32, u32), out: &str) -> Result<(), Failure> {
    let mean = mean(seen);
    for (k, (name, ..)) in MODES.iter().enumerate() {
        let zoom = 6;
        let mut pixels = vec![[0_u8; 3]; (width * height * zoom * zoom) as usize];
        for pixel in seen {
            let off = (pixel.off(k) / mean * 10.0).clamp(-1.0, 1.0);
            let pale = (255.0 * (1.0 - off.abs())) as u8;
            let colour = if off > 0.0 { [255, pale, pale] } else { [pale, pale, 255] };
            for j in 0..zoom * zoom {
                let (x, y) = (pixel.pixel[0] * zoom + j % zoom, pixel.pixel[1] * zoom + j / zoom);
                pixels[(y * width * zoom + x) as usize] = colour;
            }
        }
        let image = Image { width: width * zoom, height: height * zoom, pixels };
        image.write_png(format!("{out}-off-{name}.png"))?;
    }
    Ok(())
}

/// A pixel with the reference and every mode's irradiance, W/m2.
struct Seen {
    reference: Estimate,
    found: [[f64; 3]; MODES.len()],
    /// Whether a lamp is partly hidden from it.
    partly: bool,
    at: DVec3,
    pixel: [u32; 2],
}

impl Seen {
    fn of(session: &Session, view: &View, base: &Settings, batches: u32, time_s: f64) -> Vec<Seen> {
        let scene = session.scene();
        let world = World::new(polygons(scene, time_s));
        let of_mode = |(_, shading, cleaned, reconstruct): &(&str, Shading, bool, bool)| {
            let settings = Settings { shading: *shading, ..base.clone() };
            layers(&snapshot(session, *cleaned, *reconstruct), view, &settings)
        };
        let modes: Vec<_> = MODES.iter().map(of_mode).collect();
        let mut seen = Vec::new();
        let mut sites = Vec::new();
        for (k, pixel) in modes[0].pixels.iter().enumerate() {
            if pixel.body == 0 {
                continue;
            }
            let (x, y) = (k as u32 % base.width, k as u32 / base.width);
            // Where the one sample of the pixel is.
            let at = place(view, base, [x, y].map(f64::from), f64::from(pixel.depth_m));
            let normal = DVec3::from_array(pixel.normal.map(f64::from)).normalize();
            sites.push(Site::point(at, normal));
            let at = at + normal * (1e-6 * world.size_m());
            let found = std::array::from_fn(|mode| modes[mode].pixels[k].irradiance.map(f64::from));
            if std::env::var("PIXEL").is_ok_and(|p| p == format!("{x},{y}")) {
                let polygons = world.polygons();
                let mut exact = 0.0;
                for (k, lamp) in polygons.iter().enumerate().filter(|(_, p)| p.exitance[0] > 0.0) {
                    let others = polygons
                        .iter()
                        .enumerate()
                        .filter(|(j, _)| *j != k && Some(*j) != lamp.twin);
                    let blockers: Vec<&[DVec3]> = others.map(|(_, p)| &p.corners[..]).collect();
                    exact += lamp.exitance[0]
                        * relume_judge::seen::form_factor_from_point(
                            at,
                            normal,
                            &lamp.corners,
                            &blockers,
                        );
                }
                println!("{at} {normal}: exact direct {exact}");
                for (name, layers) in MODES.iter().zip(&modes) {
                    println!(
                        "{} {:?} direct {:?}",
                        name.0, layers.pixels[k].irradiance, layers.pixels[k].direct
                    );
                }
            }
            let partly = is_partly(&world, at, normal);
            seen.push(Seen { reference: Estimate::default(), found, partly, at, pixel: [x, y] });
        }
        let estimates = irradiance(&world, &sites, batches, 7);
        seen.iter_mut().zip(estimates).for_each(|(seen, e)| seen.reference = e);
        seen
    }

    /// Sum over the channels.
    fn off(&self, mode: usize) -> f64 {
        (0..3).map(|c| self.found[mode][c] - self.reference.irradiance[c]).sum()
    }

    fn variance(&self) -> f64 {
        // Channels go together.
        self.reference.standard_error.iter().sum::<f64>().powi(2)
    }
}

/// The place in the middle of a pixel at a depth.
fn place(view: &View, size: &Settings, [x, y]: [f64; 2], depth_m: f64) -> DVec3 {
    let (w, h) = (f64::from(size.width) / 2.0, f64::from(size.height) / 2.0);
    let (right, down, depth) = (x + 0.5 - w, y + 0.5 - h, depth_m);
    let in_camera = match view.projection {
        Projection::Perspective { yfov, aspect } => {
            let slope = (yfov / 2.0).tan();
            let scale = (h / slope).min(aspect.map_or(f64::INFINITY, |a| w / (slope * a)));
            DVec3::new(right / scale * depth, -down / scale * depth, -depth)
        }
        Projection::Orthographic { xmag, ymag } => {
            let scale = (h / ymag.abs()).min(w / xmag.abs());
            DVec3::new(right / scale, -down / scale, -depth)
        }
    };
    view.world_from_camera.point(in_camera)
}

fn mean(seen: &[Seen]) -> f64 {
    seen.iter().map(|s| s.reference.irradiance.iter().sum::<f64>()).sum::<f64>() / seen.len() as f64
}

fn error(seen: &[Seen], mode: usize, which: impl Fn(&Seen) -> bool) -> f64 {
    let some: Vec<&Seen> = seen.iter().filter(|s| which(s)).collect();
    let squares: f64 = some.iter().map(|s| s.off(mode).powi(2) - s.variance()).sum();
    (squares / some.len().max(1) as f64).max(0.0).sqrt() / mean(seen)
}

/// Root mean square of how much changes that a mode shows are off, over pixels that show the same place both times.
fn change(one: &[Seen], two: &[Seen], mode: usize) -> f64 {
    let mut sum = (0.0, 0.0);
    for (a, b) in one.iter().zip(two).filter(|(a, b)| a.at.distance(b.at) < 1e-6) {
        let off = b.off(mode) - a.off(mode);
        sum = (sum.0 + off * off - a.variance() - b.variance(), sum.1 + 1.0);
    }
    (sum.0 / f64::max(sum.1, 1.0)).max(0.0).sqrt() / mean(one)
}

fn polygons(scene: &Scene, time_s: f64) -> Vec<Polygon> {
    let polygon = |patch: &relume_core::scene::Patch| {
        let pose = scene.pose(patch.body, time_s).expect("every body is present");
        Polygon {
            corners: patch.corners_in_body().map(|c| pose.point(c)).collect(),
            reflectance: scene.reflectance(patch),
            exitance: scene.exitance_at(patch, time_s),
            twin: patch.twin.map(|PatchId(k)| k as usize),
        }
    };
    scene.patches.iter().map(polygon).collect()
}

fn is_partly(world: &World, at: DVec3, normal: DVec3) -> bool {
    let polygons = world.polygons();
    let lamps = polygons.iter().enumerate().filter(|(_, p)| p.exitance.iter().any(|&m| m > 0.0));
    lamps.into_iter().any(|(k, lamp)| {
        let twin = lamp.twin;
        let others = polygons.iter().enumerate().filter(|(j, _)| *j != k && Some(*j) != twin);
        let blockers: Vec<&[DVec3]> = others.map(|(_, p)| &p.corners[..]).collect();
        let seen = relume_judge::seen::form_factor_from_point(at, normal, &lamp.corners, &blockers);
        let all = relume_judge::seen::form_factor_from_point(at, normal, &lamp.corners, &[]);
        seen > 1e-3 * all && seen < 0.999 * all && all > 1e-4
    })
}
