//! GXL, the XML for graphs, in the dialect of OpenCCO and `VascuSynth`: a node for each node of the tree, an edge for
//! each segment.
//!
//! Source: Winter, Kullbach & Riediger, "An Overview of the GXL Graph Exchange Language" (2002); the dialect is that of
//! the files that OpenCCO (Kerautret et al., IPOL 2023) writes, with its leading spaces in names and values.

use crate::synthesis::{
    cco::VesselFlow,
    io::{WriteError, write_atomically},
    tree::{NodeId, VesselTree},
};
use std::{
    f64::consts::PI,
    io::{self, Write},
    path::Path,
};

/// What a GXL file says besides the tree.
#[derive(Clone, Debug, PartialEq)]
pub struct GxlOptions {
    /// Name of the graph.
    ///
    /// Default: `vessels`.
    pub name: String,
    /// Flow through all terminals together, viscosity and pressures. Each terminal has the same flow.
    ///
    /// Default: that of constrained constructive optimisation.
    pub flow: VesselFlow,
    /// Millimetres of a tissue length.
    ///
    /// Limits: > 0. Default: 1.
    pub millimetres: f64,
    /// Whether positions have two coordinates, as in OpenCCO's flat domains. The third is left out then.
    ///
    /// Default: false.
    pub is_flat: bool,
}

impl Default for GxlOptions {
    fn default() -> Self {
        Self { name: "vessels".into(), flow: VesselFlow::default(), millimetres: 1.0, is_flat: false }
    }
}

/// Writes a tree to a GXL file, whole or not at all. See [`write_gxl`].
///
/// # Errors
/// Those of [`write_atomically`].
pub fn save_gxl(path: impl AsRef<Path>, tree: &VesselTree, options: &GxlOptions) -> Result<(), WriteError> {
    write_atomically(path, |out| write_gxl(out, tree, options))
}

/// Writes a tree as GXL.
///
/// - The graph has the pressures at the root, ` pPerf`, and at the terminals, ` pTerm`, in pascals.
/// - Node `n0`, `n1` … is the tree's node of that number, with its type, ` root node `, ` terminal node ` or
///   ` bifurication ` (so spelled; that of any other node), and its position in mm.
/// - Edge `e1`, `e2` … leads to the node of that number, with its flow in mm³/s, its radius in mm, and the reduced
///   resistance of the segment with all below it (Eq. 6) in Pa·s·mm.
///
/// # Errors
/// Those of `out`.
pub fn write_gxl(mut out: impl Write, tree: &VesselTree, options: &GxlOptions) -> io::Result<()> {
    let attribute = |out: &mut dyn Write, name: &str, value: f64| {
        writeln!(out, "    <attr name=\" {name}\">\n      <float>{value}</float>\n    </attr>")
    };
    let name = escaped(&options.name);
    writeln!(out, "<gxl><graph id=\"{name}\" edgeids=\" true\" edgemode=\" directed\" hypergraph=\" false\">")?;
    writeln!(out, "<info_graph>")?;
    attribute(&mut out, "pPerf", options.flow.root_pressure.pascals())?;
    attribute(&mut out, "pTerm", options.flow.terminal_pressure.pascals())?;
    writeln!(out, "</info_graph>")?;
    let (counts, dimension) = (tree.child_counts(), if options.is_flat { 2 } else { 3 });
    for (node, position) in tree.positions().iter().enumerate() {
        let sort = match (tree.parent(NodeId(node as u32)), counts[node]) {
            (None, _) => "root node",
            (_, 0) => "terminal node",
            _ => "bifurication",
        };
        writeln!(out, "  <node id=\"n{node}\">\n    <attr name=\" nodeType\">\n      <string> {sort} </string>")?;
        writeln!(out, "    </attr>\n    <attr name=\" position\">\n      <tup>")?;
        for &coordinate in &position.to_array()[..dimension] {
            writeln!(out, "        <float>{}</float>", f64::from(coordinate) * options.millimetres)?;
        }
        writeln!(out, "      </tup>\n    </attr>\n  </node>")?;
    }
    let terminals = terminals_below(tree);
    let all = tree.roots().map(|root| terminals[root]).sum::<u64>().max(1);
    let each = options.flow.rate.cubic_metres_per_second() * 1.0e9 / all as f64;
    let resistances = reduced_resistances(tree, options);
    for (node, parent) in tree.segments() {
        writeln!(out, "  <edge id=\"e{node}\" to=\"n{node}\" from=\"n{parent}\">")?;
        attribute(&mut out, "flow", each * terminals[node] as f64)?;
        attribute(&mut out, "resistance", resistances[node])?;
        attribute(&mut out, "radius", f64::from(tree.radii()[node]) * options.millimetres)?;
        writeln!(out, "  </edge>")?;
    }
    writeln!(out, "</graph></gxl>")
}

/// Number of terminals at and below each node. A root that has not grown is none.
fn terminals_below(tree: &VesselTree) -> Vec<u64> {
    let mut terminals = vec![0; tree.len()];
    for tip in tree.tips() {
        terminals[tip as usize] = u64::from(tree.parent(NodeId(tip)).is_some());
    }
    for (node, parent) in reversed(tree) {
        terminals[parent] += terminals[node];
    }
    terminals
}

/// Reduced resistance of each segment with all below it, in Pa·s·mm: `8µl/π + 1/Σ((r_c/r)⁴/R_c)`.
fn reduced_resistances(tree: &VesselTree, options: &GxlOptions) -> Vec<f64> {
    let viscosity = options.flow.viscosity.pascal_seconds();
    let mut below = vec![0.0f64; tree.len()];
    let mut resistances = vec![0.0; tree.len()];
    for (node, parent) in reversed(tree) {
        let length = f64::from(tree.segment_vector(node).length()) * options.millimetres;
        let rest = if below[node] > 0.0 { below[node].recip() } else { 0.0 };
        resistances[node] = 8.0 * viscosity * length / PI + rest;
        let ratio = f64::from(tree.radii()[node]) / f64::from(tree.radii()[parent]);
        below[parent] += ratio.powi(4) / resistances[node];
    }
    resistances
}

/// The segments from the tips to the roots.
fn reversed(tree: &VesselTree) -> impl Iterator<Item = (usize, usize)> {
    let node = |node: usize| Some((node, tree.parent(NodeId(node as u32))?.index()));
    (0..tree.len()).rev().filter_map(node)
}

/// Text within an attribute in quotes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
