//! SWC, the text format for trees of neurons and vessels: one line per node.
//!
//! Columns `id type x y z radius parent`, ids from 1, parent -1 for a root; lines that begin with `#` are comments.
//! Source: Cannon, Turner, Pyapali & Wheal, "An on-line archive of reconstructed hippocampal neurons" (1998), and the
//! `SWCplus` specification (neuroinformatics.nl/swcPlus). A file may have several roots.

use crate::synthesis::io::{WriteError, lines::comment_lines, write_atomically};
use crate::synthesis::tree::{NO_PARENT, VesselKind, VesselTree};
use crate::synthesis::units::Scale;
use std::io::{self, Write};
use std::path::Path;

/// The contents of an SWC file besides the tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SwcOptions {
    /// Size of a tissue length. With it, lengths are written in micrometres, as other programs take those of an SWC
    /// file to be, and the header names the unit.
    ///
    /// Default: none. Lengths are written as they are, and the file says nothing about units.
    pub scale: Option<Scale>,
    /// Lines of the header, such as the units of lengths, the seed and the preset. A line break begins a new line.
    ///
    /// Default: none. The name and version of this crate and the names of the columns are always written.
    pub comments: Vec<String>,
    /// The type column of every node: 0 is undefined, 1 to 7 are parts of neurons and glia, other values are up to the
    /// user. [`swc_structure`] gives the value for a kind of vessels.
    ///
    /// Default: 0.
    pub structure: u32,
}

/// The type column of this crate for vessels of a kind: 10 for arteries, 11 for veins, 12 for portal veins, 13 for
/// ducts. The format has no types of its own for vessels.
pub fn swc_structure(kind: VesselKind) -> u32 {
    FIRST_STRUCTURE + kind.index() as u32
}

/// The kind of vessels for a type column; `None` for types that [`swc_structure`] doesn't give.
pub fn kind_of_swc_structure(structure: u32) -> Option<VesselKind> {
    VesselKind::ALL.get(structure.checked_sub(FIRST_STRUCTURE)? as usize).copied()
}

/// The type of arteries.
const FIRST_STRUCTURE: u32 = 10;

const MICROMETRES_PER_METRE: f64 = 1e6;

/// Writes a tree to an SWC file, whole or not at all. See [`write_swc`].
///
/// # Errors
/// Those of [`write_atomically`].
pub fn save_swc(path: impl AsRef<Path>, tree: &VesselTree, options: &SwcOptions) -> Result<(), WriteError> {
    write_atomically(path, |out| write_swc(out, tree, options))
}

/// Writes a tree as SWC, nodes in the tree's order, lengths as they are or in micrometres.
///
/// Every number has enough digits to be read back to the same bits. An empty tree gives only a header. Lengths beyond
/// ±[`MAX_COORDINATE`](crate::synthesis::mesh::MAX_COORDINATE) are written, but not read again.
///
/// # Errors
/// Those of `out`.
pub fn write_swc(mut out: impl Write, tree: &VesselTree, options: &SwcOptions) -> io::Result<()> {
    writeln!(out, "# {} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"))?;
    if let Some(scale) = options.scale {
        writeln!(out, "# unit: um; a tissue length is {} m", scale.metres())?;
    }
    for line in comment_lines(&options.comments) {
        writeln!(out, "# {line}")?;
    }
    let written = |length: f32| match options.scale {
        Some(scale) => (scale.to_metres(length) * MICROMETRES_PER_METRE) as f32,
        None => length,
    };
    writeln!(out, "# id type x y z radius parent")?;
    let nodes = tree.positions().iter().zip(tree.radii()).zip(tree.parents());
    for (index, ((position, radius), &parent)) in nodes.enumerate() {
        let (id, structure) = (index + 1, options.structure);
        let [x, y, z, radius] = [position.x, position.y, position.z, *radius].map(written);
        write!(out, "{id} {structure} {x} {y} {z} {radius} ")?;
        if parent == NO_PARENT {
            writeln!(out, "-1")?;
        } else {
            writeln!(out, "{}", u64::from(parent) + 1)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_a_type_that_leads_back() {
        for kind in VesselKind::ALL {
            assert_eq!(kind_of_swc_structure(swc_structure(kind)), Some(kind));
        }
        assert!([0, 4, 7, 9, 14, u32::MAX].into_iter().all(|other| kind_of_swc_structure(other).is_none()));
    }
}
