//! Reading SWC. The format is described in `swc.rs`.

use crate::synthesis::{
    io::{
        lines::{Lines, Utf16, text},
        regular_file::read_whole,
    },
    mesh::MAX_COORDINATE,
    tree::{NO_PARENT, TreeError, VesselTree},
};
use bevy_math::Vec3;
use std::io;
use std::path::{Path, PathBuf};

/// Options for reading a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SwcReadOptions {
    /// Radius for nodes whose own is smaller, zero or negative, as sometimes in traced vessels.
    ///
    /// Units: those of the file. Limits: finite and > 0; otherwise it has no effect.
    /// Default: `None`, which makes such nodes an error.
    pub least_radius: Option<f32>,
}

/// The reason why a file could not be read as a tree.
///
/// A message names lines, never what stands there: the file may not be what its name says.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read: it is missing, no regular file, or larger than 4 GiB.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The path given.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Text of two bytes a letter.
    #[error("{cause}", cause = Utf16::CAUSE)]
    Utf16,
    /// A line with fewer than seven columns.
    #[error("line {line} has {found} columns; a node has 7: id type x y z radius parent")]
    Columns {
        /// The line, from 1.
        line: usize,
        /// Columns found.
        found: usize,
    },
    /// A value that cannot be used.
    #[error("line {line}: {column} must be {expected}")]
    Value {
        /// The line, from 1.
        line: usize,
        /// Name of the column.
        column: &'static str,
        /// The expected value.
        expected: &'static str,
    },
    /// Two nodes with one id.
    #[error("line {line}: the node has the id of the node in line {first}; ids must differ")]
    DuplicateId {
        /// The later line, from 1.
        line: usize,
        /// The earlier line, from 1.
        first: usize,
    },
    /// A parent that the file does not have.
    #[error("line {line}: no node has the parent's id; a root has parent -1")]
    UnknownParent {
        /// The line, from 1.
        line: usize,
    },
    /// Nodes that are their own ancestors.
    #[error("line {line}: the node is its own ancestor; cut the loop, SWC holds trees only")]
    Cycle {
        /// Line of one of them, from 1.
        line: usize,
    },
    /// An invalid tree, such as one with too many nodes.
    #[error(transparent)]
    Tree(#[from] TreeError),
}

/// Reads a tree from an SWC file. See [`read_swc`].
///
/// # Errors
/// Those of [`read_swc`], and a file that cannot be read. Only regular files are read, of at most 4 GiB.
pub fn load_swc(path: impl AsRef<Path>, options: &SwcReadOptions) -> Result<VesselTree, ReadError> {
    let path = path.as_ref();
    let bytes = read_whole(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    read_swc(&bytes, options)
}

/// Reads a tree, or forest, in SWC form. Lengths stay in the units of the file.
///
/// Ids may be any whole numbers from 0 on, in any order, also written as `1.0`. Nodes keep the order of the file if
/// parents come first there; otherwise they are ordered by their distance from the roots. The type column is checked
/// and dropped, as are columns after the seventh. Comments may hold any bytes, a byte order mark is skipped, lines may
/// end in LF, CR LF or CR.
///
/// # Errors
/// The first line that is not a node, refers to a missing node, or closes a loop; a coordinate or radius beyond
/// ±[`MAX_COORDINATE`]; a radius that is not above zero, unless [`SwcReadOptions::least_radius`] raises it.
pub fn read_swc(bytes: &[u8], options: &SwcReadOptions) -> Result<VesselTree, ReadError> {
    let samples = read_samples(bytes, options)?;
    let parents = resolve_parents(&samples)?;
    let order = parents_first(&samples, &parents)?;
    let mut place = vec![NO_PARENT; samples.len()];
    for (new, &old) in order.iter().enumerate() {
        place[old as usize] = new as u32;
    }
    let parent_of = |&old: &u32| match parents[old as usize] {
        NO_PARENT => NO_PARENT,
        parent => place[parent as usize],
    };
    let sample = |&old: &u32| &samples[old as usize];
    Ok(VesselTree::from_arrays(
        order.iter().map(sample).map(|sample| sample.position).collect(),
        order.iter().map(parent_of).collect(),
        order.iter().map(sample).map(|sample| sample.radius).collect(),
    )?)
}

/// One line of a file.
struct Sample {
    line: usize,
    id: i64,
    position: Vec3,
    radius: f32,
    parent: i64,
}

/// The parent's id of a root.
const ROOT: i64 = -1;

fn read_samples(bytes: &[u8], options: &SwcReadOptions) -> Result<Vec<Sample>, ReadError> {
    let bytes = text(bytes).map_err(|Utf16| ReadError::Utf16)?;
    let mut samples = Vec::new();
    for (line, bytes) in Lines::new(bytes) {
        // Comments in old files may have any encoding. Other text that is not UTF-8 fails as a number, with its line.
        let text = String::from_utf8_lossy(bytes.split(|&byte| byte == b'#').next().unwrap_or_default());
        if !text.trim().is_empty() {
            samples.push(parse(&text, line, options)?);
        }
    }
    if samples.len() >= NO_PARENT as usize {
        return Err(TreeError::TooManyNodes { nodes: samples.len() }.into());
    }
    Ok(samples)
}

fn parse(text: &str, line: usize, options: &SwcReadOptions) -> Result<Sample, ReadError> {
    let mut columns = [""; 7];
    let mut found = 0;
    for (column, value) in columns.iter_mut().zip(text.split_whitespace()) {
        *column = value;
        found += 1;
    }
    if found < columns.len() {
        return Err(ReadError::Columns { line, found });
    }
    let [id, structure, x, y, z, radius, parent] = columns;
    let bad = |column, expected| ReadError::Value { line, column, expected };
    let whole = |column, value: &str, least: i64, expected| {
        whole_number(value).filter(|&number| number >= least).ok_or_else(|| bad(column, expected))
    };
    // As in meshes. Up to this, the fourth power of a radius is finite, by which blood flows.
    let number = |column, value: &str| {
        let number = value.parse().ok().filter(|number: &f32| number.abs() <= MAX_COORDINATE);
        number.ok_or_else(|| bad(column, "a number within ±1e9"))
    };
    let id = whole("id", id, 0, "a whole number of at least 0")?;
    whole("type", structure, i64::MIN, "a whole number")?;
    let position = Vec3::new(number("x", x)?, number("y", y)?, number("z", z)?);
    let parent = whole("parent", parent, ROOT, "the id of a node, or -1 for a root")?;
    let own = number("radius", radius)?;
    let least = options.least_radius.filter(|least| least.is_finite()).unwrap_or(0.0);
    let lifted = own.max(least);
    if lifted <= 0.0 {
        return Err(bad("radius", "above 0, or be lifted by the option least_radius"));
    }
    Ok(Sample { line, id, position, radius: lifted, parent })
}

/// A whole number, also one with a decimal point or an exponent, as numerical programs write all columns.
fn whole_number(text: &str) -> Option<i64> {
    /// Up to this, every whole number is an `f64`.
    const MOST: f64 = 9_007_199_254_740_992.0;
    let of_decimals = || {
        let number: f64 = text.parse().ok()?;
        (number.trunc() == number && number.abs() < MOST).then_some(number as i64)
    };
    text.parse().ok().or_else(of_decimals)
}

/// Index of every sample's parent in the file, [`NO_PARENT`] for a root.
fn resolve_parents(samples: &[Sample]) -> Result<Vec<u32>, ReadError> {
    let mut by_id: Vec<u32> = (0..samples.len() as u32).collect();
    by_id.sort_by_key(|&index| samples[index as usize].id);
    for pair in by_id.windows(2) {
        let [first, second] = [pair[0], pair[1]].map(|index| &samples[index as usize]);
        if first.id == second.id {
            return Err(ReadError::DuplicateId { line: second.line, first: first.line });
        }
    }
    let index_of = |sample: &Sample| {
        if sample.parent == ROOT {
            return Ok(NO_PARENT);
        }
        by_id
            .binary_search_by_key(&sample.parent, |&index| samples[index as usize].id)
            .map(|position| by_id[position])
            .map_err(|_| ReadError::UnknownParent { line: sample.line })
    };
    samples.iter().map(index_of).collect()
}

/// The samples' indices in an order with parents first: the file's own, or breadth first from the roots.
fn parents_first(samples: &[Sample], parents: &[u32]) -> Result<Vec<u32>, ReadError> {
    let indices = 0..parents.len() as u32;
    if indices.clone().zip(parents).all(|(index, &parent)| parent == NO_PARENT || parent < index) {
        return Ok(indices.collect());
    }
    let mut by_parent: Vec<u32> = indices.collect();
    by_parent.sort_by_key(|&index| parents[index as usize]);
    let children = |parent: u32| {
        let start = by_parent.partition_point(|&index| parents[index as usize] < parent);
        let end = by_parent.partition_point(|&index| parents[index as usize] <= parent);
        &by_parent[start..end]
    };
    // NO_PARENT is above every index, so roots are handled as its children.
    let mut order = children(NO_PARENT).to_vec();
    let mut next = 0;
    while next < order.len() {
        order.extend_from_slice(children(order[next]));
        next += 1;
    }
    if order.len() == parents.len() {
        return Ok(order);
    }
    Err(cycle(samples, parents, &order))
}

/// Names a node on a loop, given the samples that the roots reach.
fn cycle(samples: &[Sample], parents: &[u32], reached: &[u32]) -> ReadError {
    let mut is_reached = vec![false; parents.len()];
    for &index in reached {
        is_reached[index as usize] = true;
    }
    let mut at = is_reached.iter().position(|&is_reached| !is_reached).unwrap_or_default();
    // A node that no root reaches has endless ancestors: after as many steps as there are nodes, this is on a loop.
    for _ in 0..parents.len() {
        at = parents.get(at).map_or(at, |&parent| parent as usize);
    }
    ReadError::Cycle { line: samples[at].line }
}
