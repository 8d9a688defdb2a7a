//! Which frames of an animation: `0-24`, `0-24x6`, `3,7`, as render farms write them.
//!
//! Frame `k` is the time `k / fps`. Ranges are inclusive. A list is solved in ascending order and
//! each frame once, whatever the order it is written in. Knows numbers only, no scene.

use std::fmt;
use std::str::FromStr;

use relume::scene::FrameRange;

/// Shortfall forgiven when the duration is turned into frames, in frames: key times are stored
/// as 32-bit floats, so 19/24 s reads back a little short of frame 19.
const FRAME_SLACK: f64 = 1e-3;
/// The same for long clips, as a share of the duration: two roundings to 32 bits.
const FRAME_SLACK_OF_ALL: f64 = 1.2e-7;

/// Frames asked for on the command line, not yet compared with an animation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FrameSpec {
    parts: Vec<Part>,
}

/// `first-lastxstep`, inclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    first: u32,
    last: u32,
    step: u32,
}

/// Why text is not a list of frames.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum FrameSpecError {
    /// Nothing between commas, or nothing at all.
    #[error("an empty entry: write frames like 0-24, 0-24x6 or 3,7")]
    Empty,
    /// A piece that should be a frame number is not.
    #[error("`{0}` is not a frame number: write frames like 0-24, 0-24x6 or 3,7")]
    Number(String),
    /// `24-0`.
    #[error("`{last_first}` runs backwards: write {last}-{first}", last_first = format!("{first}-{last}"))]
    Backwards {
        /// Written first.
        first: u32,
        /// Written last, smaller.
        last: u32,
    },
    /// `0-24x0`.
    #[error("a step of 0 never ends: use 1 or more, or leave it out")]
    ZeroStep,
    /// `5x2`.
    #[error("`{0}` has a step but no range: write 0-24x6")]
    StepWithoutRange(String),
}

impl FromStr for FrameSpec {
    type Err = FrameSpecError;

    fn from_str(text: &str) -> Result<FrameSpec, FrameSpecError> {
        let parts =
            text.split(',').map(|part| Part::parse(part.trim())).collect::<Result<_, _>>()?;
        Ok(FrameSpec { parts })
    }
}

impl FrameSpec {
    /// The same as ranges.
    pub(crate) fn ranges(&self) -> Vec<FrameRange> {
        let range = |&Part { first, last, step }: &Part| FrameRange { first, last, step };
        self.parts.iter().map(range).collect()
    }
}

impl Part {
    fn parse(text: &str) -> Result<Part, FrameSpecError> {
        if text.is_empty() {
            return Err(FrameSpecError::Empty);
        }
        let number = |piece: &str| -> Result<u32, FrameSpecError> {
            // `parse` alone would accept "+3".
            let digits = !piece.is_empty() && piece.bytes().all(|b| b.is_ascii_digit());
            let value = if digits { piece.parse().ok() } else { None };
            value.ok_or_else(|| {
                FrameSpecError::Number(if piece.is_empty() { text } else { piece }.to_owned())
            })
        };
        let (range, step) = match text.split_once('x') {
            Some((range, step)) => (range, Some(number(step.trim())?)),
            None => (text, None),
        };
        if step == Some(0) {
            return Err(FrameSpecError::ZeroStep);
        }
        let (first, last) = match range.split_once('-') {
            Some((first, last)) => (number(first.trim())?, number(last.trim())?),
            None if step.is_some() => {
                return Err(FrameSpecError::StepWithoutRange(text.to_owned()));
            }
            None => {
                let only = number(range.trim())?;
                (only, only)
            }
        };
        if last < first {
            return Err(FrameSpecError::Backwards { first, last });
        }
        Ok(Part { first, last, step: step.unwrap_or(1) })
    }
}

impl fmt::Display for FrameSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, part) in self.parts.iter().enumerate() {
            if i > 0 {
                f.write_str(",")?;
            }
            write!(f, "{}", part.first)?;
            if part.last != part.first {
                write!(f, "-{}", part.last)?;
            }
            if part.step != 1 {
                write!(f, "x{}", part.step)?;
            }
        }
        Ok(())
    }
}

/// A frame that the animation does not have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum FrameRangeError {
    /// The scene stands still.
    #[error(
        "frame {frame} was asked for, but nothing in the scene is animated: it has frame 0 only"
    )]
    Still {
        /// The frame asked for.
        frame: u32,
    },
    /// Past the end.
    #[error(
        "frame {frame} is outside the animation, which has frames 0-{last} at {fps} fps ({duration_s:.3} s)"
    )]
    Outside {
        /// The frame asked for.
        frame: u32,
        /// The last frame there is.
        last: u32,
        /// Frames a second.
        fps: f64,
        /// Length of the animation, seconds.
        duration_s: f64,
    },
    /// More frames than can be numbered.
    #[error("{duration_s} s at {fps} fps are more frames than can be counted: use a lower --fps")]
    TooMany {
        /// Frames a second.
        fps: f64,
        /// Length of the animation, seconds.
        duration_s: f64,
    },
}

/// Number of frames of an animation: those at times `k / fps` within `[0, duration_s]`.
///
/// At least one, the frame at time 0, also where nothing moves.
pub(crate) fn frame_count(duration_s: f64, fps: f64) -> Result<u32, FrameRangeError> {
    let frames = duration_s * fps;
    let last = (frames + FRAME_SLACK.max(FRAME_SLACK_OF_ALL * frames).min(0.25)).floor();
    if last < f64::from(u32::MAX) {
        Ok(last.max(0.0) as u32 + 1)
    } else {
        Err(FrameRangeError::TooMany { fps, duration_s })
    }
}

/// Time of a frame, seconds.
pub(crate) fn time_of(frame: u32, fps: f64) -> f64 {
    f64::from(frame) / fps
}

/// The frames to solve, ascending, each once; all of the animation where `spec` is `None`, of which there are
/// `at_least` so many.
pub(crate) fn resolve(
    spec: Option<&FrameSpec>,
    duration_s: f64,
    fps: f64,
    at_least: u32,
) -> Result<Vec<u32>, FrameRangeError> {
    let count = frame_count(duration_s, fps)?.max(at_least);
    let Some(spec) = spec else {
        return Ok((0..count).collect());
    };
    // Compared before the ranges are written out: `0-4000000000` must not fill the memory.
    if let Some(part) = spec.parts.iter().find(|part| part.last >= count) {
        let frame = if part.first >= count { part.first } else { part.last };
        return Err(if count == 1 {
            FrameRangeError::Still { frame }
        } else {
            FrameRangeError::Outside { frame, last: count - 1, fps, duration_s }
        });
    }
    let mut frames: Vec<u32> = spec
        .parts
        .iter()
        .flat_map(|part| (part.first..=part.last).step_by(part.step as usize))
        .collect();
    frames.sort_unstable();
    frames.dedup();
    Ok(frames)
}

/// Every so many of some frames, and the last.
pub(crate) fn every(frames: &[u32], step: usize) -> Vec<u32> {
    let last = frames.len() - 1;
    (0..frames.len()).filter(|k| k.is_multiple_of(step) || *k == last).map(|k| frames[k]).collect()
}

/// Frames as text, runs joined: `0-4, 7, 9-10`.
pub(crate) fn describe(frames: &[u32]) -> String {
    let mut runs: Vec<(u32, u32)> = Vec::new();
    for &frame in frames {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == frame => *last = frame,
            _ => runs.push((frame, frame)),
        }
    }
    let text = |&(first, last): &(u32, u32)| {
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    };
    runs.iter().map(text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(text: &str) -> Vec<u32> {
        resolve(Some(&text.parse().unwrap()), 100.0, 1.0, 1).unwrap()
    }

    #[test]
    fn ranges_are_inclusive_and_lists_are_sorted() {
        assert_eq!(frames("0-4"), [0, 1, 2, 3, 4]);
        assert_eq!(frames("0-24x6"), [0, 6, 12, 18, 24]);
        assert_eq!(frames("0-23x6"), [0, 6, 12, 18]);
        assert_eq!(frames("3,7"), [3, 7]);
        assert_eq!(frames(" 7 , 3 - 5, 4"), [3, 4, 5, 7]);
        assert_eq!(frames("100"), [100]);
    }

    #[test]
    fn every_so_many_and_the_last() {
        assert_eq!(every(&[3, 4, 5, 6], 2), [3, 5, 6]);
        assert_eq!((every(&[7], 5), every(&[1, 2, 3], 1)), (vec![7], vec![1, 2, 3]));
    }

    #[test]
    fn text_comes_back() {
        for text in ["0-24", "0-24x6", "3,7", "1,4-9x2,12"] {
            assert_eq!(text.parse::<FrameSpec>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let error = |text: &str| text.parse::<FrameSpec>().unwrap_err();
        assert_eq!(error(""), FrameSpecError::Empty);
        assert_eq!(error("3,,7"), FrameSpecError::Empty);
        assert_eq!(error("abc"), FrameSpecError::Number("abc".into()));
        assert_eq!(error("-3"), FrameSpecError::Number("-3".into()));
        assert_eq!(error("+3"), FrameSpecError::Number("+3".into()));
        assert_eq!(error("1-2-3"), FrameSpecError::Number("2-3".into()));
        assert_eq!(error("0-24x"), FrameSpecError::Number("0-24x".into()));
        assert_eq!(error("99999999999"), FrameSpecError::Number("99999999999".into()));
        assert_eq!(error("0-24x0"), FrameSpecError::ZeroStep);
        assert_eq!(error("5x2"), FrameSpecError::StepWithoutRange("5x2".into()));
        assert_eq!(error("24-0").to_string(), "`24-0` runs backwards: write 0-24");
    }

    #[test]
    fn whole_animation_by_default() {
        assert_eq!(resolve(None, 0.0, 24.0, 1).unwrap(), [0]);
        assert_eq!(resolve(None, 108.0 / 24.0, 24.0, 1).unwrap().len(), 109);
        // As the file stores it: a 32-bit float a little below 19/24.
        assert_eq!(resolve(None, f64::from(19.0_f32 / 24.0) - 1e-8, 24.0, 1).unwrap().len(), 20);
        assert_eq!(resolve(None, 0.99, 1.0, 1).unwrap(), [0]);
        // Of long clips 32 bits tell less.
        for k in [200_000_u32, 999_999, 1_234_567] {
            let end_s = f64::from((f64::from(k) / 120.0) as f32);
            assert_eq!(frame_count(end_s, 120.0).unwrap(), k + 1);
        }
    }

    #[test]
    fn frames_outside_are_refused_with_the_range_there_is() {
        let ask = |text: &str, duration_s| {
            resolve(Some(&text.parse().unwrap()), duration_s, 24.0, 1).unwrap_err().to_string()
        };
        assert_eq!(
            ask("0-30", 19.0 / 24.0),
            "frame 30 is outside the animation, which has frames 0-19 at 24 fps (0.792 s)"
        );
        assert!(ask("5-4000000000", 1.0).starts_with("frame 4000000000 is outside"));
        assert!(ask("30-40", 1.0).starts_with("frame 30 is outside"));
        assert!(ask("1", 0.0).contains("nothing in the scene is animated"));
        assert!(resolve(None, 1e12, 24.0, 1).is_err());
        assert!(resolve(None, f64::INFINITY, 24.0, 1).is_err());
    }

    #[test]
    fn runs_are_joined() {
        assert_eq!(describe(&[0, 1, 2, 5, 7, 8]), "0-2, 5, 7-8");
        assert_eq!(describe(&[]), "");
    }
}
