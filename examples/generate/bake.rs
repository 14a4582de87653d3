//! The textures of an organ's vessels: their settings, figures and files.

use super::{Failure, Job, Options};
use bevy_vessels::synthesis::{
    io::{WriteError, save_ktx2, save_png, write_atomically},
    mesh::TriangleMesh,
    texture::{Bake, BakeError, BakeSettings, Canvas, Layer, MapKind, VesselLook},
    tree::{VesselKind, VesselTree},
};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A format of textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MapFormat {
    /// The largest level.
    Png,
    /// All levels, uncompressed.
    Ktx2,
}

impl MapFormat {
    fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Ktx2 => "ktx2",
        }
    }
}

/// What all organs of a batch are painted on.
pub struct Painting {
    canvas: Canvas,
    settings: BakeSettings,
    format: MapFormat,
}

impl Painting {
    /// The canvas of a mesh: with its own chart, or unwrapped if it has none that serves. `None` if no textures are
    /// asked for.
    pub fn new(options: &Options, mesh: Option<&TriangleMesh>) -> Result<Option<Self>, Failure> {
        let Some(size) = options.bake else { return Ok(None) };
        let maps = options.maps.iter().copied().collect();
        let settings = BakeSettings { size, maps, ..BakeSettings::default() };
        settings.validate().map_err(|error| Failure::Usage(format!("--bake {size}: {error}")))?;
        let mesh = mesh
            .ok_or_else(|| Failure::usage("--bake is for the mesh of an organ; disc, ball and box have no texture"))?;
        let named = |error: BakeError| Failure::Run(format!("{}: {error}", options.tissue.display()));
        let canvas = match Canvas::of_mesh(mesh) {
            Ok(canvas) => canvas,
            Err(reason) => {
                eprintln!("generate: {}: {reason}; it is unwrapped here", options.tissue.display());
                Canvas::unwrapped(mesh, None, size).map_err(named)?
            }
        };
        Ok(Some(Self { canvas, settings, format: options.map_format }))
    }

    /// The textures of an organ's vessels, with their figures.
    pub fn bake(&self, trees: &[(VesselKind, &VesselTree)]) -> Result<(Bake, BakeFigures), BakeError> {
        let start = Instant::now();
        // Arteries lie over veins of the same depth.
        let layer = |&(kind, tree)| Layer { tree, look: VesselLook::of(kind) };
        let layers: Vec<Layer<'_>> = trees.iter().rev().map(layer).collect();
        let bake = Bake::new(&self.canvas, &layers, None, &self.settings)?;
        let ms = (1e6 * start.elapsed().as_secs_f64()).round() / 1e3;
        for warning in &bake.report.warnings {
            eprintln!("generate: warning: textures: {warning}");
        }
        let (texels, charts) = (bake.report.texels, bake.report.charts);
        Ok((bake, BakeFigures { ms, texels, charts, files: Vec::new() }))
    }

    /// The files of an organ: one for each map, and the mesh if it was unwrapped.
    pub fn files(&self, job: &Job, seed: u64) -> Vec<PathBuf> {
        let Some(folder) = &job.out else { return Vec::new() };
        let organ = job.run.organ(seed);
        let extension = self.format.extension();
        let maps = MapKind::ALL.into_iter().filter(|&kind| self.settings.maps.has(kind));
        let mut files: Vec<PathBuf> =
            maps.map(|kind| folder.join(format!("{organ}_{}.{extension}", kind.name()))).collect();
        files.extend(self.canvas.sources().map(|_| folder.join(format!("{organ}_unwrapped.obj"))));
        files
    }

    /// Writes all files, in the order of [`files`](Self::files).
    pub fn save(&self, bake: &Bake, files: &[PathBuf]) -> Result<(), WriteError> {
        for (map, path) in bake.maps.iter().zip(files) {
            match self.format {
                MapFormat::Png => save_png(path, map)?,
                MapFormat::Ktx2 => save_ktx2(path, map)?,
            }
        }
        files.get(bake.maps.len()).map_or(Ok(()), |path| self.save_mesh(path))
    }

    fn save_mesh(&self, path: &Path) -> Result<(), WriteError> {
        let canvas = &self.canvas;
        write_atomically(path, |out: &mut dyn Write| -> io::Result<()> {
            for at in canvas.mesh().positions() {
                writeln!(out, "v {} {} {}", at.x, at.y, at.z)?;
            }
            // OBJ counts v from below.
            for uv in canvas.uvs() {
                writeln!(out, "vt {} {}", uv.x, 1.0 - uv.y)?;
            }
            for normal in canvas.normals() {
                writeln!(out, "vn {} {} {}", normal.x, normal.y, normal.z)?;
            }
            for corners in canvas.mesh().triangles() {
                let [a, b, c] = corners.map(|corner| corner + 1);
                writeln!(out, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?;
            }
            Ok(())
        })
    }

    /// What distinguishes these textures from others.
    pub fn described(&self) -> String {
        let maps = MapKind::ALL.into_iter().filter(|&kind| self.settings.maps.has(kind)).map(MapKind::name);
        let maps: Vec<&str> = maps.collect();
        format!("textures: {} texels wide, {} as {}", self.settings.size, maps.join(", "), self.format.extension())
    }
}

/// Figures of the textures of an organ.
#[derive(Debug, Serialize, Deserialize)]
pub struct BakeFigures {
    /// Wall time of the bake alone, in milliseconds.
    ms: f64,
    /// Texels within charts.
    texels: usize,
    /// Charts of the mesh.
    charts: usize,
    /// Written files.
    pub files: Vec<String>,
}
