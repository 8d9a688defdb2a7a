//! Which of two surfaces that lie in one plane hides the other. Pure bookkeeping; must not know elements.

use super::tuning::LAMP_AREA;
use super::{Enclosure, Patch, PatchId, Scene};
use crate::geometry::{Interval, no_smaller};

/// How a polygon in the plane of an end lies to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InPlane {
    /// It faces the end, or its other side does, and touches it.
    Touches,
    /// It faces the same way and shows in the end's place.
    Covers,
    /// It hides nothing of the end.
    Apart,
}

/// What decides how a patch lies to others in its plane.
#[derive(Clone, Copy, Debug)]
pub struct Sheet {
    /// The patch.
    pub patch: PatchId,
    /// The same polygon seen from behind, if it is two-sided.
    pub twin: Option<PatchId>,
    /// What its surface encloses.
    pub enclosure: Enclosure,
    /// [`Scene::lying_m2`].
    pub lying_m2: f64,
    /// Rounding of its corners in single precision, metres.
    pub rounding_m: f64,
}

/// How a polygon lies to the plane of an end that it is close to.
#[derive(Clone, Copy, Debug)]
pub struct Lying {
    /// Whether it faces the other way.
    pub opposed: bool,
    /// How far its corners are before that plane, metres.
    pub height_m: Interval,
}

impl Scene {
    /// Area by which it is decided which of two patches in one plane shows, m2: the smaller. A lamp counts as a fifth of its own: what
    /// is as large or somewhat smaller is what it lies on, tiles of a ceiling, and not what lies on it.
    pub fn lying_m2(&self, patch: &Patch) -> f64 {
        patch.area_m2() * if self.patch_emits(patch) { LAMP_AREA } else { 1.0 }
    }
}

impl Sheet {
    /// How this patch lies to another one in its plane; `opposed` if it faces the other way.
    ///
    /// A closed body touches what it stands on: where its face lies in the plane of another surface and looks at it, each
    /// hides the other from everything else. Of two surfaces in one plane that face the same way, the smaller shows and
    /// hides the larger (a rug on a floor), where a lamp counts as smaller than it is; of equal ones the first. Two rooms that share a wall's plane are back to back:
    /// neither wall hides the other.
    pub fn lies_to(&self, end: &Sheet, opposed: bool) -> InPlane {
        if self.twin == Some(end.patch) {
            return InPlane::Apart;
        }
        let shows = || if self.shows_before(end) { InPlane::Covers } else { InPlane::Apart };
        match [self, end].map(|sheet| sheet.twin.is_some()) {
            [false, false] if !opposed => shows(),
            [false, false]
                if self.enclosure == Enclosure::Space && end.enclosure == Enclosure::Space =>
            {
                InPlane::Apart
            }
            [false, false] => InPlane::Touches,
            // A body is on the side of a two-sided surface that its face looks at.
            [false, true] if self.enclosure == Enclosure::Body => {
                if opposed {
                    InPlane::Touches
                } else {
                    InPlane::Apart
                }
            }
            [false, true] if opposed => InPlane::Apart,
            [true, false] if end.enclosure == Enclosure::Body => InPlane::Touches,
            _ => shows(),
        }
    }

    /// How this patch lies to another one that is in its plane, or nearly. Where they are further apart than the smaller of their
    /// roundings, the one in front shows and hides the other if that faces the same way (of a two-sided one the side that does), whatever
    /// their sizes, and touches it if they look at each other; otherwise as [`Sheet::lies_to`]. Visibility and coverage both ask this, so that they agree.
    pub fn lies_at(&self, end: &Sheet, Lying { opposed, height_m }: Lying) -> InPlane {
        let told_apart_m = self.rounding_m.min(end.rounding_m);
        let lies = self.lies_to(end, opposed);
        let may_show = !opposed || (self.twin.is_some() && lies != InPlane::Touches);
        match lies {
            _ if may_show && height_m.lo > told_apart_m => InPlane::Covers,
            // They look at each other.
            _ if height_m.lo > told_apart_m => InPlane::Touches,
            _ if !opposed && height_m.hi < -told_apart_m => InPlane::Apart,
            InPlane::Covers if height_m.hi < -told_apart_m => InPlane::Apart,
            lies => lies,
        }
    }

    /// Whether of two coincident patches that face the same way, or whose other sides do, this one shows.
    fn shows_before(&self, other: &Sheet) -> bool {
        let first = |s: &Sheet| s.twin.map_or(s.patch, |twin| twin.min(s.patch));
        let [own, others] = [self, other].map(|sheet| sheet.lying_m2);
        match (no_smaller(own, others), no_smaller(others, own)) {
            (true, true) => first(self) < first(other),
            (is_larger, _) => !is_larger,
        }
    }
}
