//! Accessors: every component type, interleaved or packed, sparse or dense, with every range checked.

use super::document::Document;
use crate::SceneError;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;

/// Most elements of an accessor that has no bytes of its own (all zero, but for sparse ones): a few digits in a file
/// must not fill the memory.
const MAX_ZEROS: u64 = 1 << 24;

impl Document {
    /// An accessor of `N`-vectors (or scalars) of any component type; normalised integers are mapped to −1…1 or 0…1.
    pub(super) fn vectors<const N: usize>(&self, index: usize, place: &str) -> Result<Vec<[f32; N]>, SceneError> {
        let accessor = &self.root.accessors[index];
        let normalized = accessor.normalized;
        self.elements(index, place, [0.0; N], |bytes, component| {
            let size = component.size();
            std::array::from_fn(|i| number(&bytes[i * size..], component, normalized))
        })
    }

    /// An accessor of indices.
    pub(super) fn indices(&self, index: usize, place: &str) -> Result<Vec<u32>, SceneError> {
        let component = self.root.accessors[index].component_type;
        if let Checked::Valid(c) = component
            && !matches!(c.0, ComponentType::U8 | ComponentType::U16 | ComponentType::U32)
        {
            return Err(self.wrong(place, "the component type is no unsigned integer", "5121, 5123 or 5125 would be"));
        }
        let values = self.elements(index, place, [0_u32; 1], |bytes, component| [unsigned(bytes, component)])?;
        Ok(values.into_iter().map(|[i]| i).collect())
    }

    /// Number of components of an accessor's elements.
    pub(super) fn dimension(&self, index: usize) -> usize {
        match self.root.accessors[index].type_ {
            Checked::Valid(t) => t.multiplicity(),
            Checked::Invalid => 0,
        }
    }

    fn elements<T: Copy, const N: usize>(
        &self,
        index: usize,
        place: &str,
        zero: [T; N],
        read: impl Fn(&[u8], ComponentType) -> [T; N],
    ) -> Result<Vec<[T; N]>, SceneError> {
        let accessor = &self.root.accessors[index];
        let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_) else {
            return Err(self.wrong(place, "the accessor's type is unknown", "see the glTF 2.0 specification"));
        };
        let is_matrix = matches!(kind, Type::Mat2 | Type::Mat3 | Type::Mat4);
        if kind.multiplicity() != N || is_matrix {
            return Err(self.wrong(
                place,
                format!("accessors[{index}] has {} components per element", kind.multiplicity()),
                format!("{N} would be right"),
            ));
        }
        let component = component.0;
        let size = N * component.size();
        let count = accessor.count.0;
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |o| o.0);
                let slots = self.slots(view.value(), offset, count, size, place)?;
                slots.map(|bytes| read(bytes, component)).collect()
            }
            None if count <= MAX_ZEROS => vec![zero; count as usize],
            None => {
                return Err(self.wrong(
                    place,
                    format!("accessors[{index}] has {count} elements but no buffer view"),
                    "a buffer view would be right",
                ));
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(index_type) = sparse.indices.component_type else {
                return Err(self.wrong(place, "the type of the sparse indices is unknown", "5125 would be right"));
            };
            let (index_type, n) = (index_type.0, sparse.count.0);
            let at = &sparse.indices;
            let targets = self.slots(at.buffer_view.value(), at.byte_offset.0, n, index_type.size(), place)?;
            let from = &sparse.values;
            let sources = self.slots(from.buffer_view.value(), from.byte_offset.0, n, size, place)?;
            for (target, source) in targets.zip(sources) {
                let target = unsigned(target, index_type);
                let slot = values.get_mut(target as usize).ok_or_else(|| {
                    self.wrong(
                        place,
                        format!("accessors[{index}] has {count} elements but a sparse value for element {target}"),
                        "sparse indices below its count would be right",
                    )
                })?;
                *slot = read(source, component);
            }
        }
        Ok(values)
    }

    /// The bytes of `count` elements of `size` bytes in a buffer view.
    fn slots(
        &self,
        view: usize,
        offset: u64,
        count: u64,
        size: usize,
        place: &str,
    ) -> Result<impl Iterator<Item = &[u8]>, SceneError> {
        let bytes = self.view(view, place)?;
        let stride = self.root.buffer_views[view].byte_stride.map_or(size, |s| s.0);
        let end = (count.checked_sub(1))
            .map_or(Some(0), |last| last.checked_mul(stride as u64)?.checked_add(size as u64)?.checked_add(offset));
        if stride < size || end.is_none_or(|end| end > bytes.len() as u64) {
            return Err(self.wrong(
                place,
                format!(
                    "{count} elements of {size} bytes, {stride} apart from byte {offset} on, do not fit into the {} \
                     bytes of bufferViews[{view}]",
                    bytes.len()
                ),
                "a smaller count or offset, or all of the data, would be right",
            ));
        }
        Ok((0..count as usize).map(move |i| {
            let start = offset as usize + i * stride;
            &bytes[start..start + size]
        }))
    }
}

fn unsigned(bytes: &[u8], component: ComponentType) -> u32 {
    match component {
        ComponentType::U8 => u32::from(bytes[0]),
        ComponentType::U16 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}

/// One component as a number; normalised integers by the glTF 2.0 specification, section 3.6.2.2.
fn number(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let scaled = |value: f32, largest: f32| {
        if normalized { (value / largest).max(-1.0) } else { value }
    };
    match component {
        ComponentType::I8 => scaled(f32::from(bytes[0] as i8), 127.0),
        ComponentType::U8 => scaled(f32::from(bytes[0]), 255.0),
        ComponentType::I16 => scaled(f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
        ComponentType::U16 => scaled(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
        ComponentType::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f32,
        ComponentType::F32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}
