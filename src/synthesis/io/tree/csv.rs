//! CSV of segments, for spreadsheets and data frames: a header, then one line per segment.

use crate::synthesis::io::{WriteError, write_atomically};
use crate::synthesis::tree::{VesselKind, VesselTree};
use std::io::{self, Write};
use std::path::Path;

/// Names of the columns, in order.
const HEADER: &str = "system,id,parent,x0,y0,z0,x1,y1,z1,r0,r1,length,strahler,level,branch";

/// Writes the segments of one or more trees to a CSV file, whole or not at all. See [`write_csv`].
///
/// # Errors
/// Those of [`write_atomically`].
pub fn save_csv(path: impl AsRef<Path>, trees: &[(VesselKind, &VesselTree)]) -> Result<(), WriteError> {
    write_atomically(path, |out| write_csv(out, trees))
}

/// Writes the segments of one or more trees as CSV (RFC 4180, with line feeds), in the order of the trees' nodes.
///
/// | column | meaning |
/// |---|---|
/// | `system` | kind of the vessels: `arterial`, `venous`, `portal` or `ductal` |
/// | `id`, `parent` | indices, from 0, of the segment's end node and of its parent, within that tree |
/// | `x0`, `y0`, `z0`, `x1`, `y1`, `z1` | start and end of the segment, in tissue lengths |
/// | `r0`, `r1` | radius of the parent and of the segment itself, in tissue lengths |
/// | `length` | in tissue lengths |
/// | `strahler` | Strahler order, from 1 |
/// | `level` | splits between the segment and its root |
/// | `branch` | number of the branch within the tree, from 0 |
///
/// Roots have no line of their own. No value needs quotes.
///
/// # Errors
/// Those of `out`.
pub fn write_csv(mut out: impl Write, trees: &[(VesselKind, &VesselTree)]) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    for &(system, tree) in trees {
        let (orders, levels, branches) = (tree.strahler_orders(), tree.bifurcation_levels(), tree.branches());
        for (node, parent) in tree.segments() {
            let [start, end] = [parent, node].map(|node| tree.positions()[node]);
            let [r0, r1] = [parent, node].map(|node| tree.radii()[node]);
            write!(out, "{},{node},{parent},", system.name())?;
            write!(out, "{},{},{},{},{},{},{r0},{r1},", start.x, start.y, start.z, end.x, end.y, end.z)?;
            let length = tree.segment_vector(node).length();
            writeln!(out, "{length},{},{},{}", orders[node], levels[node], branches.of_nodes()[node])?;
        }
    }
    Ok(())
}
