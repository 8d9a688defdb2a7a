//! Which of a scene's things form factors are summed between.

use std::collections::BTreeSet;

use crate::scene::{Patch, Scene};

/// The things between which form factors are summed: for each patch its group, if it is in any.
///
/// Light that reaches a patch of no group counts as escaped. A grouping is for one scene, [`Frame::scene`](crate::session::Frame::scene)
/// of the frame that is read: inserting or removing a body makes another scene from the next solve on.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Grouping {
    /// A name for each group; unique.
    pub names: Vec<String>,
    /// Group of each patch, an index of `names`; indexed by `PatchId`.
    pub of_patch: Vec<Option<u32>>,
    /// Digest of the bodies and surfaces of the scene.
    scene: u64,
}

/// Error of a grouping that does not fit a frame.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GroupingError {
    /// It is for a scene with other bodies.
    #[error(
        "the grouping is for a scene with other bodies than the frame's: make it of the scene that the frame has, and anew \
         after the solve that follows an insertion or a removal"
    )]
    OtherScene,
    /// A patch has a group without a name.
    #[error(
        "patch {patch} is in group {group}, and {count} groups have names: add names, or change the group of the patch"
    )]
    NoName {
        /// Index of the patch.
        patch: usize,
        /// Index of the group.
        group: u32,
        /// Number of names.
        count: usize,
    },
}

/// Digest (FNV-1a) of the bodies and surfaces of a scene's patches, and of their names.
fn digest(scene: &Scene) -> u64 {
    let add = |digest: u64, part: u64| (digest ^ part).wrapping_mul(0x0100_0000_01b3);
    let ids = scene.patches.iter().flat_map(|patch| [patch.body.0, patch.surface.0]);
    let of_ids = ids.map(u64::from).fold(0xcbf2_9ce4_8422_2325, add);
    let bodies = scene.bodies.iter().map(|body| &body.name);
    let names = bodies.chain(scene.surfaces.iter().map(|surface| &surface.name));
    names.flat_map(|name| name.bytes().chain([0xff])).map(u64::from).fold(of_ids, add)
}

impl Grouping {
    /// Each body of a scene, by name. The second sides of double-sided polygons are a group of their
    /// own, with `back` behind the name: the inside of a box that was exported double-sided.
    pub fn by_body(scene: &Scene) -> Grouping {
        let names = scene.bodies.iter().map(|b| b.name.as_str());
        Grouping::by_sides(scene, names.collect(), |patch| patch.body.0)
    }

    /// Each surface of a scene, by name; second sides as in [`Grouping::by_body`].
    pub fn by_surface(scene: &Scene) -> Grouping {
        let names = scene.surfaces.iter().map(|s| s.name.as_str());
        Grouping::by_sides(scene, names.collect(), |patch| patch.surface.0)
    }

    fn by_sides(scene: &Scene, names: Vec<&str>, group: impl Fn(&Patch) -> u32) -> Grouping {
        let mut taken: BTreeSet<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let mut both = Vec::with_capacity(2 * names.len());
        for name in names {
            let numbered = (2..).map(|n| format!("{name} back {n}"));
            let back = std::iter::once(format!("{name} back"))
                .chain(numbered)
                .find(|back| !taken.contains(back))
                .unwrap_or_else(|| unreachable!("there are more numbers than names"));
            taken.insert(back.clone());
            both.extend([name.to_owned(), back]);
        }
        Grouping::new(scene, both, |k, patch| {
            2 * group(patch) + u32::from(patch.twin.is_some_and(|front| front.0 < k))
        })
    }

    /// Each patch of a scene: named after its surface, with its number there from 0 on; the second
    /// side of a double-sided polygon has the number of the first and `back` behind it.
    pub fn by_patch(scene: &Scene) -> Grouping {
        let mut next = vec![0; scene.surfaces.len()];
        let mut names: Vec<String> = Vec::with_capacity(scene.patches.len());
        for (k, patch) in scene.patches.iter().enumerate() {
            let name = match patch.twin {
                Some(front) if (front.0 as usize) < k => {
                    format!("{} back", names[front.0 as usize])
                }
                _ => {
                    let surface = patch.surface.0 as usize;
                    next[surface] += 1;
                    format!("{}/{}", scene.surfaces[surface].name, next[surface] - 1)
                }
            };
            names.push(name);
        }
        Grouping::new(scene, names, |k, _| k)
    }

    /// Leaves out groups that hold no patch, or none that is no obstruction.
    fn new(scene: &Scene, names: Vec<String>, group: impl Fn(u32, &Patch) -> u32) -> Grouping {
        let all = (0..).zip(&scene.patches);
        let groups: Vec<Option<u32>> = all
            .map(|(k, p)| (!scene.obstructions.contains(&p.surface)).then(|| group(k, p)))
            .collect();
        let mut number = vec![None; names.len()];
        groups.iter().flatten().for_each(|&g| number[g as usize] = Some(0));
        (0..).zip(number.iter_mut().flatten()).for_each(|(k, n)| *n = k);
        let kept = names.into_iter().zip(&number).filter(|(_, n)| n.is_some());
        Grouping {
            names: kept.map(|(name, _)| name).collect(),
            of_patch: groups.into_iter().map(|g| number[g? as usize]).collect(),
            scene: digest(scene),
        }
    }

    /// An error where it is for another scene, or has a group without a name.
    pub(crate) fn fits(&self, scene: &Scene) -> Result<(), GroupingError> {
        if self.of_patch.len() != scene.patches.len() || self.scene != digest(scene) {
            return Err(GroupingError::OtherScene);
        }
        let count = self.names.len();
        let nameless = |(patch, group): (usize, &Option<u32>)| {
            group.filter(|&group| group as usize >= count).map(|group| (patch, group))
        };
        match self.of_patch.iter().enumerate().find_map(nameless) {
            Some((patch, group)) => Err(GroupingError::NoName { patch, group, count }),
            None => Ok(()),
        }
    }
}
