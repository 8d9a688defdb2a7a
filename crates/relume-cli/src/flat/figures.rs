//! The paper's figures of the plane, each as SVG and PNG.

use std::path::Path;
use std::sync::Arc;

use glam::DVec2;
use relume::element::ElementId;
use relume::export::write_atomically;
use relume::flat::{FlatFrame, FlatLink, FlatOptions, FlatScene, FlatSession, parse};
use relume_picture::drawing::{Drawing, Pen, animation};

use crate::args::FlatFigure;
use crate::failure::Failure;
use crate::paper::save;

use super::draw::{BLACK, BLUE, GREY, PINK, Sheet, colour_of, extent, table};

const WEDGE: &str = include_str!("../../scenes/wedge.flat");
const SCREEN: &str = include_str!("../../scenes/screen.flat");
const APPROACH: &str = include_str!("../../scenes/approach.flat");
const GUTTER: &str = include_str!("../../scenes/gutter.flat");
const DUCT: &str = include_str!("../../scenes/duct.flat");
const ROOM: &str = include_str!("../../scenes/room.flat");

/// Draws one figure into a directory; returns the names of the files.
pub(super) fn draw(figure: FlatFigure, dir: &Path) -> Result<Vec<String>, Failure> {
    let drawing = match figure {
        FlatFigure::Hierarchy => wedge(),
        FlatFigure::Occlusion => screen(),
        FlatFigure::Demotion => approach(),
        FlatFigure::Gutter => {
            let mut names = save(&gutter(), "figure-0.4", 2, dir)?;
            names.extend(gutter_in_motion(dir)?);
            return Ok(names);
        }
        FlatFigure::Convergence => convergence(),
    };
    let name = match figure {
        FlatFigure::Hierarchy => "figure-0.1",
        FlatFigure::Occlusion => "figure-0.2",
        FlatFigure::Demotion => "figure-0.3",
        FlatFigure::Gutter => "figure-0.4",
        FlatFigure::Convergence => "convergence",
    };
    save(&drawing, name, 2, dir)
}

/// A scene that ships with the command.
fn scene(text: &str) -> Arc<FlatScene> {
    Arc::new(parse(text).expect("a scene that ships is right"))
}

fn session(scene: &Arc<FlatScene>, epsilon: f64, min_length_m: f64) -> FlatSession {
    let options = FlatOptions { epsilon, min_length_m, events: true, ..FlatOptions::default() };
    FlatSession::new(scene.clone(), options).expect("options that ship are right")
}

/// What a session has solved last.
fn solved(session: &FlatSession) -> FlatFrame<'_> {
    session.frame().expect("a step leaves a solution")
}

/// The walls of both ends of a link, the lower number first.
fn walls_of(frame: FlatFrame<'_>, link: &FlatLink) -> (u32, u32) {
    let (_, forest) = frame.pairs();
    let wall = |id: ElementId| forest.wall(id).0.0;
    let (a, b) = (wall(link.a), wall(link.b));
    (a.min(b), a.max(b))
}

const LINK: Pen = Pen::new(1.1, PINK);

/// Figure 0.1: left the hierarchy, right the links.
fn wedge() -> Drawing {
    let scene = scene(WEDGE);
    let mut session = session(&scene, 0.1, 0.04);
    session.step(0, 0.0);
    let (lo, hi) = extent(&scene, std::iter::once(0.0));
    let sheet = || Sheet::new((lo, hi), 330.0, 66.0);
    let mut left = sheet();
    left.walls(solved(&session).view());
    left.hierarchy(&solved(&session).elements());
    let mut right = sheet();
    right.links(solved(&session), &solved(&session).links(), LINK);
    right.walls(solved(&session).view());
    right.ticks(&solved(&session).elements());
    table(&[left.drawing, right.drawing], 2)
}

/// Figure 0.2: the links between 1 and 2 as 3 comes and goes.
fn screen() -> Drawing {
    let scene = scene(SCREEN);
    let mut session = session(&scene, 0.12, 0.1);
    let part = (DVec2::new(-0.5, -0.12), DVec2::new(1.5, 1.12));
    let mut panels = Vec::new();
    for frame in 0..5 {
        session.step(frame, f64::from(frame));
        let mut sheet = Sheet::new(part, 128.0, 14.0);
        let links: Vec<FlatLink> = solved(&session)
            .links()
            .into_iter()
            .filter(|l| walls_of(solved(&session), l) == (0, 1))
            .collect();
        sheet.links(solved(&session), &links, LINK);
        sheet.walls(solved(&session).view());
        let (_, forest) = solved(&session).pairs();
        let ends: Vec<_> =
            solved(&session).elements().into_iter().filter(|e| forest.wall(e.id).0.0 < 2).collect();
        sheet.ticks(&ends);
        let three = solved(&session).view().poses()[1].origin;
        for (at, name) in
            [(DVec2::new(0.5, -0.12), "1"), (DVec2::new(0.5, 1.12), "2"), (three, "3")]
        {
            sheet.label(at, 8.0, name);
        }
        panels.push(sheet.drawing);
    }
    table(&panels, 5)
}

/// Figure 0.3: the hierarchies and the links across as 3 approaches 1 and 2.
fn approach() -> Drawing {
    let scene = scene(APPROACH);
    let mut session = session(&scene, 0.12, 0.1);
    let part = (DVec2::new(-0.1, -0.15), DVec2::new(2.1, 2.0));
    let mut panels = Vec::new();
    for frame in 0..3 {
        session.step(frame, f64::from(frame));
        let three = solved(&session).view().poses()[1].origin;
        let mut left = Sheet::new(part, 130.0, 24.0);
        left.walls(solved(&session).view());
        left.hierarchy(&solved(&session).elements());
        let mut right = Sheet::new(part, 130.0, 24.0);
        let links: Vec<FlatLink> = solved(&session)
            .links()
            .into_iter()
            .filter(|l| walls_of(solved(&session), l).1 == 2)
            .collect();
        right.links(solved(&session), &links, LINK);
        right.walls(solved(&session).view());
        right.ticks(&solved(&session).elements());
        let below = DVec2::new(0.0, -0.12);
        for (at, name) in [
            (DVec2::new(0.475, 0.0) + below, "1"),
            (DVec2::new(1.525, 0.0) + below, "2"),
            (three - below, "3"),
        ] {
            right.label(at, 8.0, name);
        }
        panels.extend([left.drawing, right.drawing]);
    }
    table(&panels, 2)
}

/// Of figure 0.4: so large that links go to the whole patch while it is far away.
const GUTTER_EPSILON: f64 = 0.2;

/// One frame of figure 0.4.
fn gutter_at(frame: FlatFrame<'_>, scale: f64) -> Sheet {
    let mut sheet = Sheet::new((DVec2::splat(-0.02), DVec2::splat(1.16)), scale, 16.0);
    let links = frame.links();
    let (dynamic, still): (Vec<FlatLink>, Vec<FlatLink>) =
        links.into_iter().partition(|l| walls_of(frame, l).1 == 2);
    sheet.links(frame, &still, Pen { opacity: 0.35, ..LINK });
    sheet.links(frame, &dynamic, LINK);
    sheet.walls(frame.view());
    sheet.ticks(&frame.elements());
    sheet
}

/// Figure 0.4: frames read from top to bottom, then from left to right.
fn gutter() -> Drawing {
    const ROWS: usize = 3;
    const COLUMNS: usize = 2;
    let scene = scene(GUTTER);
    let mut session = session(&scene, GUTTER_EPSILON, 0.06);
    let last = (ROWS * COLUMNS - 1) as f64;
    let mut panels = Vec::new();
    for frame in 0..ROWS * COLUMNS {
        session.step(frame as u32, 5.0 * frame as f64 / last);
        panels.push(gutter_at(solved(&session), 270.0).drawing);
    }
    let row_by_row: Vec<Drawing> =
        (0..ROWS * COLUMNS).map(|k| panels[k % COLUMNS * ROWS + k / COLUMNS].clone()).collect();
    table(&row_by_row, COLUMNS)
}

/// Figure 0.4 in motion, there and back: what happens to a link flashes in the colour of its kind.
fn gutter_in_motion(dir: &Path) -> Result<Vec<String>, Failure> {
    const FRAMES: u32 = 40;
    let scene = scene(GUTTER);
    let mut session = session(&scene, GUTTER_EPSILON, 0.06);
    let at = |frame: u32| 10.0 * f64::from(frame) / f64::from(FRAMES);
    session.step(0, at(FRAMES - 1));
    let mut pictures = Vec::new();
    for frame in 0..FRAMES {
        let report = session.step(frame, at(frame));
        let mut sheet = gutter_at(solved(&session), 300.0);
        sheet.events(solved(&session));
        let kinds = [
            (relume::pair::EventKind::Demoted, "demoted", report.work.demoted),
            (relume::pair::EventKind::Promoted, "promoted", report.work.promoted),
            (relume::pair::EventKind::Occluded, "occluded", count(solved(&session), "o")),
            (relume::pair::EventKind::Revealed, "revealed", count(solved(&session), "r")),
        ];
        let height = f64::from(sheet.drawing.height);
        let mut whole = Drawing::new(sheet.drawing.width, sheet.drawing.height + 26);
        whole.add(&sheet.drawing, [0.0, 0.0]);
        let mut left = 16.0;
        for (kind, word, number) in kinds {
            let text = format!("{word} {number}");
            let colour = if number > 0 { colour_of(kind) } else { GREY };
            whole.letters([left, height + 12.0], 7.0, &text, colour);
            left += 92.0;
        }
        pictures.push(whole.to_image(1));
    }
    let name = "figure-0.4-in-motion.png";
    let bytes = animation(&pictures, 140).map_err(Failure::new)?;
    let path = dir.join(name);
    write_atomically(&path, &bytes).map_err(|error| Failure::write(&path, &error))?;
    Ok(vec![name.into()])
}

/// Links that more (`o`) or less (`r`) stands between now.
fn count(frame: FlatFrame<'_>, which: &str) -> u64 {
    let kind = match which {
        "o" => relume::pair::EventKind::Occluded,
        _ => relume::pair::EventKind::Revealed,
    };
    frame.link_events().iter().filter(|e| e.kind == kind).count() as u64
}

/// Error of the walls' mean radiosities against the number of links, both by powers of ten: of a room
/// with a box and a lamp, with constant elements and with gradients, and of one without shadows.
fn convergence() -> Drawing {
    plot([&errors(ROOM, true), &errors(ROOM, false), &errors(DUCT, false)])
}

/// (links, error) by their logarithms, for ever lower thresholds.
fn errors(text: &str, constant: bool) -> Vec<[f64; 2]> {
    let scene = scene(text);
    let means = |epsilon: f64, constant: bool| {
        let options = FlatOptions {
            epsilon,
            min_length_m: 0.2 * epsilon,
            constant,
            residual: 1e-7,
            ..FlatOptions::default()
        };
        let mut session = FlatSession::new(scene.clone(), options).expect("they are right");
        let links = session.step(0, 0.0).links;
        let (_, forest) = solved(&session).pairs();
        let mean = |&f: &ElementId| f64::from(solved(&session).radiosity(f)[0]);
        (forest.facets().iter().map(mean).collect::<Vec<f64>>(), links as f64)
    };
    let (reference, _) = means(0.003, false);
    let point = |epsilon: f64| {
        let (found, links) = means(epsilon, constant);
        let squares = found.iter().zip(&reference).map(|(m, r)| ((m - r) / r.max(0.1)).powi(2));
        let error = (squares.sum::<f64>() / found.len() as f64).sqrt();
        [libm::log10(links), libm::log10(error)]
    };
    [0.2, 0.14, 0.1, 0.07, 0.05, 0.035, 0.025, 0.0175, 0.0125].map(point).to_vec()
}

const ORANGE: [u8; 3] = [225, 130, 20];

/// Left end of the axis of links, upper end of that of errors, and the sizes of a decade, pixels.
const AXES: [f64; 4] = [96.0, 40.0, 110.0, 58.0];

fn plot([constant, shadows, none]: [&[[f64; 2]]; 3]) -> Drawing {
    let [left, top, across, down] = AXES;
    let mut out = Drawing::new(600, 460);
    let place = |[x, y]: [f64; 2]| [left + (x - 1.0) * across, top + (-1.0 - y) * down];
    let thin = Pen::new(0.8, [215; 3]);
    for k in 0..=4 {
        let (from, to) = (place([1.0 + f64::from(k), -1.0]), place([1.0 + f64::from(k), -7.0]));
        out.stroke(from, to, thin);
        out.letters([to[0] - 12.0, to[1] + 20.0], 9.0, &format!("10^{}", 1 + k), BLACK);
    }
    for k in 0..=6 {
        let (from, to) = (place([1.0, -1.0 - f64::from(k)]), place([5.0, -1.0 - f64::from(k)]));
        out.stroke(from, to, thin);
        out.letters([from[0] - 52.0, from[1] + 4.0], 9.0, &format!("10^-{}", 1 + k), BLACK);
    }
    out.letters([left + 200.0, 440.0], 9.0, "links", BLACK);
    out.letters([14.0, 22.0], 9.0, "error of wall means (RMS, relative)", BLACK);
    // The orders that are expected, through the last points.
    for (points, order, name) in [(constant, 0.5, "order 1/2"), (none, 1.0, "order 1")] {
        let [x, y] = points[points.len() - 1];
        let line = |at: f64| place([at, y - order * (at - x)]);
        out.dashes(line(1.5), line(4.7), 5.0, Pen::new(1.0, GREY));
        let [x, y] = line(4.7);
        out.letters([x + 6.0, y + 6.0], 8.0, name, GREY);
    }
    for (points, colour, name, below) in [
        (constant, ORANGE, "constant", -9.0),
        (shadows, PINK, "gradients", 18.0),
        (none, BLUE, "no shadows", -9.0),
    ] {
        for pair in points.windows(2) {
            out.stroke(place(pair[0]), place(pair[1]), Pen::new(1.4, colour));
        }
        points.iter().for_each(|&p| out.disc(place(p), 3.2, colour));
        let [x, y] = place(points[points.len() - 1]);
        out.letters([x - 16.0, y + below], 8.0, name, colour);
    }
    out
}
