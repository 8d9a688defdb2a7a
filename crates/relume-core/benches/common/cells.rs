//! Irradiance in the mean over equal cells of every patch, and how far two solutions are apart.
//!
//! Means, not points: at the edge of a shadow an element is right in the mean and wrong on either
//! side, so a norm over points would measure where the sample points lie. The means are exact, since
//! leaves are rectangles and irradiance is linear over each. Rectangular patches only.

use glam::DVec2;
use relume_core::scene::PatchId;
use relume_core::session::{Leaf, Snapshot};

/// Mean irradiance over the cells of a `side` x `side` grid on every patch, of one solution.
pub(crate) struct Cells {
    side: usize,
    /// Area of a cell of each patch, m2; 0 while its body is absent.
    areas_m2: Vec<f64>,
    /// Mean over the cell and the three channels, W/m2; patch by patch, row by row.
    irradiance: Vec<f64>,
}

/// What an error is divided by.
#[derive(Clone, Copy)]
pub(crate) enum Against {
    /// The cell's own irradiance and a tenth of the scene's mean: as the error oracle weighs.
    Cell,
    /// The root mean square irradiance of the scene.
    Scene,
}

impl Cells {
    /// The cells of a solution.
    pub(crate) fn of(snapshot: &Snapshot, side: usize) -> Cells {
        let patches = snapshot.scene.patches.len();
        let mut cells =
            Cells { side, areas_m2: Vec::with_capacity(patches), irradiance: Vec::new() };
        for patch in 0..patches {
            cells.add_patch(snapshot, PatchId(patch as u32));
        }
        cells
    }

    /// Means of the cells of one patch, row by row, W/m2.
    pub(crate) fn of_patch(&self, id: PatchId) -> &[f64] {
        let each = self.side * self.side;
        &self.irradiance[id.0 as usize * each..][..each]
    }

    fn add_patch(&mut self, snapshot: &Snapshot, id: PatchId) {
        let (side, first) = (self.side, self.irradiance.len());
        self.irradiance.resize(first + side * side, 0.0);
        let leaves = snapshot.leaves_of(id);
        if leaves.is_empty() {
            self.areas_m2.push(0.0);
            return;
        }
        let patch = Rectangle::new(&snapshot.scene.patches[id.0 as usize].corners, side);
        let mut covered = 0.0;
        for leaf in leaves {
            covered += patch.add(leaf, &mut self.irradiance[first..]);
        }
        let whole = (side * side) as f64;
        assert!((covered / whole - 1.0).abs() < 1e-4, "leaves tile a rectangle: {covered}");
        self.areas_m2.push(patch.u.length() * patch.v.length() / whole);
    }

    /// Area-weighted root mean square of the difference to a reference, relative.
    pub(crate) fn error(&self, reference: &Cells, against: Against) -> f64 {
        let area: f64 = self.areas_m2.iter().sum::<f64>() * (self.side * self.side) as f64;
        (self.squares(reference, against).iter().sum::<f64>() / area).sqrt()
    }

    /// The patch with the largest part of the squared error, and that part.
    pub(crate) fn worst(&self, reference: &Cells, against: Against) -> (PatchId, f64) {
        let squares = self.squares(reference, against);
        let largest = (0..squares.len()).max_by(|&a, &b| squares[a].total_cmp(&squares[b]));
        let largest = largest.expect("a scene has patches");
        (PatchId(largest as u32), squares[largest] / squares.iter().sum::<f64>())
    }

    /// Squared relative difference to a reference, times area; summed over each patch.
    fn squares(&self, reference: &Cells, against: Against) -> Vec<f64> {
        let mean = reference.mean(|h| h);
        let scene = reference.mean(|h| h * h).sqrt();
        let square = |(found, h): (&f64, &f64)| {
            let by = match against {
                Against::Cell => h + 0.1 * mean,
                Against::Scene => scene,
            };
            ((found - h) / by).powi(2)
        };
        let each = self.side * self.side;
        let pairs = self.irradiance.chunks(each).zip(reference.irradiance.chunks(each));
        pairs
            .zip(&self.areas_m2)
            .map(|((found, wanted), area)| area * found.iter().zip(wanted).map(square).sum::<f64>())
            .collect()
    }

    /// Area-weighted mean of `f` of the cells.
    fn mean(&self, f: impl Fn(f64) -> f64) -> f64 {
        let each = self.side * self.side;
        let patches = self.irradiance.chunks(each).zip(&self.areas_m2);
        let sum = |(cells, area): (&[f64], &f64)| area * cells.iter().map(|&h| f(h)).sum::<f64>();
        patches.map(sum).sum::<f64>() / (self.areas_m2.iter().sum::<f64>() * each as f64)
    }
}

/// A rectangular patch in its plane's frame.
struct Rectangle {
    origin: DVec2,
    u: DVec2,
    v: DVec2,
    side: usize,
}

impl Rectangle {
    fn new(corners: &[DVec2], side: usize) -> Rectangle {
        let [origin, a, c, b] = corners else { panic!("rectangular patches only") };
        let (u, v) = (*a - *origin, *b - *origin);
        let off = (*c - *origin - u - v).length().max(u.dot(v).abs() / u.length());
        assert!(off < 1e-5 * u.length(), "rectangular patches only");
        Rectangle { origin: *origin, u, v, side }
    }

    /// Coordinates in cells, each in 0..side.
    fn cell_of(&self, p: DVec2) -> DVec2 {
        let d = p - self.origin;
        let along = |axis: DVec2| d.dot(axis) / axis.length_squared() * self.side as f64;
        DVec2::new(along(self.u), along(self.v))
    }

    fn point(&self, cell: DVec2) -> DVec2 {
        self.origin + (self.u * cell.x + self.v * cell.y) / self.side as f64
    }

    /// Adds what a leaf brings to the means of the cells it overlaps; its area in cells.
    fn add(&self, leaf: &Leaf, cells: &mut [f64]) -> f64 {
        let corners = leaf.corners.map(|p| self.cell_of(p));
        let lo = corners.iter().fold(DVec2::INFINITY, |m, &c| m.min(c)).max(DVec2::ZERO);
        let top = DVec2::splat(self.side as f64);
        let hi = corners.iter().fold(DVec2::NEG_INFINITY, |m, &c| m.max(c)).min(top);
        let range = |lo: f64, hi: f64| lo.floor() as usize..(hi.ceil() as usize).min(self.side);
        for row in range(lo.y, hi.y) {
            for column in range(lo.x, hi.x) {
                let cell = DVec2::new(column as f64, row as f64);
                let (from, to) = (cell.max(lo), (cell + DVec2::ONE).min(hi));
                // Linear over the leaf: the value in the middle is the mean of the part.
                let h = leaf.irradiance_at(self.point((from + to) * 0.5));
                let part = (to - from).max(DVec2::ZERO);
                let mean = h.iter().map(|&h| f64::from(h)).sum::<f64>() / 3.0;
                cells[row * self.side + column] += mean * part.x * part.y;
            }
        }
        (hi.x - lo.x) * (hi.y - lo.y)
    }
}
