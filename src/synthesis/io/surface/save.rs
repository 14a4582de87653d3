//! One door to all formats: by name, or by the extension of a path.

use super::{SurfaceOptions, SurfacePart};
use super::{obj::write_surface_obj, off::write_surface_off, ply::write_surface_ply, stl::write_surface_stl};
use crate::synthesis::io::{WriteError, write_atomically};
use std::io::{self, Write};
use std::path::Path;

/// A format of surface files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SurfaceFormat {
    /// Binary glTF 2.0. Written with the feature `mesh_files` only.
    Glb,
    /// Binary STL.
    Stl,
    /// Binary PLY.
    Ply,
    /// Wavefront OBJ, text.
    Obj,
    /// OFF, text.
    Off,
}

impl SurfaceFormat {
    /// All formats.
    pub const ALL: [Self; 5] = [Self::Glb, Self::Stl, Self::Ply, Self::Obj, Self::Off];

    /// The extension of files in this format: lower case, without a dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Stl => "stl",
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Off => "off",
        }
    }

    /// The format of a path's extension, in upper or lower case; `None` if there is no extension or another one.
    pub fn from_path(path: impl AsRef<Path>) -> Option<Self> {
        let extension = path.as_ref().extension()?;
        Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }
}

/// Writes surfaces to a file, whole or not at all, in the format of its extension. See [`write_surface`].
///
/// ```
/// use bevy_vessels::synthesis::{
///     io::{SurfaceOptions, SurfacePart, save_surface},
///     surface::SurfaceMesh,
///     tree::{VesselKind, VesselTree},
/// };
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let path = std::env::temp_dir().join(format!("bevy_vessels_surface_{}.ply", std::process::id()));
/// let (arteries, surface) = (VesselTree::new(), SurfaceMesh::default());
/// let part = SurfacePart { name: "hepatic artery", ..SurfacePart::new(VesselKind::Artery, &arteries, &surface) };
/// save_surface(&path, &[part], &SurfaceOptions::default())?;
/// assert!(save_surface("arteries.blend", &[part], &SurfaceOptions::default()).is_err());
/// # std::fs::remove_file(path)?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`WriteError::UnknownExtension`]; those of [`write_atomically`] and of [`write_surface`].
pub fn save_surface(path: impl AsRef<Path>, parts: &[SurfacePart], options: &SurfaceOptions) -> Result<(), WriteError> {
    let path = path.as_ref();
    let format = SurfaceFormat::from_path(path).ok_or_else(|| unknown_extension(path))?;
    write_atomically(path, |out| write_surface(out, format, parts, options))
}

fn unknown_extension(path: &Path) -> WriteError {
    let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    let known: Vec<String> = SurfaceFormat::ALL.iter().map(|format| format!(".{}", format.extension())).collect();
    WriteError::UnknownExtension { path: path.to_owned(), extension, known: known.join(", ") }
}

/// Writes surfaces in a format.
///
/// # Errors
/// Those of the format's own function; [`Unsupported`](io::ErrorKind::Unsupported) for GLB without the feature
/// `mesh_files`.
pub fn write_surface(
    out: impl Write,
    format: SurfaceFormat,
    parts: &[SurfacePart],
    options: &SurfaceOptions,
) -> io::Result<()> {
    match format {
        #[cfg(feature = "mesh_files")]
        SurfaceFormat::Glb => super::glb::write_surface_glb(out, parts, options),
        #[cfg(not(feature = "mesh_files"))]
        SurfaceFormat::Glb => {
            let message = "GLB files are written with the feature `mesh_files` of this crate only; turn it on, or write \
                           another format";
            Err(io::Error::new(io::ErrorKind::Unsupported, message))
        }
        SurfaceFormat::Stl => write_surface_stl(out, parts, options),
        SurfaceFormat::Ply => write_surface_ply(out, parts, options),
        SurfaceFormat::Obj => write_surface_obj(out, parts, options),
        SurfaceFormat::Off => write_surface_off(out, parts, options),
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{prism, tree};
    use super::*;
    use crate::synthesis::random::Stream;
    use crate::synthesis::surface::SurfaceMesh;
    use crate::synthesis::tree::VesselKind;
    use rand::RngExt;
    use std::fs;

    fn can_write(format: &SurfaceFormat) -> bool {
        cfg!(feature = "mesh_files") || *format != SurfaceFormat::Glb
    }

    #[test]
    fn extensions_lead_to_formats() {
        for format in SurfaceFormat::ALL {
            let path = format!("some.folder/liver.{}", format.extension());
            assert_eq!(SurfaceFormat::from_path(&path), Some(format));
            assert_eq!(SurfaceFormat::from_path(path.to_uppercase()), Some(format));
        }
        for path in ["", "glb", ".glb", "a.gltf", "a.glb.gz", "stl/", "a."] {
            assert_eq!(SurfaceFormat::from_path(path), None, "{path:?}");
        }
    }

    #[test]
    fn unknown_extensions_are_named_with_the_known_ones() {
        let save = |path| save_surface(path, &[], &SurfaceOptions::default()).unwrap_err().to_string();
        let known = "surfaces are written as .glb, .stl, .ply, .obj, .off";
        assert_eq!(
            save("out/liver.fbx"),
            format!("cannot write out/liver.fbx: \".fbx\" is no known extension; {known}")
        );
        assert_eq!(save("liver"), format!("cannot write liver: it has no extension; {known}"));
    }

    #[test]
    fn files_hold_what_is_written_and_faults_leave_none() {
        let folder = std::env::temp_dir().join(format!("bevy_vessels_save_surface_{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (tree, mesh) = (tree(), prism(4, 3));
        let (part, options) = (SurfacePart::new(VesselKind::Vein, &tree, &mesh), SurfaceOptions::default());
        let mut bad = mesh.clone();
        bad.positions[0].x = f32::NAN;
        let bad = SurfacePart { mesh: &bad, ..part };
        for format in SurfaceFormat::ALL.into_iter().filter(can_write) {
            let path = folder.join("vessels").with_extension(format.extension());
            let fault = save_surface(&path, &[part, bad], &options).unwrap_err().to_string();
            assert!(fault.contains("surface part 1, \"venous\": vertex 0 has the position"), "{fault}");
            assert_eq!(fs::read_dir(&folder).unwrap().count(), 0, "{fault}");
            save_surface(&path, &[part], &options).unwrap();
            let mut bytes = Vec::new();
            write_surface(&mut bytes, format, &[part], &options).unwrap();
            assert!(bytes == fs::read(&path).unwrap() && bytes.len() > 200);
            fs::remove_file(path).unwrap();
        }
        fs::remove_dir(folder).unwrap();
    }

    /// Changes one value of a mesh, to one that may be out of place.
    fn damage(mesh: &mut SurfaceMesh, mut number: impl FnMut(usize) -> usize) {
        let index = [0, 3, 13, 14, 17, 18, u32::MAX - 1, u32::MAX][number(8)];
        let value = [0.0, -1.0, 1e38, f32::MIN_POSITIVE, f32::NAN, f32::INFINITY][number(6)];
        let vertex = number(mesh.positions.len());
        match number(9) {
            0 => mesh.faces[number(16)][number(4)] = index,
            1 => mesh.copies[number(3)] = index,
            2 => mesh.nodes[vertex] = index,
            3 => mesh.positions[vertex].y = value,
            4 => mesh.uvs[vertex].y = value,
            5 => mesh.normals[vertex].x = value,
            6 => mesh.copies = vec![index; number(40)],
            7 => mesh.positions.truncate(vertex),
            _ => mesh.faces[number(16)] = [index; 4],
        }
    }

    #[test]
    fn damaged_meshes_are_errors_before_anything_is_written() {
        let tree = tree();
        let mut refused = 0;
        for seed in 0..2000 {
            let mut rng = Stream::Statistics.rng(seed);
            let mut mesh = prism(4, 3);
            damage(&mut mesh, |below| rng.random_range(0..below));
            let part = SurfacePart::new(VesselKind::Vein, &tree, &mesh);
            let options = SurfaceOptions { triangles: seed % 2 == 0, ..SurfaceOptions::default() };
            for format in SurfaceFormat::ALL.into_iter().filter(can_write) {
                let mut bytes = Vec::new();
                if let Err(error) = write_surface(&mut bytes, format, &[part], &options) {
                    assert_eq!((error.kind(), bytes.len()), (io::ErrorKind::InvalidInput, 0), "seed {seed}: {error}");
                    refused += 1;
                }
            }
        }
        assert!(refused > 1000, "{refused}");
    }

    /// A disk that is full after some bytes.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn errors_of_the_target_are_passed_on() {
        let (tree, mesh) = (tree(), prism(4, 3));
        let part = SurfacePart::new(VesselKind::Vein, &tree, &mesh);
        for format in SurfaceFormat::ALL.into_iter().filter(can_write) {
            let error = write_surface(Full(100), format, &[part], &SurfaceOptions::default()).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        }
    }
}
