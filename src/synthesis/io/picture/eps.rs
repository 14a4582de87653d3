//! Encapsulated PostScript, for papers.

use super::{Picture, color};
use crate::synthesis::{
    io::{WriteError, write_atomically},
    tree::{VesselKind, VesselTree},
};
use std::{
    io::{self, Write},
    path::Path,
};

/// Writes one or more trees to an EPS file, whole or not at all. See [`write_eps`].
///
/// # Errors
/// Those of [`write_atomically`].
pub fn save_eps(path: impl AsRef<Path>, trees: &[(VesselKind, &VesselTree)]) -> Result<(), WriteError> {
    write_atomically(path, |out| write_eps(out, trees))
}

/// Writes one or more trees as EPS 3.0, with the lines of [`write_svg`](super::write_svg).
///
/// # Errors
/// Those of `out`.
pub fn write_eps(mut out: impl Write, trees: &[(VesselKind, &VesselTree)]) -> io::Result<()> {
    let Picture { lines, size: [width, height] } = Picture::of(trees);
    writeln!(out, "%!PS-Adobe-3.0 EPSF-3.0")?;
    writeln!(out, "%%BoundingBox: 0 0 {} {}", width.ceil(), height.ceil())?;
    writeln!(out, "%%HiResBoundingBox: 0 0 {width:.3} {height:.3}")?;
    writeln!(out, "%%Creator: {} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"))?;
    writeln!(out, "%%LanguageLevel: 2\n%%EndComments")?;
    // One line: width, end, start.
    writeln!(out, "/v {{ setlinewidth newpath moveto lineto stroke }} bind def\n1 setlinecap")?;
    for run in lines.chunk_by(|a, b| a.kind == b.kind) {
        let [red, green, blue] = color(run[0].kind).map(|value| f64::from(value) / 255.0);
        writeln!(out, "{red:.3} {green:.3} {blue:.3} setrgbcolor")?;
        for line in run {
            let [[x1, y1], [x2, y2]] = line.ends;
            writeln!(out, "{x2:.3} {y2:.3} {x1:.3} {y1:.3} {:.4} v", line.width)?;
        }
    }
    writeln!(out, "showpage\n%%EOF")
}
