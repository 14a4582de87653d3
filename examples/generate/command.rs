//! The growth of organs from the command's options.

mod bake;
mod batch;
mod edit;
mod flow;
mod identity;
mod mesh;
mod options;
mod organ;
mod procedural;
mod report;
mod summary;

use bake::Painting;
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::ColonizationSettings,
    generator::Generator,
    io::{MeshReadError, load_mesh, remove_stale},
    mesh::TriangleMesh,
    preset::Preset,
    roots::RootPlacement,
    surface::SurfaceSettings,
    tissue::{MeshTissue, SourceData, Tissue, TissueMode, TissueShape, TissueSource},
    units::Scale,
};
use identity::Run;
pub use options::Options;
use options::{Format, Method, Mode, Shard, Unit};
use procedural::Procedural;
use std::fs::{self, Metadata};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
pub use summary::Summary;

/// Why the command stopped.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Invalid options.
    #[error("{0}")]
    Usage(String),
    /// An error during the run.
    #[error("{0}")]
    Run(String),
    /// The user, or the system, has asked to stop.
    #[error("interrupted; files that are there are whole, and --resume goes on after them")]
    Interrupted,
}

impl Failure {
    fn usage(cause: impl ToString) -> Self {
        Self::Usage(cause.to_string())
    }

    fn run(cause: impl ToString) -> Self {
        Self::Run(cause.to_string())
    }

    /// 2 for wrong usage, as in clap, 130 after an interruption, as in shells, 1 for the rest.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Run(_) => 1,
            Self::Interrupted => 130,
        }
    }
}

/// Everything that the organs of a batch have in common.
struct Job {
    tissue: Arc<dyn Tissue>,
    /// Fitted to the tissue.
    generator: Generator,
    preset: Preset,
    tissue_name: String,
    /// The seed of the tissue's organ, if that is procedural.
    organ_seed: Option<u64>,
    preset_name: String,
    run: Run,
    unit: Option<Unit>,
    /// The scale for which the flow is solved, if it is.
    flow_scale: Option<Scale>,
    out: Option<PathBuf>,
    /// Whether organs whose files are there are skipped.
    resume: bool,
    formats: Vec<Format>,
    /// Sides of round cones.
    obj_sides: u32,
    /// How closed meshes are made, if any are wanted.
    surface: Option<SurfaceSettings>,
    /// Whether they are measured.
    mesh_figures: bool,
    /// Whether the vessels' statistics are reported: in JSON, in files or in a summary of several organs.
    statistics: bool,
    /// What textures are made, if any are wanted.
    painting: Option<Painting>,
}

/// Grows the requested organs, and reports on `stdout` and in files. Returns figures of all organs together.
///
/// Once `stop` is set, no organ is grown any more, and files under way are finished.
pub fn run(options: &Options, stdout: &mut impl Write, stop: &AtomicBool) -> Result<Summary, Failure> {
    let start = Instant::now();
    if options.seed.checked_add(options.count - 1).is_none() {
        return Err(Failure::usage("--seed plus --count is more than a seed can be, 2^64 − 1"));
    }
    if options.organ_seed.is_some() && Procedural::seed(options).is_none() {
        return Err(Failure::usage("--organ-seed is for colon, eye, kidney and liver; other tissues have no seed"));
    }
    let job = prepare(options)?;
    let Shard { index, of } = options.shard;
    let organs = options.count.saturating_sub(index).div_ceil(of);
    let seed_of = |organ: u64| options.seed + index + organ * of;
    let threads = options.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    let mut summary = Summary::default();
    let grown = batch::grow_all(&job, organs, seed_of, threads, stop, |outcome| {
        summary.add(outcome);
        let text = if options.json { outcome.json.clone() } else { outcome.line.text() };
        writeln!(stdout, "{text}").map_err(|error| Failure::run(format!("cannot write to standard output: {error}")))
    });
    grown?;
    summary.seconds = start.elapsed().as_secs_f64();
    if let Some(folder) = job.out.as_ref().filter(|_| options.count > 1) {
        summary.save(&folder.join(job.run.organs(&seeds(options), "_summary.json")))?;
    }
    Ok(summary)
}

/// The seeds of all organs, and the share of them that this command grows, as part of a name.
fn seeds(options: &Options) -> String {
    let [first, last] = [options.seed, options.seed + options.count - 1].map(identity::padded);
    match options.shard {
        Shard { of: 1, .. } => format!("{first}-{last}"),
        Shard { index, of } => format!("{first}-{last}_{index}-of-{of}"),
    }
}

fn prepare(options: &Options) -> Result<Job, Failure> {
    let (mut preset, preset_name) = read_preset(options)?;
    for change in &options.set {
        preset = edit::apply(&preset, change).map_err(|error| Failure::Usage(format!("--set {change}: {error}")))?;
    }
    if let Some(steps) = options.steps {
        colonization(&mut preset, "--steps")?.steps = steps;
    }
    if let Some(samples) = options.samples {
        colonization(&mut preset, "--samples")?.samples = samples;
    }
    if let Some(terminals) = options.terminals {
        let settings = preset.generator.cco_mut();
        settings
            .ok_or_else(|| Failure::usage("--terminals is for --method cco; the preset grows otherwise"))?
            .terminals = terminals;
    }
    if options.no_veins {
        preset.roots.vein = RootPlacement::None;
    }
    if !(options.lengths.is_finite() && options.lengths > 0.0) {
        return Err(Failure::Usage(format!("--lengths is {}; it must be finite and above 0", options.lengths)));
    }
    if preset.generator.colonization().is_some_and(|settings| settings.samples == 0) {
        return Err(Failure::usage("samples is 0, so nothing would grow; it must be at least 1"));
    }
    let surface = surface_settings(options)?;
    let (tissue, mesh) = build_tissue(options, &mut preset)?;
    let generator = preset.generator_for(tissue.extent()).scaled(options.lengths);
    for warning in generator.validate().map_err(Failure::usage)? {
        eprintln!("generate: warning: {warning}");
    }
    let painting = Painting::new(options, mesh.as_deref())?;
    let described = painting.as_ref().map(Painting::described);
    let run = Run::new(options, (&preset, &preset_name), &generator, (&*tissue, mesh.as_deref()), described)?;
    if let Some(folder) = &options.out {
        prepare_folder(folder)?;
        run.claim(folder)?;
    }
    let mut formats = options.format.clone();
    formats.sort();
    formats.dedup();
    Ok(Job {
        tissue,
        generator,
        preset,
        tissue_name: options.tissue.display().to_string(),
        organ_seed: Procedural::seed(options),
        preset_name,
        run,
        unit: options.unit,
        flow_scale: options.unit.filter(|_| options.flow).map(Unit::scale),
        out: options.out.clone(),
        resume: options.resume,
        formats,
        obj_sides: options.obj_sides,
        surface,
        mesh_figures: options.mesh || options.json,
        statistics: options.json || options.out.is_some() || options.count > 1,
        painting,
    })
}

/// Makes the folder for files, and removes what killed runs left there.
fn prepare_folder(folder: &Path) -> Result<(), Failure> {
    const OLD: Duration = Duration::from_secs(60);
    let is_old = |found: &Metadata| found.modified().is_ok_and(|then| then.elapsed().is_ok_and(|age| age > OLD));
    let named = |error| Failure::Run(format!("cannot make the folder {}: {error}", folder.display()));
    fs::create_dir_all(folder).map_err(named)?;
    match remove_stale(folder, is_old) {
        Ok(0) => {}
        Ok(files) => eprintln!("generate: removed {files} temporary files of runs that were killed"),
        // Files can be written into a folder that cannot be listed.
        Err(error) => eprintln!("generate: warning: cannot list {}: {error}", folder.display()),
    }
    Ok(())
}

/// Settings of the closed meshes, checked even if none is wanted.
fn surface_settings(options: &Options) -> Result<Option<SurfaceSettings>, Failure> {
    let (level, most_sides) = (options.mesh_level, options.mesh_sides);
    let settings = SurfaceSettings { level, most_sides, ..SurfaceSettings::default() };
    let given = format!("--mesh-level {level}, --mesh-sides {most_sides}");
    settings.validate().map_err(|error| Failure::Usage(format!("{given}: {error}")))?;
    let is_written = options.format.iter().any(|format| format.is_mesh());
    Ok((options.mesh || is_written).then_some(settings))
}

/// The settings that an option changes.
fn colonization<'a>(preset: &'a mut Preset, option: &str) -> Result<&'a mut ColonizationSettings, Failure> {
    let settings = preset.generator.colonization_mut();
    settings.ok_or_else(|| Failure::Usage(format!("{option} is for space colonization; the preset grows otherwise")))
}

fn read_preset(options: &Options) -> Result<(Preset, String), Failure> {
    let (preset, name) = find_preset(options)?;
    match options.method {
        Some(method) if !method.is_of(&preset.generator) => {
            let method = method.name();
            Err(Failure::Usage(format!(
                "--method {method} conflicts with {name}, which grows otherwise; leave out one of them"
            )))
        }
        _ => Ok((preset, name)),
    }
}

fn find_preset(options: &Options) -> Result<(Preset, String), Failure> {
    let Some(path) = &options.settings else {
        let by_method = || options.method.unwrap_or(Method::Colonization).preset(&options.tissue);
        let preset = options.preset.unwrap_or_else(by_method);
        return Ok((preset.load(), preset.name().to_owned()));
    };
    let named = |cause: &dyn std::fmt::Display| Failure::Run(format!("{}: {cause}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| named(&error))?;
    let preset = Preset::from_ron(&text).map_err(|error| named(&error))?;
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    Ok((preset, stem.to_string_lossy().into_owned()))
}

/// The mesh of an organ's file.
fn read_mesh(path: &Path) -> Result<TriangleMesh, Failure> {
    load_mesh(path).map_err(|error| match error {
        MeshReadError::UnknownFormat { path } => Failure::Usage(format!(
            "--tissue is {}; it must be disc, ball, box, colon, eye, kidney, liver, or a file that ends in .glb, .gltf \
             or .obj",
            path.display()
        )),
        other => Failure::run(other),
    })
}

/// The tissue, and the mesh that it is made of, if of any.
fn build_tissue(
    options: &Options,
    preset: &mut Preset,
) -> Result<(Arc<dyn Tissue>, Option<Arc<TriangleMesh>>), Failure> {
    let shape = match options.tissue.to_str() {
        Some("disc") => Some(TissueShape::disc(0.5)),
        Some("ball") => Some(TissueShape::ball(0.5)),
        Some("box") => Some(TissueShape::cuboid(Vec3::ONE)),
        _ => None,
    };
    let mut data = SourceData::default();
    match (shape, options.mode) {
        (Some(_), Some(_)) => {
            return Err(Failure::usage("--mode is for the mesh of an organ; disc, ball and box are as they are"));
        }
        (Some(shape), None) => preset.tissue = shape.into(),
        (None, mode) => {
            // A mesh on the command line overrides a shape in a settings file.
            let mut tissue = match &preset.tissue {
                TissueSource::Mesh(mesh) => mesh.clone(),
                _ => MeshTissue::default(),
            };
            if let Some(mode) = mode {
                let steps = preset.generator.colonization().map_or(0, |settings| settings.steps);
                tissue.mode = mode.tissue_mode(tissue.mode, steps);
            } else if preset.generator.cco().is_some() {
                // The only mode in which it can grow.
                tissue.mode = TissueMode::Volume;
            }
            preset.tissue = tissue.into();
            let mode = preset.tissue.mode().unwrap_or_default();
            data.mesh = Some(Arc::new(match Procedural::named(&options.tissue) {
                Some(organ) => organ.make(options, mode, preset)?,
                None => read_mesh(&options.tissue)?,
            }));
        }
    }
    let prepared = preset.tissue.prepare(&data);
    let named = |error| Failure::Run(format!("{}: {error}", options.tissue.display()));
    Ok((Arc::clone(prepared.map_err(named)?.tissue()), data.mesh))
}
