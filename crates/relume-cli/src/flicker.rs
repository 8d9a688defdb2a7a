//! `relume flicker`: how much of what changes in pictures from frame to frame is not the light.
//!
//! Measures only. Pixels are compared that see one place of an unmoved patch in both frames.

use relume::Pose;
use relume::scene::{PatchId, SurfaceId};
use relume::session::{Leaf, Options, Session, Snapshot};
use relume_picture::picture::{self, Layers, Settings, Shading, View};

use crate::args::FlickerArgs;
use crate::clip::{self, Clip, solved};
use crate::failure::Failure;
use crate::frames;
use crate::interrupt;
use crate::light;
use crate::output;
use crate::tuning::REFERENCE_SHARE;
use crate::viewing::Viewing;

/// Ways of drawing that are compared.
const WAYS: [&str; 3] = ["gouraud", "smooth", "cleaned"];

/// Runs the command.
pub(crate) fn flicker(args: &FlickerArgs) -> Result<(), Failure> {
    let clip = Clip::open(&args.source, &args.clip)?;
    light::required(&clip.scene)?;
    clip.warn();
    let clip = clip.without_dark_sides();
    if clip.frames.len() < 2 {
        return Err(Failure::usage("one frame does not flicker")
            .help("ask for two or more with --frames, of a scene in which something moves"));
    }
    let views = Viewing::new(&clip.scene, &args.view)?;
    let options = clip.options(args.update, false)?;
    let tolerance = args.reference.unwrap_or(REFERENCE_SHARE * clip.tolerance);
    let mut session = clip.session_with(options.clone())?;
    let mut finer = clip.session_with(Options { tolerance, ..options })?;
    let mut sums = Sums::default();
    let mut last: Option<Looked> = None;
    for &frame in &clip.frames {
        if interrupt::requested() {
            return Err(Failure::interrupted(format_args!("stopped before frame {frame}")));
        }
        for session in [&mut session, &mut finer] {
            let stepped = session.step(frame, clip.time_of(frame));
            stepped.map_err(|error| clip::step_failure(error, ""))?;
        }
        let view = views.at(&clip.scene, frame, clip.fps())?;
        let now = Looked::new((&session, &finer), view, (args.size.width, args.size.height));
        if let Some(last) = &last {
            sums.add(last, &now);
        }
        last = Some(now);
    }
    output::print(&sums.text(&clip, tolerance, &args.size.to_string()))
}

/// What is seen of a frame.
struct Looked {
    view: View,
    snapshot: Snapshot,
    /// In the order of [`WAYS`].
    ways: [Layers; 3],
    reference: Layers,
    /// Patch that each pixel sees.
    patches: Vec<Option<PatchId>>,
}

impl Looked {
    fn new(
        (session, finer): (&Session, &Session),
        view: View,
        (width, height): (u32, u32),
    ) -> Looked {
        let beside = |session: &Session| picture::direct_lamps(session.scene(), &session.world());
        let snapshot = solved(session).solution_beside(&beside(session));
        let whole = Snapshot { indirect: Vec::new(), lamps: Vec::new(), ..snapshot.clone() };
        let settings =
            |shading| Settings { width, height, shading, samples: 1, ..Settings::default() };
        let ways = [
            picture::layers(&whole, &view, &settings(Shading::Gouraud)),
            picture::layers(&whole, &view, &settings(Shading::Smooth)),
            picture::layers(&snapshot, &view, &settings(Shading::Smooth)),
        ];
        let exact = solved(finer).reconstruction_beside(&beside(finer));
        let reference = picture::layers(&exact, &view, &settings(Shading::Smooth));
        let numbers: Vec<f32> = (0..snapshot.leaves.len()).map(|k| k as f32).collect();
        let seen = picture::numbers_of_leaves(&snapshot, &view, &settings(Shading::Flat), &numbers);
        let patch = |leaf: &Option<f32>| {
            let index = (*leaf)? as u32;
            let after = snapshot.leaf_offsets.partition_point(|&first| first <= index);
            Some(PatchId(after as u32 - 1))
        };
        let patches = seen.values.iter().map(patch).collect();
        Looked { view, snapshot, ways, reference, patches }
    }

    fn pose(&self, patch: PatchId) -> Option<Pose> {
        self.snapshot.world.pose(self.snapshot.scene.patches[patch.0 as usize].body)
    }

    /// Surfaces whose leaves are those of another frame, with their light, bit for bit.
    fn kept(&self, other: &Looked) -> Vec<bool> {
        let scene = &self.snapshot.scene;
        let mut kept = vec![true; scene.surfaces.len()];
        let same = |(one, other): (&Leaf, &Leaf)| {
            (one.facet, one.path) == (other.facet, other.path)
                && one.irradiance == other.irradiance
                && one.irradiance_gradient == other.irradiance_gradient
        };
        for (k, patch) in scene.patches.iter().enumerate() {
            let of = |looked: &Looked| looked.snapshot.leaves_of(PatchId(k as u32)).to_vec();
            let (one, other) = (of(self), of(other));
            let is_kept = one.len() == other.len() && one.iter().zip(&other).all(same);
            let SurfaceId(surface) = patch.surface;
            kept[surface as usize] &= is_kept;
        }
        kept
    }
}

/// What was found over pairs of frames.
#[derive(Default)]
struct Sums {
    /// Pixels that see unmoved surfaces whose light is kept, and others that are unmoved.
    kept: u64,
    others: u64,
    /// Of each way the largest change of radiance on kept surfaces, W/m2/sr.
    most: [f32; 3],
    /// Of each way the sum of squares of what is off elsewhere, W/m2.
    squares: [f64; 3],
    /// Sum of squares of the change there.
    changes: f64,
    /// Sum of irradiances there.
    irradiance: f64,
}

impl Sums {
    fn add(&mut self, before: &Looked, after: &Looked) {
        if before.view != after.view {
            return;
        }
        let kept = before.kept(after);
        for (k, (one, other)) in before.patches.iter().zip(&after.patches).enumerate() {
            let (&Some(patch), true) = (one, one == other) else { continue };
            if before.pose(patch).is_none() || before.pose(patch) != after.pose(patch) {
                continue;
            }
            let surface = before.snapshot.scene.patches[patch.0 as usize].surface;
            if kept[surface.0 as usize] {
                self.kept += 1;
                for way in 0..3 {
                    let [a, b] = [before, after].map(|f| f.ways[way].pixels[k].radiance);
                    let change = (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
                    self.most[way] = self.most[way].max(change);
                }
                continue;
            }
            self.others += 1;
            let change = |of: &dyn Fn(&Looked) -> f64| of(after) - of(before);
            let mean = |layers: &Layers| {
                layers.pixels[k].irradiance.iter().map(|&h| f64::from(h)).sum::<f64>() / 3.0
            };
            let wanted = change(&|looked| mean(&looked.reference));
            self.changes += wanted * wanted;
            self.irradiance += mean(&after.reference);
            for way in 0..3 {
                let off = change(&|looked| mean(&looked.ways[way])) - wanted;
                self.squares[way] += off * off;
            }
        }
    }

    fn text(&self, clip: &Clip, tolerance: f64, size: &str) -> String {
        let pairs = clip.frames.len() as u64 - 1;
        let all = (self.kept + self.others).max(1) as f64;
        let others = self.others.max(1) as f64;
        let share = |squares: f64| {
            let mean = self.irradiance / others;
            if mean > 0.0 { 100.0 * (squares / others).sqrt() / mean } else { 0.0 }
        };
        let mut text = format!(
            "{}, frames {}: {} of {size} pixels at tolerance {}, against a reconstruction at {tolerance:.3}\n\
             surfaces whose light is kept: {:.1} % of the pixels; elsewhere light changes by {:.2} % of its mean (RMS)\n\n\
             {:10}{:>28}{:>28}\n",
            clip.scene.name,
            frames::describe(&clip.frames),
            output::counted(pairs as usize, "change"),
            clip.tolerance,
            100.0 * self.kept as f64 / all,
            share(self.changes),
            "",
            "kept: largest change",
            "elsewhere: change off by",
        );
        for (way, name) in WAYS.iter().enumerate() {
            let most = match self.kept {
                0 => "none seen".to_owned(),
                _ => format!("{} W/m2/sr", self.most[way]),
            };
            let off = format!("{:.2} %", share(self.squares[way]));
            text += &format!("{name:10}{most:>28}{off:>28}\n");
        }
        text
    }
}
