//! One organ: grown, measured, written.

use super::flow::flows;
use super::mesh::{Meshed, meshes, save};
use super::report::{CcoFigures, KindMeasures, Line, Samples};
use super::{Failure, Format, Job, Unit};
use bevy_vessels::synthesis::{
    cco::{Cco, VesselFlow},
    growth::{Growth, StepCount},
    haemodynamics::Network,
    io::{
        CsvOptions, GxlOptions, ObjOptions, SwcOptions, WriteError, save_csv, save_eps, save_gxl, save_levels,
        save_obj, save_svg, save_swc, swc_structure, write_atomically,
    },
    roots::Roots,
    tissue::Extent,
    tree::{ByKind, VesselKind, VesselTree, hash_trees},
};
use std::any::Any;
use std::fmt::Display;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What became of an organ.
pub struct Outcome {
    /// Its report.
    pub line: Line,
    /// The same as JSON, to the digit as it was when the organ had grown.
    pub json: String,
    /// Whether its files were there already.
    pub was_there: bool,
}

/// Grows organ after organ of a job in the same memory.
pub struct Grower<'a> {
    job: &'a Job,
    stop: &'a AtomicBool,
    roots: Roots,
    growth: Option<Box<dyn Growth>>,
    samples: Samples,
}

impl<'a> Grower<'a> {
    /// Nothing grown yet. Once `stop` is set, nothing more is.
    pub fn new(job: &'a Job, stop: &'a AtomicBool) -> Self {
        Self { job, stop, roots: job.preset.roots(), growth: None, samples: Samples::default() }
    }

    /// Grows the organ of a seed, calling `after_step` after each step, and writes its files. An organ that is there and
    /// may be skipped is read.
    ///
    /// # Errors
    /// [`Failure::Interrupted`] if it was to stop before the organ had files.
    pub fn grow(&mut self, seed: u64, after_step: impl FnMut(StepCount)) -> Result<Outcome, Failure> {
        if self.job.resume
            && let Some(outcome) = written(self.job, seed)
        {
            return Ok(outcome);
        }
        let named = |error: &dyn Display| Failure::Run(format!("{} with seed {seed}: {error}", self.job.tissue_name));
        let grow_ms = self.run(seed, after_step)?;
        let Some(growth) = self.growth.as_deref() else { return Err(Failure::Interrupted) };
        let vessels = growth.trees().map(|_, grown| grown.map(|grown| grown.vessels()));
        let trees: Vec<(VesselKind, &VesselTree)> = vessels
            .iter()
            .filter_map(|(kind, tree)| Some((kind, tree.as_ref().filter(|tree| !tree.is_empty())?)))
            .collect();
        trees.iter().try_for_each(|(_, tree)| tree.validate()).map_err(|error| named(&error))?;
        if trees.iter().all(|(_, tree)| tree.segments().next().is_none()) {
            eprintln!(
                "generate: warning: {}",
                named(&"nothing grew; give more --steps or --samples, or other lengths")
            );
        }
        let meshes = meshes(self.job, growth).map_err(|error| named(&error))?;
        let measured = meshes.as_ref().map(|_, mesh| mesh.as_ref().filter(|_| self.job.mesh_figures));
        let flows = match self.job.flow_scale {
            Some(scale) => flows(&trees, scale).map_err(|error| named(&error))?,
            None => ByKind::default(),
        };
        let samples = self.job.statistics.then_some(&mut self.samples);
        let hash = hash_trees(growth.trees().values().flatten().map(|grown| grown.tree));
        let mut line = Line {
            tissue: self.job.tissue_name.clone(),
            organ_seed: self.job.organ_seed,
            mode: self.job.run.mode.map(|mode| mode.name().to_owned()),
            preset: self.job.preset_name.clone(),
            run: self.job.run.hash.clone(),
            unit: self.job.unit.map(|unit| unit.name().to_owned()),
            extent: self.job.tissue.extent().into(),
            seed,
            steps: growth.progress().done,
            grow_ms: (grow_ms * 1e3).round() / 1e3,
            hash: format!("{hash:016x}"),
            kinds: KindMeasures::of(growth, &*self.job.tissue, samples, &measured, &flows),
            cco: CcoFigures::of(growth),
            bake: None,
            files: Vec::new(),
        };
        let millimetres = (growth as &dyn Any).downcast_ref::<Cco>().map_or(1.0, Cco::millimetres);
        let (job, trees, meshes, flows) = (self.job, &trees, &meshes, &flows);
        Written { job, trees, meshes, flows, millimetres, seed, hash }.write(&mut line)?;
        Ok(Outcome { json: line.json(), line, was_there: false })
    }

    /// Runs the growth of a seed to its end, and returns its milliseconds.
    fn run(&mut self, seed: u64, mut after_step: impl FnMut(StepCount)) -> Result<f64, Failure> {
        let named = |error: &dyn Display| Failure::Run(format!("{} with seed {seed}: {error}", self.job.tissue_name));
        let (generator, tissue) = (&self.job.generator, Arc::clone(&self.job.tissue));
        let growth = match self.growth.take() {
            Some(growth) => generator.restart(growth, tissue, &self.roots, seed),
            None => generator.start(tissue, &self.roots, seed),
        };
        let growth = self.growth.insert(growth.map_err(|error| named(&error))?).as_mut();
        let start = Instant::now();
        while !growth.is_finished() {
            if self.stop.load(Ordering::Relaxed) {
                return Err(Failure::Interrupted);
            }
            growth.advance();
            after_step(growth.progress());
        }
        growth.settle();
        if let Some(cco) = (growth as &dyn Any).downcast_ref::<Cco>() {
            cco.outcome().map_err(|error| named(&error))?;
        }
        Ok(1e3 * start.elapsed().as_secs_f64())
    }
}

/// A file of an organ.
struct Target {
    format: Format,
    /// The kind of the vessels if the file has only one.
    kind: Option<VesselKind>,
    path: PathBuf,
}

/// The files of an organ that has these kinds of vessels; none if none are wanted.
fn targets(job: &Job, seed: u64, kinds: &[VesselKind]) -> Vec<Target> {
    let Some(folder) = &job.out else { return Vec::new() };
    let organ = job.run.organ(seed);
    let target = |format, kind, ending: String| Target { format, kind, path: folder.join(organ.clone() + &ending) };
    let files = job.formats.iter().flat_map(|&format| match format {
        Format::Swc | Format::Gxl => {
            let ending = |kind: VesselKind| format!("_{}.{}", kind.name(), format.extension());
            kinds.iter().map(|&kind| target(format, Some(kind), ending(kind))).collect()
        }
        // The other table has the plain name.
        Format::Levels => vec![target(format, None, "_levels.csv".to_owned())],
        // The other OBJ file has the plain name.
        Format::ObjMesh => vec![target(format, None, "_mesh.obj".to_owned())],
        other => vec![target(other, None, format!(".{}", other.extension()))],
    });
    files.collect()
}

/// The file with an organ's report, written once all others are.
fn report_path(job: &Job, seed: u64) -> Option<PathBuf> {
    Some(job.out.as_ref()?.join(job.run.organ(seed) + ".json"))
}

/// The report of an organ all of whose files and figures are there.
fn written(job: &Job, seed: u64) -> Option<Outcome> {
    let text = fs::read_to_string(report_path(job, seed)?).ok()?;
    let mut line: Line = serde_json::from_str(&text).ok()?;
    let targets = targets(job, seed, &line.kinds.grown());
    let has_figures = !(job.mesh_figures && job.surface.is_some()) || line.kinds.have_meshes();
    if !has_figures || !targets.iter().all(|target| target.path.is_file()) {
        return None;
    }
    let maps: Vec<PathBuf> = job.painting.iter().flat_map(|painting| painting.files(job, seed)).collect();
    if job.painting.is_some() != line.bake.is_some() || !maps.iter().all(|path| path.is_file()) {
        return None;
    }
    if let Some(bake) = &mut line.bake {
        bake.files = maps.iter().map(|path| path.display().to_string()).collect();
    }
    let files = targets.iter().map(|target| target.path.display().to_string()).collect();
    let before = std::mem::replace(&mut line.files, files);
    let json = if before == line.files { text.trim_end().to_owned() } else { line.json() };
    Some(Outcome { line, json, was_there: true })
}

/// What is written of an organ.
struct Written<'a> {
    job: &'a Job,
    /// As drawn.
    trees: &'a [(VesselKind, &'a VesselTree)],
    meshes: &'a ByKind<Option<Meshed>>,
    flows: &'a ByKind<Option<Network>>,
    /// Millimetres of a tissue length, where the method knows it.
    millimetres: f64,
    seed: u64,
    hash: u64,
}

impl Written<'_> {
    /// Writes all files, and the report with their paths at last.
    fn write(&self, line: &mut Line) -> Result<(), Failure> {
        let kinds: Vec<VesselKind> = self.trees.iter().map(|&(kind, _)| kind).collect();
        for target in targets(self.job, self.seed, &kinds) {
            self.write_one(&target).map_err(Failure::run)?;
            line.files.push(target.path.display().to_string());
        }
        if let Some(painting) = &self.job.painting {
            let (bake, mut figures) = painting.bake(self.trees).map_err(Failure::run)?;
            let files = painting.files(self.job, self.seed);
            painting.save(&bake, &files).map_err(Failure::run)?;
            figures.files = files.iter().map(|path| path.display().to_string()).collect();
            line.bake = Some(figures);
        }
        match report_path(self.job, self.seed) {
            Some(path) => write_atomically(path, |out| writeln!(out, "{}", line.json())).map_err(Failure::run),
            None => Ok(()),
        }
    }

    fn write_one(&self, Target { format, kind, path }: &Target) -> Result<(), WriteError> {
        let comments = self.job.run.comments(self.job, *kind, self.seed, self.hash);
        let scale = self.job.unit.map(Unit::scale);
        match format {
            Format::Swc => {
                let own = |(tree_kind, _): &&(VesselKind, &VesselTree)| Some(*tree_kind) == *kind;
                self.trees.iter().find(own).map_or(Ok(()), |&(kind, tree)| {
                    save_swc(path, tree, &SwcOptions { scale, comments, structure: swc_structure(kind) })
                })
            }
            Format::Obj => {
                let options = ObjOptions { comments, sides: self.job.obj_sides, ..ObjOptions::default() };
                save_obj(path, self.trees, &options)
            }
            Format::Csv => {
                save_csv(path, self.trees, &CsvOptions { flows: self.flows.as_ref().map(|_, of| of.as_ref()) })
            }
            Format::Levels => save_levels(path, self.trees, self.millimetres),
            Format::Gxl => {
                let own = |(tree_kind, _): &&(VesselKind, &VesselTree)| Some(*tree_kind) == *kind;
                self.trees
                    .iter()
                    .find(own)
                    .map_or(Ok(()), |&(kind, tree)| save_gxl(path, tree, &self.gxl_options(kind, tree)))
            }
            Format::Svg => save_svg(path, self.trees),
            Format::Eps => save_eps(path, self.trees),
            Format::Glb | Format::Stl | Format::Ply | Format::Off | Format::ObjMesh => {
                save(path, self.meshes, scale, comments)
            }
        }
    }

    fn gxl_options(&self, kind: VesselKind, tree: &VesselTree) -> GxlOptions {
        let (job, flows) = (self.job, self.job.generator.cco().map(|settings| &settings.flow));
        GxlOptions {
            name: format!("{}_{}", job.run.organ(self.seed), kind.name()),
            flow: flows.map_or_else(VesselFlow::default, |flow| flow[kind]),
            millimetres: self.millimetres,
            is_flat: matches!(job.tissue.extent(), Extent::Area(_)) && has_one_height(tree),
        }
    }
}

fn has_one_height(tree: &VesselTree) -> bool {
    tree.positions().iter().all(|position| position.z == tree.positions()[0].z)
}
