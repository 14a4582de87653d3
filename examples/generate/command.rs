//! The command's options, and the growth of organs from them.

mod batch;
mod edit;
mod flow;
mod identity;
mod mesh;
mod organ;
mod report;
mod summary;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::ColonizationSettings,
    generator::Generator,
    io::{MeshReadError, ObjOptions, load_mesh, remove_stale},
    mesh::TriangleMesh,
    preset::{Preset, PresetName},
    roots::RootPlacement,
    surface::SurfaceSettings,
    tissue::{MeshTissue, SourceData, Tissue, TissueMode, TissueShape, TissueSource},
    units::Scale,
};
use clap::{Parser, ValueEnum, builder::TypedValueParser};
use identity::Run;
use std::fs::{self, Metadata};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
pub use summary::Summary;

/// Grows arteries and veins in organs, without a window.
#[derive(Debug, Parser)]
#[command(name = "generate", version, args_override_self = true)]
pub struct Options {
    /// What to grow in: disc, ball or box, of diameter or edge 1 around the origin, or the mesh of an organ (GLB, glTF,
    /// OBJ).
    #[arg(long, default_value = "disc", value_name = "disc|ball|box|FILE")]
    pub tissue: PathBuf,
    /// Unit of the tissue's lengths, noted in all files. SWC files are then in micrometres, as other programs expect;
    /// all others stay in the tissue's lengths.
    #[arg(long)]
    pub unit: Option<Unit>,
    /// Where on an organ's mesh vessels grow: over its surface, through its volume, or both in stages. Default: the
    /// preset's.
    #[arg(long)]
    pub mode: Option<Mode>,
    /// Built-in settings, by name.
    #[arg(long, default_value_t, conflicts_with = "settings", value_name = "NAME")]
    pub preset: PresetName,
    /// Your own preset, as a RON file.
    #[arg(long, value_name = "FILE.ron")]
    pub settings: Option<PathBuf>,
    /// Changes one value of the preset, such as `arterial.direction_weight=0.9`. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Number of growth steps. Default: the preset's.
    #[arg(long)]
    pub steps: Option<u32>,
    /// Samples drawn from the tissue in each step. Default: the preset's.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub samples: Option<u32>,
    /// Multiplies every length of the settings, after fitting them to the tissue.
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    pub lengths: f32,
    /// Grows arteries only.
    #[arg(long)]
    pub no_veins: bool,
    /// Number of threads, or fewer if the system allows no more. They share the organs; spare threads share the work on
    /// one organ. Default: all cores.
    #[arg(long)]
    pub threads: Option<NonZeroUsize>,
    /// Seed of the first organ.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of organs, with seeds counting up.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub count: u64,
    /// Share of the organs to grow, I of N, counted from 0: those whose number modulo N is I.
    #[arg(long, value_name = "I/N", default_value = "0/1", value_parser = parse_shard)]
    pub shard: Shard,
    /// Folder for the vessels, created if missing. Without it, nothing is written. Other runs may have the same: names
    /// begin with tissue, mode, preset and a hash of all that distinguishes a run, which stands in full in a .ron file.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Skips organs whose files are there, and reports them as they were.
    #[arg(long, requires = "out")]
    pub resume: bool,
    /// Formats to write.
    #[arg(long, value_delimiter = ',', default_value = "swc")]
    pub format: Vec<Format>,
    /// Sides of the round cones in OBJ files, 3 to 64. Files are the larger the more there are.
    #[arg(long, default_value_t = ObjOptions::DEFAULT_SIDES, value_name = "N", value_parser = obj_sides())]
    pub obj_sides: u32,
    /// Solves the blood flow: CSV files get columns with flow, pressure, velocity and wall shear stress, JSON the flow
    /// into the organ.
    #[arg(long, requires = "unit")]
    pub flow: bool,
    /// Makes the closed meshes for their figures, even if none is written. Files of meshes make them anyway.
    #[arg(long)]
    pub mesh: bool,
    /// Subdivisions of the closed meshes, 0 to 4. Each makes four times as many faces.
    #[arg(long, default_value_t = SurfaceSettings::DEFAULT_LEVEL, value_name = "N")]
    pub mesh_level: u32,
    /// Sides of the closed meshes around the widest vessels, before subdivision: 4, 8, 16, 32 or 64.
    #[arg(long, default_value_t = SurfaceSettings::DEFAULT_MOST_SIDES, value_name = "N")]
    pub mesh_sides: u32,
    /// Prints one line of JSON per organ, with the figures of its closed meshes if these are made.
    #[arg(long)]
    pub json: bool,
}

fn obj_sides() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(i64::from(ObjOptions::MIN_SIDES)..=i64::from(ObjOptions::MAX_SIDES))
}

/// A unit of lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Unit {
    /// Metres, as in glTF files.
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
    /// Micrometres.
    #[value(alias = "µm", alias = "μm")]
    Um,
}

impl Unit {
    /// The name on the command line and in files.
    fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::Um => "um",
        }
    }

    fn scale(self) -> Scale {
        match self {
            Self::M => Scale::METRES,
            Self::Cm => Scale::CENTIMETRES,
            Self::Mm => Scale::MILLIMETRES,
            Self::Um => Scale::MICROMETRES,
        }
    }
}

/// A share of the organs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    of: u64,
}

fn parse_shard(text: &str) -> Result<Shard, String> {
    let parts = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
    match parts {
        Some((index, of)) if index < of => Ok(Shard { index, of }),
        _ => Err("a shard is I/N with I from 0 to N − 1, such as 0/4".into()),
    }
}

/// Where on the mesh of an organ vessels grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// Over the surface.
    Surface,
    /// Through the volume.
    Volume,
    /// Over the surface first, then inward through the volume.
    Staged,
}

impl Mode {
    /// The name on the command line and in files.
    fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Volume => "volume",
            Self::Staged => "staged",
        }
    }

    /// The tissue's mode. Stages of the preset stay; otherwise half of all steps go to the surface.
    fn tissue_mode(self, preset: TissueMode, steps: u32) -> TissueMode {
        match (self, preset) {
            (Self::Surface, _) => TissueMode::Surface,
            (Self::Volume, _) => TissueMode::Volume,
            (Self::Staged, TissueMode::Staged { .. }) => preset,
            (Self::Staged, _) => TissueMode::Staged { surface_steps: steps / 2 },
        }
    }
}

/// A format of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Format {
    /// Nodes and radii, a file for each kind of vessels.
    Swc,
    /// A surface to look at: round cones that overlap.
    Obj,
    /// A table of segments.
    Csv,
    /// Closed meshes, as binary glTF.
    Glb,
    /// Closed meshes, as binary STL.
    Stl,
    /// Closed meshes of triangles, as binary PLY, with the measures of the vessels.
    Ply,
    /// Closed meshes, as OFF.
    Off,
    /// Closed meshes, as OBJ.
    ObjMesh,
}

impl Format {
    /// The extension of its files.
    fn extension(self) -> &'static str {
        match self {
            Self::Swc => "swc",
            Self::Obj | Self::ObjMesh => "obj",
            Self::Csv => "csv",
            Self::Glb => "glb",
            Self::Stl => "stl",
            Self::Ply => "ply",
            Self::Off => "off",
        }
    }
}

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
}

/// Grows the requested organs, and reports on `stdout` and in files. Returns figures of all organs together.
///
/// Once `stop` is set, no organ is grown any more, and files under way are finished.
pub fn run(options: &Options, stdout: &mut impl Write, stop: &AtomicBool) -> Result<Summary, Failure> {
    let start = Instant::now();
    if options.seed.checked_add(options.count - 1).is_none() {
        return Err(Failure::usage("--seed plus --count is more than a seed can be, 2^64 − 1"));
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
    let run = Run::new(options, (&preset, &preset_name), &generator, (&*tissue, mesh.as_deref()))?;
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
    let Some(path) = &options.settings else {
        return Ok((options.preset.load(), options.preset.name().to_owned()));
    };
    let named = |cause: &dyn std::fmt::Display| Failure::Run(format!("{}: {cause}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| named(&error))?;
    let preset = Preset::from_ron(&text).map_err(|error| named(&error))?;
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    Ok((preset, stem.to_string_lossy().into_owned()))
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
                let steps = colonization(preset, "--mode")?.steps;
                tissue.mode = mode.tissue_mode(tissue.mode, steps);
            }
            preset.tissue = tissue.into();
            let mesh = load_mesh(&options.tissue).map_err(|error| match error {
                MeshReadError::UnknownFormat { path } => Failure::Usage(format!(
                    "--tissue is {}; it must be disc, ball, box, or a file that ends in .glb, .gltf or .obj",
                    path.display()
                )),
                other => Failure::run(other),
            })?;
            data.mesh = Some(Arc::new(mesh));
        }
    }
    let prepared = preset.tissue.prepare(&data);
    let named = |error| Failure::Run(format!("{}: {error}", options.tissue.display()));
    Ok((Arc::clone(prepared.map_err(named)?.tissue()), data.mesh))
}
