//! SVG, for web pages and drawing programs.

use super::{Picture, color};
use crate::synthesis::{
    io::{WriteError, write_atomically},
    tree::{VesselKind, VesselTree},
};
use std::{
    io::{self, Write},
    path::Path,
};

/// Writes one or more trees to an SVG file, whole or not at all. See [`write_svg`].
///
/// # Errors
/// Those of [`write_atomically`].
pub fn save_svg(path: impl AsRef<Path>, trees: &[(VesselKind, &VesselTree)]) -> Result<(), WriteError> {
    write_atomically(path, |out| write_svg(out, trees))
}

/// Writes one or more trees as SVG 1.1: a line as wide as the vessel for each segment, seen along the z axis from
/// above, the lowest first.
///
/// The longer side of the picture is 512 points. Arteries are red, veins blue, portal veins violet, ducts green.
///
/// # Errors
/// Those of `out`.
pub fn write_svg(mut out: impl Write, trees: &[(VesselKind, &VesselTree)]) -> io::Result<()> {
    let Picture { lines, size: [width, height] } = Picture::of(trees);
    writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" version=\"1.1\" width=\"{width:.2}pt\" height=\"{height:.2}pt\" \
         viewBox=\"0 0 {width:.2} {height:.2}\" stroke-linecap=\"round\">"
    )?;
    for run in lines.chunk_by(|a, b| a.kind == b.kind) {
        let [red, green, blue] = color(run[0].kind);
        writeln!(out, "<g stroke=\"#{red:02x}{green:02x}{blue:02x}\">")?;
        for line in run {
            // Downwards, as the format has it.
            let [[x1, y1], [x2, y2]] = line.ends.map(|[x, y]| [x, height - y]);
            writeln!(
                out,
                "<line x1=\"{x1:.3}\" y1=\"{y1:.3}\" x2=\"{x2:.3}\" y2=\"{y2:.3}\" stroke-width=\"{:.4}\"/>",
                line.width
            )?;
        }
        writeln!(out, "</g>")?;
    }
    writeln!(out, "</svg>")
}
