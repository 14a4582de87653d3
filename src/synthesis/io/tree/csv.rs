//! CSV of segments, for spreadsheets and data frames: a header, then one line per segment.

use crate::synthesis::haemodynamics::Network;
use crate::synthesis::io::{WriteError, write_atomically};
use crate::synthesis::tree::{ByKind, VesselKind, VesselTree};
use crate::synthesis::units::{Flow, Pressure};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// Names of the columns, in order.
const HEADER: &str = "system,id,parent,x0,y0,z0,x1,y1,z1,r0,r1,length,strahler,level,branch";

/// Names of the columns that flows add.
const FLOW_HEADER: &str = "flow_ml_per_min,p0_mmhg,p1_mmhg,velocity_m_per_s,shear_pa";

/// The contents of a CSV file besides the trees.
#[derive(Clone, Copy, Debug, Default)]
pub struct CsvOptions<'a> {
    /// The solved flow in the vessels of each kind. One of them is enough for the file to have the columns of flow;
    /// they are empty for kinds without.
    ///
    /// Default: none, and no such columns.
    pub flows: ByKind<Option<&'a Network>>,
}

/// Writes the segments of one or more trees to a CSV file, whole or not at all. See [`write_csv`].
///
/// # Errors
/// Those of [`write_atomically`] and of [`write_csv`].
pub fn save_csv(
    path: impl AsRef<Path>,
    trees: &[(VesselKind, &VesselTree)],
    options: &CsvOptions,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_csv(out, trees, options))
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
/// With flows, there are more columns:
///
/// | column | meaning |
/// |---|---|
/// | `flow_ml_per_min` | flow into the segment, positive away from the root |
/// | `p0_mmhg`, `p1_mmhg` | pressure at its start and its end |
/// | `velocity_m_per_s` | mean velocity, with the sign of the flow |
/// | `shear_pa` | shear stress at the wall |
///
/// Roots have no line of their own. No value needs quotes.
///
/// # Errors
/// Those of `out`; [`ErrorKind::InvalidInput`], before anything is written, if a flow is not that of its tree.
pub fn write_csv(mut out: impl Write, trees: &[(VesselKind, &VesselTree)], options: &CsvOptions) -> io::Result<()> {
    check_flows(trees, options)?;
    let has_flow = options.flows.values().any(Option::is_some);
    writeln!(out, "{HEADER}{}", if has_flow { format!(",{FLOW_HEADER}") } else { String::new() })?;
    for &(system, tree) in trees {
        let (orders, levels, branches) = (tree.strahler_orders(), tree.bifurcation_levels(), tree.branches());
        for (node, parent) in tree.segments() {
            let [start, end] = [parent, node].map(|node| tree.positions()[node]);
            let [r0, r1] = [parent, node].map(|node| tree.radii()[node]);
            write!(out, "{},{node},{parent},", system.name())?;
            write!(out, "{},{},{},{},{},{},{r0},{r1},", start.x, start.y, start.z, end.x, end.y, end.z)?;
            let length = tree.segment_vector(node).length();
            write!(out, "{length},{},{},{}", orders[node], levels[node], branches.of_nodes()[node])?;
            match options.flows[system] {
                Some(network) => write_flow(&mut out, network, node, parent)?,
                None if has_flow => write!(out, ",,,,,")?,
                None => {}
            }
            writeln!(out)?;
        }
    }
    Ok(())
}

fn write_flow(out: &mut impl Write, network: &Network, node: usize, parent: usize) -> io::Result<()> {
    let flow = Flow::from_cubic_metres_per_second(network.flows()[node]).ml_per_min();
    let [p0, p1] = [parent, node].map(|node| Pressure::from_pascals(network.pressures()[node]).mmhg());
    write!(out, ",{flow},{p0},{p1},{},{}", network.velocity(node), network.wall_shear_stress(node))
}

fn check_flows(trees: &[(VesselKind, &VesselTree)], options: &CsvOptions) -> io::Result<()> {
    for &(kind, tree) in trees {
        let Some(network) = options.flows[kind] else { continue };
        let (flows, nodes) = (network.flows().len(), tree.len());
        if flows != nodes {
            let name = kind.name();
            let message = format!("the {name} flow has {flows} nodes, but the tree {nodes}; solve that of this tree");
            return Err(io::Error::new(ErrorKind::InvalidInput, message));
        }
    }
    Ok(())
}
