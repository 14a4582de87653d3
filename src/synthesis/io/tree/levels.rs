//! CSV of diameters by level: how vessels become thinner from split to split, as OpenCCO's authors compare trees.

use crate::synthesis::io::{WriteError, write_atomically};
use crate::synthesis::tree::{VesselKind, VesselTree};
use std::io::{self, Write};
use std::path::Path;

/// Names of the columns, in order.
const HEADER: &str = "system,level,segments,mean_diameter,sd_diameter,mean_length";

/// Writes the diameters by level of one or more trees to a CSV file, whole or not at all. See [`write_levels`].
///
/// # Errors
/// Those of [`write_atomically`].
pub fn save_levels(
    path: impl AsRef<Path>,
    trees: &[(VesselKind, &VesselTree)],
    millimetres: f64,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_levels(out, trees, millimetres))
}

/// Writes a line for each level of one or more trees as CSV (RFC 4180, with line feeds).
///
/// | column | meaning |
/// |---|---|
/// | `system` | kind of the vessels: `arterial`, `venous`, `portal` or `ductal` |
/// | `level` | splits between the segments and their root, from 0 |
/// | `segments` | their number |
/// | `mean_diameter`, `sd_diameter` | mean and standard deviation of their diameters, in mm |
/// | `mean_length` | their mean length, in mm |
///
/// A tissue length has so many `millimetres`; with 1, lengths are as they are.
///
/// # Errors
/// Those of `out`.
pub fn write_levels(mut out: impl Write, trees: &[(VesselKind, &VesselTree)], millimetres: f64) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    for &(system, tree) in trees {
        for (level, sums) in levels(tree, millimetres).into_iter().enumerate().filter(|(_, sums)| sums.segments > 0) {
            let count = sums.segments as f64;
            let mean = sums.diameter / count;
            let deviation = (sums.square / count - mean * mean).max(0.0).sqrt();
            let length = sums.length / count;
            writeln!(out, "{},{level},{},{mean},{deviation},{length}", system.name(), sums.segments)?;
        }
    }
    Ok(())
}

/// Sums over the segments of a level.
#[derive(Clone, Copy, Default)]
struct Level {
    segments: usize,
    diameter: f64,
    square: f64,
    length: f64,
}

fn levels(tree: &VesselTree, millimetres: f64) -> Vec<Level> {
    let (of, mut levels) = (tree.bifurcation_levels(), Vec::new());
    for (node, _) in tree.segments() {
        let level = of[node] as usize;
        if levels.len() <= level {
            levels.resize(level + 1, Level::default());
        }
        let diameter = 2.0 * f64::from(tree.radii()[node]) * millimetres;
        let sums = &mut levels[level];
        sums.segments += 1;
        sums.diameter += diameter;
        sums.square += diameter * diameter;
        sums.length += f64::from(tree.segment_vector(node).length()) * millimetres;
    }
    levels
}
