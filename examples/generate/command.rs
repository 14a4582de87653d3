//! The command's options, and the growth of organs from them.

mod batch;
mod edit;
mod mesh;
mod organ;
mod report;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::ColonizationSettings,
    generator::Generator,
    io::{MeshReadError, load_mesh},
    preset::{Preset, PresetName},
    roots::RootPlacement,
    surface::SurfaceSettings,
    tissue::{MeshTissue, SourceData, Tissue, TissueMode, TissueShape, TissueSource},
};
use clap::{Parser, ValueEnum};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Grows arteries and veins in organs, without a window.
#[derive(Debug, Parser)]
#[command(name = "generate", version, args_override_self = true)]
pub struct Options {
    /// What to grow in: disc, ball or box, of diameter or edge 1 around the origin, or the mesh of an organ (GLB, glTF,
    /// OBJ).
    #[arg(long, default_value = "disc", value_name = "disc|ball|box|FILE")]
    pub tissue: PathBuf,
    /// Where on an organ's mesh vessels grow: over its surface, through its volume, or both in stages. Default: the
    /// preset's.
    #[arg(long)]
    pub mode: Option<Mode>,
    /// How vessels grow. Without a preset or settings it chooses those to start from.
    #[arg(long)]
    pub method: Option<Method>,
    /// Built-in settings, by name. Default: `paper`; with `--method cco` it is `cco-disc` in a disc, else `cco-ball`.
    #[arg(long, conflicts_with = "settings", value_name = "NAME")]
    pub preset: Option<PresetName>,
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
    #[arg(long)]
    pub samples: Option<u32>,
    /// Terminals of each kind of vessels, for constrained constructive optimisation. Default: the preset's.
    #[arg(long, value_name = "N")]
    pub terminals: Option<u32>,
    /// Multiplies every length of the settings, after fitting them to the tissue.
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    pub lengths: f32,
    /// Grows arteries only.
    #[arg(long)]
    pub no_veins: bool,
    /// Number of threads. They share the organs; spare threads share the work on one organ. Default: all cores.
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
    /// Folder for the vessels, created if missing. Without it, nothing is written.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Formats to write.
    #[arg(long, value_delimiter = ',', default_value = "swc")]
    pub format: Vec<Format>,
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

/// How vessels grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// By space colonization: arteries and veins.
    Colonization,
    /// By constrained constructive optimisation: trees of least volume, in areas and volumes with a border.
    Cco,
}

impl Method {
    /// The settings to start from if none are named.
    fn preset(self, tissue: &Path) -> PresetName {
        match self {
            Self::Colonization => PresetName::default(),
            Self::Cco if tissue == "disc" => PresetName::CcoDisc,
            Self::Cco => PresetName::CcoBall,
        }
    }

    /// Whether settings grow vessels this way.
    fn is_of(self, generator: &Generator) -> bool {
        match self {
            Self::Colonization => generator.colonization().is_some(),
            Self::Cco => generator.cco().is_some(),
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
    /// Diameters by level, in mm if the method has a physical size.
    Levels,
    /// A graph as OpenCCO writes it, a file for each kind of vessels.
    Gxl,
    /// A picture of lines, for web pages.
    Svg,
    /// The same for papers.
    Eps,
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

/// Why the command stopped.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Invalid options.
    #[error("{0}")]
    Usage(String),
    /// An error during the run.
    #[error("{0}")]
    Run(String),
}

impl Failure {
    fn usage(cause: impl ToString) -> Self {
        Self::Usage(cause.to_string())
    }

    fn run(cause: impl ToString) -> Self {
        Self::Run(cause.to_string())
    }

    /// 2 for wrong usage, as in clap, 1 for the rest.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Run(_) => 1,
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
    out: Option<PathBuf>,
    formats: Vec<Format>,
    /// How closed meshes are made, if any are wanted.
    surface: Option<SurfaceSettings>,
    /// Whether they are measured.
    mesh_figures: bool,
}

/// Grows the requested organs, and reports on `stdout` and in files.
pub fn run(options: &Options, stdout: &mut impl Write) -> Result<(), Failure> {
    if options.seed.checked_add(options.count - 1).is_none() {
        return Err(Failure::usage("--seed plus --count is more than a seed can be, 2^64 − 1"));
    }
    let job = prepare(options)?;
    let Shard { index, of } = options.shard;
    let organs = options.count.saturating_sub(index).div_ceil(of);
    let seed_of = |organ: u64| options.seed + index + organ * of;
    let threads = options.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    batch::grow_all(&job, organs, seed_of, threads, |line| {
        let text = if options.json { line.json() } else { line.text() };
        writeln!(stdout, "{text}").map_err(|error| Failure::run(format!("cannot write to standard output: {error}")))
    })
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
    let surface = surface_settings(options)?;
    let tissue = build_tissue(options, &mut preset)?;
    let generator = preset.generator_for(tissue.extent()).scaled(options.lengths);
    for warning in generator.validate().map_err(Failure::usage)? {
        eprintln!("generate: warning: {warning}");
    }
    if let Some(folder) = &options.out {
        let named = |error| Failure::Run(format!("cannot make the folder {}: {error}", folder.display()));
        std::fs::create_dir_all(folder).map_err(named)?;
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
        out: options.out.clone(),
        formats,
        surface,
        mesh_figures: options.mesh || options.json,
    })
}

/// Settings of the closed meshes, checked even if none is wanted.
fn surface_settings(options: &Options) -> Result<Option<SurfaceSettings>, Failure> {
    let (level, most_sides) = (options.mesh_level, options.mesh_sides);
    let settings = SurfaceSettings { level, most_sides, ..SurfaceSettings::default() };
    let given = format!("--mesh-level {level}, --mesh-sides {most_sides}");
    settings.validate().map_err(|error| Failure::Usage(format!("{given}: {error}")))?;
    let is_written = options.format.iter().any(|format| format.mesh_ending().is_some());
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
            let wanted = method.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
            Err(Failure::Usage(format!(
                "--method {wanted} conflicts with {name}, which grows otherwise; leave out one of them"
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

fn build_tissue(options: &Options, preset: &mut Preset) -> Result<Arc<dyn Tissue>, Failure> {
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
    Ok(Arc::clone(prepared.map_err(named)?.tissue()))
}
