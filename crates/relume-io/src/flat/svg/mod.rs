//! Scenes in the plane as SVG: `line`, `polyline`, `polygon`, `rect` and `path` of straight parts are walls,
//! groups are bodies, `animateTransform` moves them.
//!
//! y points down in SVG and up in the plane: it is negated, so that a scene looks as it does in a
//! browser. One unit is one metre, unless the root says `data-units-per-metre`. Fronts are on the left from
//! start to end, as seen; `data-front` says `inside` or `outside` of what is closed instead. Materials come
//! from `data-reflectance`, `data-emit` and `data-two-sided`, which groups hand down. docs/flatland.md
//! says the rest.

mod motion;
mod path;
mod transform;

use glam::{DAffine2, DMat2, DVec2};
use roxmltree::{Document, Node, ParsingOptions};

use super::size::{self, SEGMENTS_MAX};
use super::text::channels;
use relume_core::flat::{FlatScene, Material, Motion, SceneError, Segment};
use relume_core::scene::limits::{COORDINATE_MAX_M, is_place};

/// Error in an SVG, with its element and a remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{element}: {what}; {remedy}")]
pub struct SvgError {
    /// The element: its kind, its id if it has one, and its line.
    pub element: String,
    /// What is wrong with it.
    pub what: String,
    /// What helps.
    pub remedy: String,
}

/// What is wrong with an element, and what helps.
type Fault = (String, String);

fn fault<T>(what: impl Into<String>, remedy: impl Into<String>) -> Result<T, Fault> {
    Err((what.into(), remedy.into()))
}

/// Reads a scene.
///
/// # Errors
/// The first element that is wrong.
pub fn parse_svg(text: &str) -> Result<FlatScene, SvgError> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| SvgError {
        element: "the file".into(),
        what: format!("it is no XML: {error}"),
        remedy: "save it as SVG again".into(),
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        return Err(at(
            root,
            fault::<()>("it is no SVG", "begin the file with <svg>").unwrap_err(),
        ));
    }
    let metres = metres(root).map_err(|fault| at(root, fault))?;
    let mut reader = Reader { bodies: Vec::new(), loose: None, shapes: 0, segments: 0, depth: 0 };
    let place = Place { world: metres, body: None, moves: false, ink: Ink::default() };
    reader.children(root, &place)?;
    reader.scene().map_err(|error| {
        let remedy = "draw a line, polyline, polygon, rect or path";
        at(root, (error.to_string(), remedy.into()))
    })
}

/// From the root's units to metres, y up.
fn metres(root: Node<'_, '_>) -> Result<DAffine2, Fault> {
    let per_metre = match root.attribute("data-units-per-metre") {
        None => 1.0,
        Some(text) => {
            text.trim().parse::<f64>().ok().filter(|n| *n > 0.0 && n.is_finite()).ok_or((
                format!("data-units-per-metre is `{text}`"),
                "write a number above 0, such as 100".to_owned(),
            ))?
        }
    };
    Ok(DAffine2::from_mat2(DMat2::from_diagonal(DVec2::new(1.0, -1.0) / per_metre)))
}

/// The error of an element.
fn at(node: Node<'_, '_>, (what, remedy): Fault) -> SvgError {
    let id = node.attribute("id").map(|id| format!(" `{id}`")).unwrap_or_default();
    let line = node.document().text_pos_at(node.range().start).row;
    SvgError { element: format!("{}{id}, line {line}", node.tag_name().name()), what, remedy }
}

/// What a body is made of.
struct Drawn {
    name: String,
    motion: Motion,
    walls: Vec<Wall>,
}

struct Wall {
    name: String,
    local: Segment,
    material: Material,
}

/// What an element takes from those that it is in.
#[derive(Clone)]
struct Place {
    /// From its units to its body's frame.
    world: DAffine2,
    /// Its body.
    body: Option<usize>,
    /// Whether that moves.
    moves: bool,
    ink: Ink,
}

/// What materials are made from.
#[derive(Clone)]
struct Ink {
    material: Material,
    front: Option<Front>,
}

impl Default for Ink {
    fn default() -> Ink {
        Ink { material: Material::grey(0.5), front: None }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Front {
    Inside,
    Outside,
}

/// Points from one to the next, and whether from the last to the first.
struct Chain {
    points: Vec<DVec2>,
    closed: bool,
}

struct Reader {
    bodies: Vec<Drawn>,
    /// The body of what is in no group.
    loose: Option<usize>,
    /// Shapes so far.
    shapes: usize,
    /// Segments so far.
    segments: usize,
    /// Groups that are open.
    depth: usize,
}

/// Groups within each other at most: far more than anybody draws, far fewer than fill the stack.
const DEPTH_MAX: usize = 200;

/// Elements that show nothing, or nothing that stands in the way of light.
const NOTHING: [&str; 7] =
    ["defs", "title", "desc", "metadata", "style", "text", "animateTransform"];

/// The names and values of an element's style.
fn styles<'a>(node: Node<'a, '_>) -> impl Iterator<Item = (&'a str, &'a str)> {
    let style = node.attribute("style").unwrap_or("");
    style
        .split(';')
        .filter_map(|s| s.split_once(':'))
        .map(|(name, value)| (name.trim(), value.trim()))
}

fn is_hidden(node: Node<'_, '_>) -> bool {
    node.attribute("display") == Some("none")
        || styles(node).any(|style| style == ("display", "none"))
}

impl Reader {
    fn children(&mut self, node: Node<'_, '_>, place: &Place) -> Result<(), SvgError> {
        let elements = node.children().filter(Node::is_element);
        elements.into_iter().try_for_each(|child| self.element(child, place))
    }

    fn element(&mut self, node: Node<'_, '_>, place: &Place) -> Result<(), SvgError> {
        let foreign =
            node.tag_name().namespace().is_some_and(|ns| ns != "http://www.w3.org/2000/svg");
        let tag = node.tag_name().name();
        if foreign || NOTHING.contains(&tag) || is_hidden(node) {
            return Ok(());
        }
        if styles(node).any(|(name, _)| name == "transform") {
            let what = "its style has a transform, which is not read";
            return fault(what, "write it as the attribute transform").map_err(|f| at(node, f));
        }
        let inner = self.enter(node, place).map_err(|fault| at(node, fault))?;
        if tag == "g" {
            if self.depth == DEPTH_MAX {
                let what = format!("it is in more than {DEPTH_MAX} groups, one in the other");
                return fault(what, "take it out of groups that do nothing")
                    .map_err(|f| at(node, f));
            }
            self.depth += 1;
            self.children(node, &inner)?;
            self.depth -= 1;
            return Ok(());
        }
        self.shapes += 1;
        let animated = |tag: &str| tag.starts_with("animate") || tag == "set";
        if let Some(child) = node.children().find(|c| animated(c.tag_name().name())) {
            let what = format!("its <{}> is not read", child.tag_name().name());
            return fault(what, "put it into a <g> and move that by animateTransform")
                .map_err(|f| at(node, f));
        }
        let chains = shape(node).map_err(|fault| at(node, fault))?;
        self.draw(node, &chains, &inner).map_err(|fault| at(node, fault))
    }

    /// What holds within an element.
    fn enter(&mut self, node: Node<'_, '_>, place: &Place) -> Result<Place, Fault> {
        let mut inner = Place { ink: ink(node, &place.ink)?, ..place.clone() };
        let group = node.tag_name().name() == "g";
        if let Some(moved) = motion::of(node, &place.world)? {
            if place.moves {
                return fault("it moves within something that moves", "give it a group of its own");
            }
            if !group {
                return fault("only groups move", "put it into a <g> and animate that");
            }
            inner.body = Some(self.begin(node, moved.motion));
            (inner.world, inner.moves) = (moved.world, true);
            return Ok(inner);
        }
        inner.world = place.world * transform::of(node)?;
        if group && inner.body.is_none() {
            inner.body = Some(self.begin(node, Motion::default()));
        }
        Ok(inner)
    }

    fn begin(&mut self, node: Node<'_, '_>, motion: Motion) -> usize {
        let number = self.bodies.len() + 1;
        let name = node.attribute("id").map_or_else(|| format!("body{number}"), str::to_owned);
        self.bodies.push(Drawn { name, motion, walls: Vec::new() });
        number - 1
    }

    fn draw(&mut self, node: Node<'_, '_>, chains: &[Chain], place: &Place) -> Result<(), Fault> {
        let tag = node.tag_name().name();
        let name =
            node.attribute("id").map_or_else(|| format!("{tag}{}", self.shapes), str::to_owned);
        let mut walls = Vec::new();
        for chain in chains {
            let mut points: Vec<DVec2> =
                chain.points.iter().map(|&p| place.world.transform_point2(p)).collect();
            if let Some(far) = points.iter().find(|p| !is_place(&p.to_array())) {
                let what = format!(
                    "it has a point at ({:e}, {:e}) m, further out than {COORDINATE_MAX_M:e} m",
                    far.x, far.y
                );
                return fault(what, "draw it nearer to the origin, or say data-units-per-metre");
            }
            if chain.closed && points.len() > 2 && points.first() == points.last() {
                points.pop();
            }
            if let Some(front) = place.ink.front {
                turn(&mut points, chain.closed, front)?;
            }
            let count = if chain.closed { points.len() } else { points.len().saturating_sub(1) };
            self.segments += count;
            if self.segments > SEGMENTS_MAX {
                return fault(size::said(), "draw less, or with fewer corners");
            }
            for k in 0..count {
                let local = Segment { start: points[k], end: points[(k + 1) % points.len()] };
                walls.push((local, place.ink.material));
            }
        }
        if walls.is_empty() {
            return fault("it has fewer than two points", "give it more, or leave it out");
        }
        let several = walls.len() > 1;
        let named = walls.into_iter().enumerate().map(|(k, (local, material))| {
            let name = if several { format!("{name}.{}", k + 1) } else { name.clone() };
            Wall { name, local, material }
        });
        let named: Vec<Wall> = named.collect();
        // What is wrong with a wall is said here, where its element is known.
        let mut alone = FlatScene::new();
        for Wall { name, local, material } in &named {
            alone
                .wall(name, *local, *material)
                .map_err(|error| (error.to_string(), "mend it, or leave it out".to_owned()))?;
        }
        let body = place.body.unwrap_or_else(|| self.loose());
        self.bodies[body].walls.extend(named);
        Ok(())
    }

    /// The body of what is in no group.
    fn loose(&mut self) -> usize {
        *self.loose.get_or_insert_with(|| {
            let (name, motion) = ("scene".to_owned(), Motion::default());
            self.bodies.push(Drawn { name, motion, walls: Vec::new() });
            self.bodies.len() - 1
        })
    }

    /// Everything together; groups without walls are none.
    fn scene(self) -> Result<FlatScene, SceneError> {
        let mut scene = FlatScene::new();
        for body in self.bodies.into_iter().filter(|body| !body.walls.is_empty()) {
            scene.body(&body.name, body.motion)?;
            for Wall { name, local, material } in &body.walls {
                scene.wall(name, *local, *material)?;
            }
        }
        scene.check()?;
        Ok(scene)
    }
}

/// What an element says of its material, over what it was handed down.
fn ink(node: Node<'_, '_>, from: &Ink) -> Result<Ink, Fault> {
    let mut ink = from.clone();
    let numbers = |name: &str| {
        let found = node.attribute(name).map(|text| channels(name, Some(text.trim())));
        found.transpose().map_err(|what| (what, "such as 0.5, or 0.5,0.2,0.1 for RGB".to_owned()))
    };
    if let Some(value) = numbers("data-reflectance")? {
        ink.material.reflectance = value;
    }
    if let Some(value) = numbers("data-emit")? {
        ink.material.exitance = value;
    }
    match node.attribute("data-two-sided") {
        None => {}
        Some("true" | "") => ink.material.two_sided = true,
        Some("false") => ink.material.two_sided = false,
        Some(other) => {
            return fault(format!("data-two-sided is `{other}`"), "write true or false");
        }
    }
    match node.attribute("data-front") {
        None => {}
        Some("inside") => ink.front = Some(Front::Inside),
        Some("outside") => ink.front = Some(Front::Outside),
        Some(other) => {
            return fault(format!("data-front is `{other}`"), "write inside or outside");
        }
    }
    Ok(ink)
}

/// Turns a closed chain round if its fronts are on the wrong side.
fn turn(points: &mut [DVec2], closed: bool, front: Front) -> Result<(), Fault> {
    if !closed {
        return fault(
            "data-front is of closed shapes only",
            "close it, or leave data-front out: the front is on the left from start to end",
        );
    }
    let twice: f64 =
        (0..points.len()).map(|k| points[k].perp_dot(points[(k + 1) % points.len()])).sum();
    // Counter-clockwise has its left inside.
    if (twice > 0.0) != (front == Front::Inside) {
        points.reverse();
    }
    Ok(())
}

/// A number of an attribute; `otherwise` where there is none.
fn number(node: Node<'_, '_>, name: &str, otherwise: f64) -> Result<f64, Fault> {
    let Some(text) = node.attribute(name) else { return Ok(otherwise) };
    let found = text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    found.ok_or_else(|| {
        (format!("{name} is `{text}`"), "write a plain number, without a unit".to_owned())
    })
}

/// The points of a shape, in its own units.
fn shape(node: Node<'_, '_>) -> Result<Vec<Chain>, Fault> {
    let n = |name| number(node, name, 0.0);
    let points = || path::points(node.attribute("points").unwrap_or(""));
    Ok(match node.tag_name().name() {
        "line" => {
            let points = vec![DVec2::new(n("x1")?, n("y1")?), DVec2::new(n("x2")?, n("y2")?)];
            vec![Chain { points, closed: false }]
        }
        "polyline" => vec![Chain { points: points()?, closed: false }],
        "polygon" => vec![Chain { points: points()?, closed: true }],
        "rect" => {
            if n("rx")? != 0.0 || n("ry")? != 0.0 {
                return fault("its corners are round", "leave out rx and ry, or draw a polygon");
            }
            let (lo, size) = (DVec2::new(n("x")?, n("y")?), DVec2::new(n("width")?, n("height")?));
            if size.min_element() <= 0.0 {
                return fault("it has no width or no height", "draw a line instead");
            }
            let at = |x: f64, y: f64| lo + size * DVec2::new(x, y);
            let points = vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
            vec![Chain { points, closed: true }]
        }
        "path" => path::chains(node.attribute("d").unwrap_or(""))?,
        "circle" | "ellipse" => {
            return fault(
                "it has no straight parts",
                "draw a polygon with as many corners as you need",
            );
        }
        "animateMotion" | "animate" | "set" => {
            return fault("it is not read", "move groups by animateTransform");
        }
        other => {
            return fault(
                format!("<{other}> is not read"),
                "draw line, polyline, polygon, rect or path, in groups, or leave it out",
            );
        }
    })
}

#[cfg(test)]
mod tests;
