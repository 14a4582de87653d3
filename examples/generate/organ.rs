//! One organ: grown, measured, written.

use super::report::{Line, Measures};
use super::{Failure, Format, Job};
use bevy_vessels::synthesis::{
    colonization::Colonization,
    io::{ObjOptions, SwcOptions, WriteError, save_csv, save_obj, save_swc},
    roots::Roots,
    tree::{VesselKind, VesselTree, hash_trees},
};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Grows organ after organ of a job in the same memory.
pub struct Grower<'a> {
    job: &'a Job,
    roots: Roots,
    growth: Option<Colonization>,
}

impl<'a> Grower<'a> {
    /// Nothing grown yet.
    pub fn new(job: &'a Job) -> Self {
        Self { job, roots: job.preset.roots(), growth: None }
    }

    /// Grows the organ of a seed, calling `after_step` after each step, and writes its files.
    pub fn grow(&mut self, seed: u64, after_step: impl Fn()) -> Result<Line, Failure> {
        let named = |error| Failure::Run(format!("{} with seed {seed}: {error}", self.job.tissue_name));
        let settings = self.job.settings.clone();
        let growth = match self.growth.take() {
            Some(mut growth) => growth.restart(settings, &self.roots, seed).map(|()| growth),
            None => Colonization::new(Arc::clone(&self.job.tissue), settings, &self.roots, seed),
        };
        let growth = self.growth.insert(growth.map_err(named)?);
        let start = Instant::now();
        while !growth.is_finished() {
            growth.step();
            after_step();
        }
        let grow_ms = 1e3 * start.elapsed().as_secs_f64();
        let hash = hash_trees(VesselKind::ALL.map(|system| growth.tree(system)));
        Ok(Line {
            tissue: self.job.tissue_name.clone(),
            preset: self.job.preset_name.clone(),
            seed,
            steps: growth.steps_done(),
            grow_ms: (grow_ms * 1e3).round() / 1e3,
            hash: format!("{hash:016x}"),
            arterial: Measures::of(growth, VesselKind::Artery, seed),
            venous: Measures::of(growth, VesselKind::Vein, seed),
            files: write_files(self.job, growth, seed, hash)?,
        })
    }
}

/// Writes the vessels as they are drawn, and gives the files' paths.
fn write_files(job: &Job, growth: &Colonization, seed: u64, hash: u64) -> Result<Vec<String>, Failure> {
    let Some(folder) = &job.out else {
        return Ok(Vec::new());
    };
    let vessels = VesselKind::ALL.map(|system| (system, growth.vessels(system)));
    let trees: Vec<(VesselKind, &VesselTree)> =
        vessels.iter().map(|(system, tree)| (*system, tree)).filter(|(_, tree)| !tree.is_empty()).collect();
    let stem = format!("{}_{}_{seed}", file_name(&tissue_stem(job)), file_name(&job.preset_name));
    let mut files = Vec::new();
    let mut save = |name: String, save: &dyn Fn(&Path) -> Result<(), WriteError>| {
        let path = folder.join(name);
        files.push(path.display().to_string());
        save(&path).map_err(Failure::run)
    };
    for format in &job.formats {
        match format {
            Format::Swc => {
                for &(system, tree) in &trees {
                    let options = SwcOptions { comments: comments(job, system, seed, hash), structure: 0 };
                    save(format!("{stem}_{}.swc", system.name()), &|path| save_swc(path, tree, &options))?;
                }
            }
            Format::Obj => save(format!("{stem}.obj"), &|path| save_obj(path, &trees, &ObjOptions::default()))?,
            Format::Csv => save(format!("{stem}.csv"), &|path| save_csv(path, &trees))?,
        }
    }
    Ok(files)
}

/// What it takes to grow a file's vessels again.
fn comments(job: &Job, system: VesselKind, seed: u64, hash: u64) -> Vec<String> {
    vec![
        format!("{} vessels of {}, preset {}, seed {seed}", system.name(), job.tissue_name, job.preset_name),
        format!("both systems' hash: {hash:016x}"),
        "unit: that of the tissue".into(),
    ]
}

fn tissue_stem(job: &Job) -> String {
    let path = Path::new(&job.tissue_name);
    path.file_stem().map_or_else(|| job.tissue_name.clone(), |stem| stem.to_string_lossy().into_owned())
}

/// A name with nothing in it that a file system or a shell could take amiss.
fn file_name(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.';
    name.chars().map(|c| if is_plain(c) { c } else { '-' }).collect()
}
