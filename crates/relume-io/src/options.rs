//! What to read of a file, whatever its format.

use relume_core::scene::Edits;

/// Options of reading a scene from a file.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Name of the one animation to play; `None` plays all together, as exporters that write one
    /// for each object mean it, but of those that move the same properties the first alone.
    pub animation: Option<String>,
    /// Whether buffers and images may be anywhere: outside the file's folder, and devices or pipes.
    pub allow_outside: bool,
    /// Whether images are kept for pictures, as [`Patch::print`](relume_core::scene::Patch::print); the solution does not need them.
    pub pictures: bool,
    /// Bytes that a file, an image or a list of numbers may need, each by itself: what needs more is refused
    /// before memory is asked for. `None` for no limit.
    pub max_memory_bytes: Option<u64>,
    /// Instants at which meshes that change their shape (skins that bend, morph targets) are read, each a body of its own
    /// that is there until the next one is; `None` holds them in their shape at the start.
    pub rebuild: Option<Instants>,
    /// What of the scene is changed before it is built.
    pub edits: Edits,
    /// Whether a scene that lies far from the origin, by several times its size, is moved there: all of its coordinates, and
    /// those of sensors and poses, are then from [`Scene::origin`](relume_core::scene::Scene::origin) on. Left where it is, what is
    /// close by counts as one there, with a warning.
    pub near_origin: bool,
}

/// Frames of an animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instants {
    /// Frames a second: frame k is the time k / fps.
    pub fps: f64,
    /// Frames that count; all where there are none.
    pub frames: Vec<FrameRange>,
}

/// Every `step`-th frame from `first` to `last`, inclusive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRange {
    /// The first.
    pub first: u32,
    /// The last, not before the first.
    pub last: u32,
    /// At least 1.
    pub step: u32,
}

/// Frames of a clip at most.
const FRAMES_MAX: f64 = 65_536.0;

/// An instant and for how long it stands, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub(crate) time_s: f64,
    pub(crate) presence: [Option<f64>; 2],
}

impl Instants {
    /// The instants of a clip that ends so many seconds after its start, each with when it comes and goes: half a frame before
    /// it and before the next; the first is there from the start, the last stays.
    pub(crate) fn spans(&self, end_s: f64) -> Vec<Span> {
        let last = (end_s * self.fps + 0.25).clamp(0.0, FRAMES_MAX) as u32;
        let counts = |frame: &u32| {
            let within = |range: &FrameRange| {
                (range.first..=range.last).contains(frame)
                    && (frame - range.first).is_multiple_of(range.step.max(1))
            };
            self.frames.is_empty() || self.frames.iter().any(within)
        };
        let frames: Vec<u32> = (0..=last).filter(counts).collect();
        let before = |frame: &u32| (f64::from(*frame) - 0.5) / self.fps;
        let span = |(number, frame): (usize, &u32)| Span {
            time_s: f64::from(*frame) / self.fps,
            presence: [(number > 0).then(|| before(frame)), frames.get(number + 1).map(before)],
        };
        frames.iter().enumerate().map(span).collect()
    }
}

impl Span {
    /// The same as keys of presence, of which the first counts from the start.
    pub(crate) fn keys(&self) -> Vec<(f64, bool)> {
        let [from, to] = self.presence;
        let before = from.map(|_| (0.0, false));
        let keys = [before, Some((from.unwrap_or(0.0), true)), to.map(|to| (to, false))];
        keys.into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_shape_is_there_at_every_frame() {
        let some = vec![FrameRange { first: 2, last: 8, step: 3 }];
        for (frames, wanted) in
            [(Vec::new(), vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]), (some, vec![2, 5, 8])]
        {
            let spans = Instants { fps: 30.0, frames }.spans(f64::from(10.0_f32 / 30.0));
            let times: Vec<f64> = wanted.iter().map(|&k| f64::from(k) / 30.0).collect();
            assert_eq!(spans.iter().map(|s| s.time_s).collect::<Vec<_>>(), times);
            for (number, &time_s) in times.iter().enumerate() {
                let there = |span: &Span| {
                    let keys = span.keys();
                    keys[keys.partition_point(|k| k.0 <= time_s).saturating_sub(1)].1
                };
                let found: Vec<usize> = (0..spans.len()).filter(|&k| there(&spans[k])).collect();
                assert_eq!(found, [number], "at {time_s}");
            }
        }
        assert_eq!(Instants { fps: 24.0, frames: Vec::new() }.spans(0.0).len(), 1);
    }
}
