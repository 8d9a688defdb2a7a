//! `relume figure`: the paper's figures of space, from the scenes that ship.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use glam::DVec3;
use relume::element::ElementId;
use relume::export::write_atomically;
use relume::scene::{BodyId, Scene};
use relume::session::Session;
use relume_picture::drawing::{Drawing, Pen};
use relume_picture::picture::{self, Exposure, Outlines, View, Viewpoint};

use crate::args::{DemoScene, Figure, FigureArgs, PictureFlags, Size, UpdateChoice, UpdateFlag};
use crate::bench;
use crate::clip::{Clip, picture_settings, solved, step_failure};
use crate::failure::Failure;
use crate::figures::{Row, time, times};
use crate::flat::draw::{BLACK, GREY, PINK, table};
use crate::interrupt;
use crate::memory;
use crate::output;
use crate::plan::Plan;

/// Largest form factor of a link, as in the tables of docs/prediction.md.
const EPSILON: f64 = 0.02;

/// Runs the command.
pub(crate) fn figure(args: &FigureArgs) -> Result<(), Failure> {
    make(&args.output)?;
    let names = match args.figure {
        // Its pictures are drawn pixel by pixel.
        Figure::Sequences => save(&sequences()?, "figure-0.5", 1, &args.output)?,
        Figure::Times => save(&times_table()?, "table-0.1", 2, &args.output)?,
    };
    output::print(&format!("{}\n", names.join("\n")))
}

/// Makes a directory, unless it is there.
pub(crate) fn make(dir: &Path) -> Result<(), Failure> {
    fs::create_dir_all(dir).map_err(|error| Failure::write(dir, &error))
}

/// Writes a drawing as SVG and as PNG of `scale` times its size; returns the names of the files.
pub(crate) fn save(
    drawing: &Drawing,
    name: &str,
    scale: u32,
    dir: &Path,
) -> Result<Vec<String>, Failure> {
    let names = [format!("{name}.svg"), format!("{name}.png")];
    let svg = dir.join(&names[0]);
    let image = drawing.to_image(scale);
    let _guard = interrupt::writing();
    write_atomically(&svg, drawing.to_svg().as_bytes())
        .map_err(|error| Failure::write(&svg, &error))?;
    image.write_png(dir.join(&names[1])).map_err(Failure::new)?;
    Ok(names.to_vec())
}

/// Size of a picture in figure 0.5, and the room around it, pixels.
const PICTURE: (u32, u32) = (184, 138);
const GAP: u32 = 6;
/// Height of the captions.
const CAPTION: u32 = 34;

/// Frames of the corridor and of the room, from the first row to the last.
const CORRIDOR_FRAMES: [u32; 4] = [0, 14, 27, 41];
const ROOM_FRAMES: [u32; 4] = [2, 7, 12, 17];

/// Figure 0.5: left the corridor with the elements that are linked to its light, then the room, its dynamic
/// links re-inspected in every frame, and extrapolated.
fn sequences() -> Result<Drawing, Failure> {
    let corridor = Clip::of_the_paper(DemoScene::Corridor, EPSILON)?;
    let room = Clip::of_the_paper(DemoScene::Room, EPSILON)?;
    let reinspect = UpdateChoice::of(UpdateFlag::Reinspect);
    let extrapolate = UpdateChoice::of(UpdateFlag::Extrapolate { frames: None });
    let [left, linked] = columns(&corridor, reinspect, &CORRIDOR_FRAMES)?;
    let [central, _] = columns(&room, reinspect, &ROOM_FRAMES)?;
    let [right, _] = columns(&room, extrapolate, &ROOM_FRAMES)?;
    let rows = left.into_iter().zip(linked).zip(central.into_iter().zip(right));
    let panels: Vec<Drawing> = rows.flat_map(|((a, b), (c, d))| [a, b, c, d]).collect();
    let panels = table(&panels, 4);
    let mut out = Drawing::new(panels.width + GAP, panels.height + CAPTION);
    out.add(&panels, [f64::from(GAP), f64::from(CAPTION)]);
    let captions = [
        ["corridor", "re-inspected"],
        ["its elements linked", "to the light"],
        ["room", "re-inspected"],
        ["room", "extrapolated"],
    ];
    for (k, lines) in captions.iter().enumerate() {
        for (line, text) in lines.iter().enumerate() {
            let left = GAP + k as u32 * (PICTURE.0 + GAP);
            let at = [f64::from(left), 13.0 + 14.0 * line as f64];
            out.letters(at, 8.0, text, BLACK);
        }
    }
    Ok(out)
}

/// Pictures of some frames, and the elements that are linked to the light in them.
fn columns(clip: &Clip, update: UpdateChoice, shown: &[u32]) -> Result<[Vec<Drawing>; 2], Failure> {
    let camera = Viewpoint::new(&clip.scene, None).map_err(Failure::new)?;
    let mut session = clip.session(update, false)?;
    let (mut pictures, mut linked, mut exposure) = (Vec::new(), Vec::new(), None);
    let last = shown.last().copied().unwrap_or(0);
    for &frame in clip.frames.iter().filter(|&&frame| frame <= last) {
        if interrupt::requested() {
            return Err(Failure::interrupted("interrupted; nothing is written"));
        }
        let time_s = clip.time_of(frame);
        memory::at(format_args!("frame {frame}"));
        session.step(frame, time_s).map_err(|error| step_failure(error, ""))?;
        let view = camera.at(&clip.scene, time_s).map_err(Failure::new)?;
        let snapshot = solved(&session).solution();
        let exposure = *exposure.get_or_insert_with(|| Exposure::automatic(&snapshot, &view));
        if shown.contains(&frame) {
            let settings = picture_settings(&flags(PICTURE), clip.shading, exposure);
            let image = picture::render(&snapshot, &view, &settings);
            let mut sheet = sheet();
            sheet.picture([0, 0], image);
            pictures.push(sheet);
            linked.push(elements_at_the_light(&session, &view, time_s));
        }
    }
    Ok([pictures, linked])
}

fn sheet() -> Drawing {
    Drawing::new(PICTURE.0 + GAP, PICTURE.1 + GAP)
}

fn flags((width, height): (u32, u32)) -> PictureFlags {
    PictureFlags { size: Size { width, height }, ..PictureFlags::default() }
}

/// The bodies that emit.
fn lamps(scene: &Scene) -> BTreeSet<BodyId> {
    let emits = |patch: &&relume::scene::Patch| scene.patch_emits(patch);
    scene.patches.iter().filter(emits).map(|patch| patch.body).collect()
}

/// Corners of an element in the world.
fn corners(session: &Session, id: ElementId, time_s: f64) -> Vec<DVec3> {
    let (scene, (_, forest)) = (session.scene(), solved(session).pairs());
    let patch = &scene.patches[forest.patch(id).expect("elements have patches").0 as usize];
    let pose = scene.pose(patch.body, time_s).expect("nothing vanishes in these scenes");
    let shape = forest.shape(id);
    shape.corners[..shape.len].iter().map(|&p| pose.point(patch.frame.point(p))).collect()
}

/// The elements with links to the light that face the view and are in sight, over the outlines of all
/// surfaces; the light is pink.
fn elements_at_the_light(session: &Session, view: &View, time_s: f64) -> Drawing {
    let (scene, (tree, forest)) = (session.scene(), solved(session).pairs());
    let lamps = lamps(scene);
    let body =
        |id| forest.patch(id).map(|p: relume::scene::PatchId| scene.patches[p.0 as usize].body);
    let at_lamp = |id| body(id).is_some_and(|b| lamps.contains(&b));
    let mut linked = BTreeSet::new();
    for link in tree.links() {
        match (at_lamp(link.a), at_lamp(link.b)) {
            (true, false) => linked.insert(link.b),
            (false, true) => linked.insert(link.a),
            _ => false,
        };
    }
    let outlines = Outlines::new(view, PICTURE.0, PICTURE.1);
    let facets: Vec<(Vec<DVec3>, bool)> = forest
        .facets()
        .iter()
        .map(|&facet| (corners(session, facet, time_s), at_lamp(facet)))
        .filter(|(polygon, lamp)| *lamp || outlines.faces(polygon))
        .collect();
    let mut sheet = sheet();
    let mut drawn = BTreeSet::new();
    let mut draw = |polygon: &[DVec3], pen: Pen| {
        for [from, to] in outlines.edges(polygon) {
            // A tenth of a pixel is enough; neighbours share their edges.
            let tenths = |p: glam::DVec2| [p.x, p.y].map(|x| (10.0 * x).round() as i32);
            let (a, b) = (tenths(from), tenths(to));
            if drawn.insert((a.min(b), a.max(b))) {
                let place = |p: [i32; 2]| p.map(|x| f64::from(x) / 10.0);
                sheet.stroke(place(a), place(b), pen);
            }
        }
    };
    for (polygon, _) in facets.iter().filter(|(_, lamp)| *lamp) {
        draw(polygon, Pen::new(2.0, PINK));
    }
    for &id in &linked {
        let polygon = corners(session, id, time_s);
        if outlines.faces(&polygon) && is_in_sight(&polygon, &facets, outlines.eye()) {
            draw(&polygon, Pen::new(0.6, BLACK));
        }
    }
    for (polygon, _) in &facets {
        draw(polygon, Pen::new(0.6, GREY));
    }
    sheet
}

/// Whether no facet stands before the middle of a polygon.
fn is_in_sight(polygon: &[DVec3], facets: &[(Vec<DVec3>, bool)], eye: DVec3) -> bool {
    let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
    let along = middle - eye;
    !facets.iter().any(|(facet, _)| {
        let normal = (facet[1] - facet[0]).cross(facet[2] - facet[0]);
        let share = normal.dot(facet[0] - eye) / normal.dot(along);
        // What it lies on is not before it.
        (1e-9..1.0 - 1e-6).contains(&share) && {
            let hit = eye + along * share;
            (0..facet.len()).all(|k| {
                let (from, to) = (facet[k], facet[(k + 1) % facet.len()]);
                (to - from).cross(hit - from).dot(normal) >= 0.0
            })
        }
    })
}

/// A line of the paper's Table 0.1: sequence, frames, average time a frame, standard deviation, time to set
/// up and solve frame 1, and how many times the average that is.
const PAPER: [[&str; 6]; 3] = [
    ["gouraud shaded corridor", "109", "3.81 s", "0.760 s", "30.95 s", "8.1x"],
    ["cubical room", "20", "4.21 s", "1.36 s", "22.24 s", "5.3x"],
    ["cubical room with extrapolation", "20", "3.92 s", "0.845 s", "19.74 s", "5.0x"],
];

/// Left ends of the columns, pixels.
const COLUMNS: [f64; 7] = [16.0, 266.0, 408.0, 480.0, 570.0, 670.0, 800.0];

/// Table 0.1, the paper's rows and ours below each.
fn times_table() -> Result<Drawing, Failure> {
    let measured = [
        rows(DemoScene::Corridor, UpdateFlag::Reinspect)?,
        rows(DemoScene::Room, UpdateFlag::Reinspect)?,
        rows(DemoScene::Room, UpdateFlag::Extrapolate { frames: None })?,
    ];
    let mut out = Drawing::new(866, 286);
    let line = |out: &mut Drawing, y: f64, cells: &[&str], colour| {
        for (left, text) in COLUMNS.iter().zip(cells) {
            out.letters([*left, y], 8.0, text, colour);
        }
    };
    line(&mut out, 22.0, &["", "", "", "average", "standard", "set up and", ""], BLACK);
    let heads = ["sequence", "", "frames", "a frame", "deviation", "solve frame 1", "ratio"];
    line(&mut out, 38.0, &heads, BLACK);
    let rule = |out: &mut Drawing, y: f64| out.stroke([16.0, y], [850.0, y], Pen::new(0.8, GREY));
    rule(&mut out, 46.0);
    let mut y = 66.0;
    for ([name, frames, mean, deviation, first, ratio], ours) in PAPER.iter().zip(&measured) {
        line(&mut out, y, &[name, "the paper", frames, mean, deviation, first, ratio], BLACK);
        for (row, what) in ours.iter().zip(["here, no pictures", "here"]).rev() {
            y += 20.0;
            let Row { mean_s, standard_deviation_s, first_s, ratio, .. } = row;
            let cells = [*mean_s, *standard_deviation_s, *first_s].map(time);
            let [m, d, f] = &cells;
            let frames = (row.frames + 1).to_string();
            line(&mut out, y, &["", what, &frames, m, d, f, &times(*ratio)], PINK);
        }
        y += 12.0;
        rule(&mut out, y - 4.0);
        y += 16.0;
    }
    let threads = rayon::current_num_threads();
    let note = format!(
        "form factors up to {EPSILON} linked, pictures of 640 x 480 pixels, {threads} threads"
    );
    out.letters([16.0, y + 4.0], 8.0, &note, GREY);
    Ok(out)
}

/// A demonstration measured over all its frames: without and with pictures.
fn rows(demo: DemoScene, update: UpdateFlag) -> Result<Vec<Row>, Failure> {
    let clip = Clip::of_the_paper(demo, EPSILON)?;
    let plan = Plan {
        update: UpdateChoice::of(update),
        // Of the builds from scratch only frame 1 is in the table.
        every: clip.frames.len(),
        compare: false,
        json: None,
        quiet: true,
    };
    let flags = PictureFlags::default();
    let draw = bench::draw_and_drop(&flags, &clip)?;
    match bench::figures(&plan, &clip, Some(draw))? {
        (Some(figures), measured) if measured == clip.frames.len() => Ok(figures.rows()),
        (_, measured) => Err(bench::stopped(measured, &clip)),
    }
}
