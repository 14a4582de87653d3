//! The options of a file, and its remarks: who made it, the unit of its lengths, and the caller's own lines.

use crate::synthesis::io::lines::comment_lines;
use crate::synthesis::units::Scale;

/// The contents of a surface file besides the surfaces, and the form of faces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceOptions {
    /// Size of a tissue length, noted in the file. Coordinates stay in tissue lengths.
    ///
    /// Default: none, and the file says nothing about units.
    pub scale: Option<Scale>,
    /// Lines of the header, such as the seed and the preset. A line break begins a new line. STL has no room for them.
    ///
    /// Default: none. The name and version of this crate are always written.
    pub comments: Vec<String>,
    /// Whether faces with four corners are divided along their shorter diagonal, as GLB and STL always have them.
    ///
    /// Some programs, such as trimesh, read a PLY file only if all its faces have the same number of corners. Modelling
    /// programs prefer faces with four. Default: `false`, they stay whole in PLY, OBJ and OFF.
    pub triangles: bool,
}

impl SurfaceOptions {
    /// All remarks as lines without control characters: the generator, the unit, the comments.
    pub(super) fn lines(&self) -> Vec<String> {
        let unit = self.scale.map(|scale| format!("unit: {} m", scale.metres()));
        [generator()].into_iter().chain(unit).chain(comment_lines(&self.comments)).collect()
    }
}

/// Name and version of this crate.
pub(super) fn generator() -> String {
    format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_are_single_lines() {
        let comments = vec!["seed 7\r\npreset \"liver\"\n\n".to_owned(), "path C:\\x\\\t\u{0}".to_owned()];
        let lines = SurfaceOptions { scale: Some(Scale::MILLIMETRES), comments, triangles: false }.lines();
        assert_eq!(lines[0], generator());
        assert_eq!(lines[1..], ["unit: 0.001 m", "seed 7", "preset \"liver\"", "path C:/x/"]);
        assert_eq!(SurfaceOptions::default().lines(), [generator()]);
    }
}
