//! Scenes in the plane as drawings: walls, elements, links. Knows nothing of what a figure is to show.

use glam::DVec2;
use relume::flat::{FlatElement, FlatFrame, FlatLink, FlatScene, PlaneView, Segment};
use relume::pair::EventKind;
use relume_picture::drawing::{Colour, Drawing, Pen};

/// Geometry, letters.
pub(crate) const BLACK: Colour = [30, 30, 30];
/// Links.
pub(crate) const PINK: Colour = [226, 60, 142];
/// What is hidden.
pub(crate) const GREY: Colour = [170, 170, 178];
/// Elements.
pub(super) const BLUE: Colour = [38, 92, 160];

/// The colour of an event.
pub(crate) fn colour_of(kind: EventKind) -> Colour {
    match kind {
        EventKind::Demoted => [205, 30, 30],
        EventKind::Promoted => [30, 90, 220],
        EventKind::Occluded => [90, 60, 150],
        EventKind::Revealed => [20, 150, 80],
        EventKind::Culled => [120, 120, 120],
        EventKind::Woken => [230, 140, 20],
    }
}

/// A part of the plane on a sheet.
pub(super) struct Sheet {
    pub(super) drawing: Drawing,
    lo: DVec2,
    scale: f64,
    margin: f64,
}

/// The part of the plane that a scene fills at some times.
pub(super) fn extent(scene: &FlatScene, times_s: impl Iterator<Item = f64>) -> (DVec2, DVec2) {
    let none = (DVec2::splat(f64::INFINITY), DVec2::splat(f64::NEG_INFINITY));
    times_s.fold(none, |both, time_s| {
        let view = PlaneView::new(scene, time_s);
        view.walls()
            .iter()
            .fold(both, |(lo, hi), w| (lo.min(w.start).min(w.end), hi.max(w.start).max(w.end)))
    })
}

impl Sheet {
    /// A sheet for a part of the plane, with a margin; one pixel is 1 / `scale` m.
    pub(super) fn new((lo, hi): (DVec2, DVec2), scale: f64, margin: f64) -> Sheet {
        let size = (hi - lo) * scale + 2.0 * margin;
        let drawing = Drawing::new(size.x.ceil() as u32, size.y.ceil() as u32);
        Sheet { drawing, lo, scale, margin }
    }

    fn place(&self, p: DVec2) -> [f64; 2] {
        let p = (p - self.lo) * self.scale;
        [self.margin + p.x, f64::from(self.drawing.height) - self.margin - p.y]
    }

    fn line(&mut self, s: &Segment, pen: Pen) {
        let (from, to) = (self.place(s.start), self.place(s.end));
        self.drawing.stroke(from, to, pen);
    }

    /// The walls as thin lines.
    pub(super) fn walls(&mut self, view: &PlaneView) {
        for wall in view.walls() {
            self.line(wall, Pen::new(1.6, BLACK));
        }
    }

    /// The ends of all leaves as ticks across the walls.
    pub(super) fn ticks(&mut self, elements: &[FlatElement]) {
        let reach = 4.0 / self.scale;
        for leaf in elements.iter().filter(|e| e.is_leaf) {
            let across = leaf.place.normal() * reach;
            for end in [leaf.place.start, leaf.place.end] {
                let tick = Segment::new(end - across, end + across);
                self.line(&tick, Pen::new(1.0, BLACK));
            }
        }
    }

    /// Each element as a thick line behind its wall, the farther out the lower it is in the hierarchy.
    pub(super) fn hierarchy(&mut self, elements: &[FlatElement]) {
        for element in elements {
            let out =
                -element.place.normal() * ((9.0 + 8.0 * f64::from(element.level)) / self.scale);
            let along = element.place.along();
            // Round ends reach beyond a stroke's own.
            let short = along * (2.6 / self.scale / element.place.length()).min(0.4);
            let Segment { start, end } = element.place;
            let line = Segment::new(start + out + short, end + out - short);
            self.line(&line, Pen::new(3.2, BLUE));
        }
    }

    /// A link from centre to centre.
    pub(super) fn link(&mut self, a: &Segment, b: &Segment, pen: Pen) {
        self.line(&Segment::new(a.centre(), b.centre()), pen);
    }

    /// Links as they are: fainter where something hides them, dashed where all is hidden.
    pub(super) fn links<'a>(
        &mut self,
        frame: FlatFrame<'_>,
        links: impl IntoIterator<Item = &'a FlatLink>,
        pen: Pen,
    ) {
        let (_, forest) = frame.pairs();
        let place = |id| frame.view().place(forest, id);
        let mut links: Vec<&FlatLink> = links.into_iter().collect();
        links.sort_by_key(|l| l.carried.visibility);
        for link in links {
            let (a, b) = (place(link.a), place(link.b));
            let seen = f64::from(link.carried.visibility());
            if seen > 0.0 {
                let opacity = pen.opacity * (0.25 + 0.75 * seen);
                self.link(&a, &b, Pen { opacity, ..pen });
            } else {
                let (from, to) = (self.place(a.centre()), self.place(b.centre()));
                self.drawing.dashes(from, to, 3.0, Pen::new(0.9, GREY));
            }
        }
    }

    /// The links that events befell, in the events' colours.
    pub(super) fn events(&mut self, frame: FlatFrame<'_>) {
        for event in frame.link_events() {
            let (a, b) = (frame.place_of(event.ends.0), frame.place_of(event.ends.1));
            self.link(&a, &b, Pen::new(1.4, colour_of(event.kind)));
        }
    }

    /// Lettering at a point of the plane.
    pub(super) fn label(&mut self, at: DVec2, height: f64, text: &str) {
        let [x, y] = self.place(at);
        let left = x - 0.5 * Drawing::letters_width(height, text);
        self.drawing.letters([left, y + 0.5 * height], height, text, BLACK);
    }

    /// A caption in the upper left corner.
    pub(super) fn caption(&mut self, text: &str) {
        self.drawing.letters([10.0, 20.0], 9.0, text, BLACK);
    }
}

/// Drawings side by side and one below the other, row by row, `columns` in a row.
pub(crate) fn table(drawings: &[Drawing], columns: usize) -> Drawing {
    let most = |of: &dyn Fn(&Drawing) -> u32| drawings.iter().map(of).max().unwrap_or(0);
    let (width, height) = (most(&|d| d.width), most(&|d| d.height));
    let rows = drawings.len().div_ceil(columns) as u32;
    let mut out = Drawing::new(width * columns as u32, height * rows);
    for (k, drawing) in drawings.iter().enumerate() {
        let (column, row) = ((k % columns) as f64, (k / columns) as f64);
        out.add(drawing, [column * f64::from(width), row * f64::from(height)]);
    }
    out
}
