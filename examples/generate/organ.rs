//! One organ: grown, measured, written.

use super::mesh::{Meshed, meshes, save};
use super::report::{CcoFigures, KindMeasures, Line};
use super::{Failure, Format, Job};
use bevy_vessels::synthesis::{
    cco::{Cco, VesselFlow},
    growth::{Growth, StepCount},
    io::{
        GxlOptions, ObjOptions, SwcOptions, WriteError, save_csv, save_eps, save_gxl, save_levels, save_obj, save_svg,
        save_swc, swc_structure,
    },
    roots::Roots,
    tissue::Extent,
    tree::{ByKind, VesselKind, VesselTree, hash_trees},
};
use std::any::Any;
use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Grows organ after organ of a job in the same memory.
pub struct Grower<'a> {
    job: &'a Job,
    roots: Roots,
    growth: Option<Box<dyn Growth>>,
}

impl<'a> Grower<'a> {
    /// Nothing grown yet.
    pub fn new(job: &'a Job) -> Self {
        Self { job, roots: job.preset.roots(), growth: None }
    }

    /// Grows the organ of a seed, calling `after_step` after each step, and writes its files.
    pub fn grow(&mut self, seed: u64, mut after_step: impl FnMut(StepCount)) -> Result<Line, Failure> {
        let named = |error: &dyn Display| Failure::Run(format!("{} with seed {seed}: {error}", self.job.tissue_name));
        let (generator, tissue) = (&self.job.generator, Arc::clone(&self.job.tissue));
        let growth = match self.growth.take() {
            Some(growth) => generator.restart(growth, tissue, &self.roots, seed),
            None => generator.start(tissue, &self.roots, seed),
        };
        let growth = self.growth.insert(growth.map_err(|error| named(&error))?).as_mut();
        let start = Instant::now();
        while !growth.is_finished() {
            growth.advance();
            after_step(growth.progress());
        }
        growth.settle();
        if let Some(cco) = (growth as &dyn Any).downcast_ref::<Cco>() {
            cco.outcome().map_err(|error| named(&error))?;
        }
        let grow_ms = 1e3 * start.elapsed().as_secs_f64();
        let hash = hash_trees(growth.trees().values().flatten().map(|grown| grown.tree));
        let meshes = meshes(self.job, growth).map_err(|error| named(&error))?;
        let measured = meshes.as_ref().map(|_, mesh| mesh.as_ref().filter(|_| self.job.mesh_figures));
        Ok(Line {
            tissue: self.job.tissue_name.clone(),
            preset: self.job.preset_name.clone(),
            extent: self.job.tissue.extent().into(),
            seed,
            steps: growth.progress().done,
            grow_ms: (grow_ms * 1e3).round() / 1e3,
            hash: format!("{hash:016x}"),
            kinds: KindMeasures::of(growth, &*self.job.tissue, seed, &measured),
            cco: CcoFigures::of(growth),
            files: write_files(self.job, growth, &meshes, seed, hash)?,
        })
    }
}

/// Writes the vessels as drawn, and returns the files' paths.
fn write_files(
    job: &Job,
    growth: &dyn Growth,
    meshes: &ByKind<Option<Meshed>>,
    seed: u64,
    hash: u64,
) -> Result<Vec<String>, Failure> {
    let Some(folder) = &job.out else {
        return Ok(Vec::new());
    };
    let vessels = growth.trees().map(|_, grown| grown.map(|grown| grown.vessels()));
    let trees: Vec<(VesselKind, &VesselTree)> = vessels
        .iter()
        .filter_map(|(kind, tree)| Some((kind, tree.as_ref().filter(|tree| !tree.is_empty())?)))
        .collect();
    let millimetres = (growth as &dyn Any).downcast_ref::<Cco>().map_or(1.0, Cco::millimetres);
    let stem = format!("{}_{}_{seed}", file_name(&tissue_stem(job)), file_name(&job.preset_name));
    let mut files = Vec::new();
    let mut write = |name: String, write: &dyn Fn(&Path) -> Result<(), WriteError>| {
        let path = folder.join(name);
        files.push(path.display().to_string());
        write(&path).map_err(Failure::run)
    };
    for format in &job.formats {
        match format {
            Format::Swc => {
                for &(kind, tree) in &trees {
                    let options =
                        SwcOptions { comments: comments(job, Some(kind), seed, hash), structure: swc_structure(kind) };
                    write(format!("{stem}_{}.swc", kind.name()), &|path| save_swc(path, tree, &options))?;
                }
            }
            Format::Obj => write(format!("{stem}.obj"), &|path| save_obj(path, &trees, &ObjOptions::default()))?,
            Format::Csv => write(format!("{stem}.csv"), &|path| save_csv(path, &trees))?,
            Format::Levels => write(format!("{stem}_levels.csv"), &|path| save_levels(path, &trees, millimetres))?,
            Format::Gxl => {
                for &(kind, tree) in &trees {
                    let name = format!("{stem}_{}", kind.name());
                    let options = GxlOptions {
                        name: name.clone(),
                        flow: job.generator.cco().map_or_else(VesselFlow::default, |settings| settings.flow[kind]),
                        millimetres,
                        is_flat: matches!(job.tissue.extent(), Extent::Area(_)) && has_one_height(tree),
                    };
                    write(format!("{name}.gxl"), &|path| save_gxl(path, tree, &options))?;
                }
            }
            Format::Svg => write(format!("{stem}.svg"), &|path| save_svg(path, &trees))?,
            Format::Eps => write(format!("{stem}.eps"), &|path| save_eps(path, &trees))?,
            mesh => {
                if let Some(ending) = mesh.mesh_ending() {
                    write(format!("{stem}{ending}"), &|path| save(path, meshes, comments(job, None, seed, hash)))?;
                }
            }
        }
    }
    Ok(files)
}

/// Whether a tree lies in a plane z = constant.
fn has_one_height(tree: &VesselTree) -> bool {
    tree.positions().iter().all(|position| position.z == tree.positions()[0].z)
}

/// Header comments with all that is needed to grow a file's vessels again.
///
/// `kind` is that of the vessels if the file has only one.
fn comments(job: &Job, kind: Option<VesselKind>, seed: u64, hash: u64) -> Vec<String> {
    let kind = kind.map_or(String::new(), |kind| format!("{} ", kind.name()));
    vec![
        format!("{kind}vessels of {}, preset {}, seed {seed}", job.tissue_name, job.preset_name),
        format!("hash of all kinds of vessels: {hash:016x}"),
        "unit: that of the tissue".into(),
    ]
}

fn tissue_stem(job: &Job) -> String {
    let path = Path::new(&job.tissue_name);
    path.file_stem().map_or_else(|| job.tissue_name.clone(), |stem| stem.to_string_lossy().into_owned())
}

/// A name without characters that are special to a file system or a shell.
fn file_name(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.';
    name.chars().map(|c| if is_plain(c) { c } else { '-' }).collect()
}
