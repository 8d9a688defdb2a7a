//! Numbers out of accessors: any component type, normalised or not, strided, sparse, compressed.
//!
//! Every read is checked against the bytes that are there. Must not know what the numbers mean.

use super::component::Component;
use super::document::Document;
use super::json::Accessor;
use relume_core::scene::SceneError;

/// Elements an accessor without data of its own may declare: they are all zero, but for those that a sparse
/// one replaces. Above any mesh that can be solved; a damaged count costs some 30 MB.
const LARGEST_COUNT: usize = 1 << 20;

impl Document {
    /// The elements of an accessor of N components each; `owner` names who wants them.
    pub(super) fn numbers<const N: usize>(
        &self,
        index: usize,
        owner: &str,
    ) -> Result<Vec<[f64; N]>, SceneError> {
        let accessor =
            self.root.accessors.get(index).ok_or_else(|| self.no_accessor(index, owner))?;
        let wanted = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            16 => "MAT4",
            _ => "VEC4",
        };
        if accessor.kind != wanted {
            let kind = &accessor.kind;
            return Err(self
                .malformed(format!("{owner}: accessor {index} should be {wanted} but is {kind}")));
        }
        let component = self.component(accessor.component_type, index)?;
        let mut values = match (self.streamed(index, owner)?, accessor.buffer_view) {
            (Some(stored), _) => stored,
            (None, Some(_)) => self.dense(accessor, index, component, owner)?,
            (None, None) if accessor.count > LARGEST_COUNT => {
                let count = accessor.count;
                return Err(self.malformed(format!(
                    "{owner}: accessor {index} declares {count} elements without data, more than {LARGEST_COUNT}"
                )));
            }
            (None, None) => {
                self.numbers_fit::<N>(accessor.count, index, owner)?;
                vec![[0.0; N]; accessor.count]
            }
        };
        self.apply_sparse(accessor, index, component, owner, &mut values)?;
        Ok(values)
    }

    /// The elements of a scalar accessor of whole numbers.
    pub(super) fn indices(&self, index: usize, owner: &str) -> Result<Vec<u32>, SceneError> {
        let whole = self
            .root
            .accessors
            .get(index)
            .is_none_or(|a| matches!(a.component_type, 5121 | 5123 | 5125));
        if !whole {
            return Err(self.malformed(format!(
                "{owner}: accessor {index} holds indices but not as unsigned integers"
            )));
        }
        Ok(self.numbers::<1>(index, owner)?.into_iter().map(|[v]| v as u32).collect())
    }

    /// An error if so many elements need more memory than is allowed.
    pub(super) fn numbers_fit<const N: usize>(
        &self,
        count: usize,
        index: usize,
        owner: &str,
    ) -> Result<(), SceneError> {
        let bytes = (count as u64).saturating_mul(size_of::<[f64; N]>() as u64);
        self.fits(format_args!("accessor {index} of {owner}"), bytes)
    }

    fn no_accessor(&self, index: usize, owner: &str) -> SceneError {
        self.malformed(format!("{owner} refers to accessor {index}, which does not exist"))
    }

    fn component(&self, code: u32, index: usize) -> Result<Component, SceneError> {
        Component::of(code).ok_or_else(|| {
            self.malformed(format!("accessor {index} has the unknown component type {code}"))
        })
    }

    fn dense<const N: usize>(
        &self,
        accessor: &Accessor,
        index: usize,
        component: Component,
        owner: &str,
    ) -> Result<Vec<[f64; N]>, SceneError> {
        let (bytes, stride) = self.view(accessor.buffer_view.unwrap_or_default())?;
        let stride = stride.filter(|&s| s > 0).unwrap_or(N * component.size());
        // What cannot be there is damage, however little memory is allowed.
        if accessor.count > bytes.len() {
            return Err(self.too_short(index, owner, accessor.count, bytes.len()));
        }
        self.numbers_fit::<N>(accessor.count, index, owner)?;
        let read = elements(
            bytes,
            accessor.byte_offset,
            stride,
            accessor.count,
            component,
            accessor.normalized,
        );
        read.ok_or_else(|| self.too_short(index, owner, accessor.count, bytes.len()))
    }

    fn too_short(&self, index: usize, owner: &str, count: usize, bytes: usize) -> SceneError {
        self.malformed(format!(
            "{owner}: accessor {index} declares {count} elements, more than its {bytes} bytes hold"
        ))
    }

    fn apply_sparse<const N: usize>(
        &self,
        accessor: &Accessor,
        index: usize,
        component: Component,
        owner: &str,
        values: &mut [[f64; N]],
    ) -> Result<(), SceneError> {
        let Some(sparse) = &accessor.sparse else { return Ok(()) };
        let place = self.component(sparse.indices.component_type, index)?;
        let (bytes, _) = self.view(sparse.indices.buffer_view)?;
        let places = elements::<1>(
            bytes,
            sparse.indices.byte_offset,
            place.size(),
            sparse.count,
            place,
            false,
        );
        let places =
            places.ok_or_else(|| self.too_short(index, owner, sparse.count, bytes.len()))?;
        let (bytes, _) = self.view(sparse.values.buffer_view)?;
        let stride = N * component.size();
        let new = elements(
            bytes,
            sparse.values.byte_offset,
            stride,
            sparse.count,
            component,
            accessor.normalized,
        );
        let new: Vec<[f64; N]> =
            new.ok_or_else(|| self.too_short(index, owner, sparse.count, bytes.len()))?;
        for ([place], value) in places.into_iter().zip(new) {
            let count = values.len();
            let slot = values.get_mut(place as usize).ok_or_else(|| {
                self.malformed(format!(
                    "{owner}: accessor {index} replaces element {place} of {count}"
                ))
            })?;
            *slot = value;
        }
        Ok(())
    }
}

/// Elements of N components from bytes, or `None` if they do not fit.
fn elements<const N: usize>(
    bytes: &[u8],
    offset: usize,
    stride: usize,
    count: usize,
    component: Component,
    normalized: bool,
) -> Option<Vec<[f64; N]>> {
    let size = component.size();
    if count == 0 {
        return Some(Vec::new());
    }
    let last = stride.checked_mul(count - 1)?.checked_add(offset)?;
    if last.checked_add(N * size)? > bytes.len() || stride < N * size {
        return None;
    }
    let element = |i: usize| {
        let at = offset + i * stride;
        std::array::from_fn(|k| {
            component.read(&bytes[at + k * size..at + (k + 1) * size], normalized)
        })
    };
    Some((0..count).map(element).collect())
}
