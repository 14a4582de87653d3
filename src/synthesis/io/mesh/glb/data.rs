//! The binary data of a document: buffers, and the elements that accessors see in them.

use super::super::read::MeshDataError;
use super::{
    budget::Budget,
    container::decode_base64,
    document::{Accessor, Buffer, Document, Shape, SparsePart, find},
    neighbour,
};
use crate::synthesis::io::regular_file::{MOST_BYTES, read_start};
use std::{
    borrow::Cow,
    cell::{Cell, OnceCell, RefCell},
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// The data of a document, read when it is first asked for.
pub(super) struct Data<'a> {
    document: &'a Document,
    blob: Option<&'a [u8]>,
    /// That of the file; without one, no other files are read.
    folder: Option<&'a Path>,
    buffers: Vec<OnceCell<Loaded<'a>>>,
    /// The first buffer of each file, and the length that it announces.
    files: RefCell<BTreeMap<(PathBuf, u64), u32>>,
    /// Bytes of files so far.
    from_files: Cell<u64>,
    pub(super) budget: Budget,
}

impl<'a> Data<'a> {
    pub(super) fn new(document: &'a Document, blob: Option<&'a [u8]>, folder: Option<&'a Path>) -> Self {
        let buffers = document.buffers.iter().map(|_| OnceCell::new()).collect();
        let (files, from_files) = (RefCell::default(), Cell::default());
        Self { document, blob, folder, buffers, files, from_files, budget: Budget::default() }
    }

    /// The elements of an accessor, each of `N` components.
    pub(super) fn elements<const N: usize>(
        &self,
        accessor: u32,
        shape: Shape,
    ) -> Result<Elements<'_, N>, MeshDataError> {
        let accessor = find(&self.document.accessors, accessor, "an accessor")?;
        if accessor.shape != shape {
            return Err(MeshDataError::content("an accessor is not of the type that its use asks for"));
        }
        let component = Component::new(accessor.component_type)?;
        let count = usize::try_from(accessor.count).ok().filter(|&count| count <= u32::MAX as usize);
        let count = count.ok_or_else(|| MeshDataError::content("an accessor announces too many elements"))?;
        let base = match accessor.buffer_view {
            Some(view) => Some(self.strided(view, accessor.byte_offset, count, N * component.size())?),
            None => None,
        };
        let sparse = self.sparse(accessor, count, N * component.size())?;
        Ok(Elements { component, normalized: accessor.normalized, count, base, sparse })
    }

    /// The elements that a sparse accessor has of its own.
    fn sparse(&self, accessor: &Accessor, count: usize, size: usize) -> Result<Option<Sparse<'_>>, MeshDataError> {
        let Some(sparse) = &accessor.sparse else { return Ok(None) };
        let SparsePart { buffer_view, byte_offset, component_type } = sparse.indices;
        let component = Component::new(component_type)?;
        let own = usize::try_from(sparse.count).unwrap_or(usize::MAX);
        let indices = self.strided(buffer_view, byte_offset, own, component.size())?;
        let values = self.strided(sparse.values.buffer_view, sparse.values.byte_offset, own, size)?;
        self.budget.take(own, 8)?;
        let mut places: Vec<(u32, u32)> =
            (0..own as u32).map(|number| (component.integer(indices.at(number as usize)), number)).collect();
        places.sort_unstable();
        if places.last().is_some_and(|&(place, _)| place as usize >= count) {
            return Err(MeshDataError::content("a sparse accessor refers to an element that is not there"));
        }
        Ok(Some(Sparse { places, values }))
    }

    /// `count` elements of `size` bytes in a view.
    fn strided(&self, view: u32, offset: u64, count: usize, size: usize) -> Result<Strided<'_>, MeshDataError> {
        let view = find(&self.document.buffer_views, view, "a buffer view")?;
        let buffer = self.buffer(view.buffer)?;
        let stride = view.byte_stride.map_or(0, |stride| stride as usize);
        let stride = if stride == 0 { size } else { stride };
        let seen = || {
            let start = usize::try_from(view.byte_offset).ok()?;
            let end = start.checked_add(usize::try_from(view.byte_length).ok()?)?;
            let bytes = buffer.get(start..end)?.get(usize::try_from(offset).ok()?..)?;
            let needed = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size))?;
            (needed <= bytes.len()).then_some(bytes)
        };
        let bytes =
            seen().ok_or_else(|| MeshDataError::content("it is damaged: an accessor reaches beyond its data"))?;
        Ok(Strided { bytes, stride, size })
    }

    /// The bytes of a buffer.
    fn buffer(&self, index: u32) -> Result<&[u8], MeshDataError> {
        let buffer = find(&self.document.buffers, index, "a buffer")?;
        let cell = &self.buffers[index as usize];
        let loaded = match cell.get() {
            Some(loaded) => loaded,
            None => {
                let loaded = self.load(index, buffer)?;
                cell.get_or_init(|| loaded)
            }
        };
        match loaded {
            Loaded::Bytes(bytes) => Ok(bytes),
            Loaded::Same(other) => self.buffer(*other),
        }
    }

    fn load(&self, index: u32, buffer: &Buffer) -> Result<Loaded<'a>, MeshDataError> {
        let Some(uri) = buffer.uri.as_deref() else {
            let blob = self.blob.filter(|_| index == 0).ok_or_else(|| {
                MeshDataError::content("a buffer has no data: it names no file, and the file itself holds none for it")
            });
            return Ok(Loaded::Bytes(Cow::Borrowed(blob?)));
        };
        let Some(data) = uri.strip_prefix("data:") else { return self.file(index, buffer, uri) };
        let bytes = data.split_once(";base64,").and_then(|(_, text)| decode_base64(text));
        let bytes = bytes.ok_or_else(|| MeshDataError::content("the data of a buffer is not valid base64"))?;
        Ok(Loaded::Bytes(Cow::Owned(bytes)))
    }

    /// The file of a buffer, read unless another buffer has read it.
    fn file(&self, index: u32, buffer: &Buffer, uri: &str) -> Result<Loaded<'a>, MeshDataError> {
        let folder = self.folder.ok_or_else(|| {
            MeshDataError::content(
                "its data is in another file, which is found only where the file is read by its path",
            )
        })?;
        let path = neighbour::find(folder, uri)?;
        let wanted = buffer.byte_length;
        let first = *self.files.borrow_mut().entry((path.clone(), wanted)).or_insert(index);
        if first != index {
            return Ok(Loaded::Same(first));
        }
        let left = MOST_BYTES - self.from_files.get();
        let bytes = read_start(&path, wanted.min(left)).map_err(|source| MeshDataError::Data { path, source })?;
        self.from_files.set(self.from_files.get() + bytes.len() as u64);
        self.budget.add_present(bytes.len());
        Ok(Loaded::Bytes(Cow::Owned(bytes)))
    }
}

/// What a buffer holds.
enum Loaded<'a> {
    Bytes(Cow<'a, [u8]>),
    /// The same as another buffer.
    Same(u32),
}

/// The elements of an accessor. They are decoded one at a time, so that an accessor takes no memory.
pub(super) struct Elements<'a, const N: usize> {
    component: Component,
    normalized: bool,
    count: usize,
    /// Without it all are zero, but for the sparse ones.
    base: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Elements in place of others.
struct Sparse<'a> {
    /// Places, in order, each with the number of its value.
    places: Vec<(u32, u32)>,
    values: Strided<'a>,
}

/// Elements at equal distances. All that it holds are there.
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Strided<'a> {
    fn at(&self, number: usize) -> &'a [u8] {
        &self.bytes[number * self.stride..][..self.size]
    }
}

impl<const N: usize> Elements<'_, N> {
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Whether there is any data, so that not all is zero.
    pub(super) fn has_data(&self) -> bool {
        self.base.is_some() || self.sparse.is_some()
    }

    /// An element as floats: normalised by section 3.11 of the glTF 2.0 specification, or unchanged.
    ///
    /// # Panics
    /// If there is no such element.
    pub(super) fn floats(&self, number: usize) -> [f32; N] {
        let read = |bytes: &[u8]| {
            let size = self.component.size();
            std::array::from_fn(|axis| self.component.float(self.normalized, &bytes[axis * size..]))
        };
        self.bytes(number).map_or([0.0; N], read)
    }

    /// An element as unsigned integers.
    ///
    /// # Panics
    /// If there is no such element.
    pub(super) fn integers(&self, number: usize) -> [u32; N] {
        let read = |bytes: &[u8]| {
            let size = self.component.size();
            std::array::from_fn(|axis| self.component.integer(&bytes[axis * size..]))
        };
        self.bytes(number).map_or([0; N], read)
    }

    /// Refuses components that are no unsigned integers.
    pub(super) fn check_unsigned(&self, what: &str) -> Result<(), MeshDataError> {
        match self.component {
            Component::U8 | Component::U16 | Component::U32 => Ok(()),
            _ => Err(MeshDataError::content(format!("{what} are not unsigned integers"))),
        }
    }

    fn bytes(&self, number: usize) -> Option<&[u8]> {
        let own = self.sparse.as_ref().and_then(|Sparse { places, values }| {
            // Of several for one place, the last counts.
            let after = places.partition_point(|&(place, _)| place as usize <= number);
            let &(place, value) = places.get(after.checked_sub(1)?)?;
            (place as usize == number).then(|| values.at(value as usize))
        });
        own.or_else(|| self.base.as_ref().map(|base| base.at(number)))
    }
}

/// The type of a component.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(code: u32) -> Result<Self, MeshDataError> {
        match code {
            5120 => Ok(Self::I8),
            5121 => Ok(Self::U8),
            5122 => Ok(Self::I16),
            5123 => Ok(Self::U16),
            5125 => Ok(Self::U32),
            5126 => Ok(Self::F32),
            _ => Err(MeshDataError::content("an accessor has no valid component type")),
        }
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    fn float(self, normalized: bool, bytes: &[u8]) -> f32 {
        let (value, largest) = match (self, bytes) {
            (Self::I8, &[a, ..]) => (f32::from(a as i8), 127.0),
            (Self::U8, &[a, ..]) => (f32::from(a), 255.0),
            (Self::I16, &[a, b, ..]) => (f32::from(i16::from_le_bytes([a, b])), 32767.0),
            (Self::U16, &[a, b, ..]) => (f32::from(u16::from_le_bytes([a, b])), 65535.0),
            (Self::U32, &[a, b, c, d, ..]) => (u32::from_le_bytes([a, b, c, d]) as f32, u32::MAX as f32),
            (Self::F32, &[a, b, c, d, ..]) => return f32::from_le_bytes([a, b, c, d]),
            // `Strided` gives every component its bytes.
            _ => return f32::NAN,
        };
        if normalized { (value / largest).max(-1.0) } else { value }
    }

    fn integer(self, bytes: &[u8]) -> u32 {
        match (self, bytes) {
            (Self::U8, &[a, ..]) => a.into(),
            (Self::U16, &[a, b, ..]) => u16::from_le_bytes([a, b]).into(),
            (Self::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
            // Not a valid index: the caller refuses it as out of range.
            _ => u32::MAX,
        }
    }
}
