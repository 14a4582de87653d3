//! The command's options.

use super::bake::MapFormat;
use super::procedural::Procedural;
use bevy_vessels::synthesis::{
    generator::Generator, io::ObjOptions, preset::PresetName, surface::SurfaceSettings, texture::MapKind,
    tissue::TissueMode, units::Scale,
};
use clap::{
    Parser, ValueEnum,
    builder::{PossibleValuesParser, TypedValueParser},
};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Grows arteries and veins in organs, without a window.
#[derive(Debug, Parser)]
#[command(name = "generate", version, args_override_self = true)]
pub struct Options {
    /// What to grow in: disc, ball or box, of diameter or edge 1 around the origin; a procedural colon, eye, kidney or
    /// liver, in metres; or the mesh of an organ (GLB, glTF, OBJ).
    #[arg(long, default_value = "disc", value_name = "disc|ball|box|colon|eye|kidney|liver|FILE")]
    pub tissue: PathBuf,
    /// Seed of a procedural organ. All networks of a run grow in the same organ. Default: 0.
    #[arg(long, value_name = "N")]
    pub organ_seed: Option<u64>,
    /// Unit of the tissue's lengths, noted in all files. SWC files are then in micrometres, as other programs expect;
    /// all others stay in the tissue's lengths.
    #[arg(long)]
    pub unit: Option<Unit>,
    /// Where on an organ's mesh vessels grow: over its surface, through its volume, or both in stages. Default: the
    /// preset's.
    #[arg(long)]
    pub mode: Option<Mode>,
    /// How vessels grow. Without a preset or settings it chooses those to start from.
    #[arg(long)]
    pub method: Option<Method>,
    /// Built-in settings, by name. Default: `paper`, and for a procedural organ its own; with `--method cco` it is
    /// `cco-disc` in a disc, else `cco-ball`.
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
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
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
    /// Bakes the vessels into textures of the organ's mesh, so many texels wide: a power of two from 16 to 8192. A mesh
    /// without usable texture coordinates is unwrapped, and written with those that it gets.
    #[arg(long, value_name = "SIZE")]
    pub bake: Option<u32>,
    /// The textures to bake.
    #[arg(long, value_delimiter = ',', default_value = "albedo,normal", value_name = "MAP", requires = "bake",
        value_parser = map_kinds())]
    pub maps: Vec<MapKind>,
    /// Format of the textures.
    #[arg(long, default_value = "png", requires = "bake")]
    pub map_format: MapFormat,
    /// Prints one line of JSON per organ, with the figures of its closed meshes if these are made.
    #[arg(long)]
    pub json: bool,
}

fn obj_sides() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(i64::from(ObjOptions::MIN_SIDES)..=i64::from(ObjOptions::MAX_SIDES))
}

fn map_kinds() -> impl TypedValueParser<Value = MapKind> {
    let by_name = |name: String| MapKind::ALL.into_iter().find(|kind| kind.name() == name);
    PossibleValuesParser::new(MapKind::ALL.map(MapKind::name)).try_map(move |name| by_name(name).ok_or("no such map"))
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
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::Um => "um",
        }
    }

    pub fn scale(self) -> Scale {
        match self {
            Self::M => Scale::METRES,
            Self::Cm => Scale::CENTIMETRES,
            Self::Mm => Scale::MILLIMETRES,
            Self::Um => Scale::MICROMETRES,
        }
    }
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
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Colonization => "colonization",
            Self::Cco => "cco",
        }
    }

    /// The settings to start from if none are named.
    pub fn preset(self, tissue: &Path) -> PresetName {
        match self {
            Self::Colonization => Procedural::named(tissue).map_or_else(PresetName::default, Procedural::preset),
            Self::Cco if tissue == "disc" => PresetName::CcoDisc,
            Self::Cco => PresetName::CcoBall,
        }
    }

    /// Whether settings grow vessels this way.
    pub fn is_of(self, generator: &Generator) -> bool {
        match self {
            Self::Colonization => generator.colonization().is_some(),
            Self::Cco => generator.cco().is_some(),
        }
    }
}

/// A share of the organs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Its number, below `of`.
    pub index: u64,
    /// Number of shares.
    pub of: u64,
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
    /// Over the surface, on the side that its triangles face, such as the inside of a hollow organ.
    Lining,
    /// Through the volume.
    Volume,
    /// Over the surface first, then inward through the volume.
    Staged,
}

impl Mode {
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Lining => "lining",
            Self::Volume => "volume",
            Self::Staged => "staged",
        }
    }

    /// The tissue's mode. Stages of the preset stay; otherwise half of all steps go to the surface.
    pub fn tissue_mode(self, preset: TissueMode, steps: u32) -> TissueMode {
        match (self, preset) {
            (Self::Surface, _) => TissueMode::Surface,
            (Self::Lining, _) => TissueMode::Lining,
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

impl Format {
    /// The extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Swc => "swc",
            Self::Obj | Self::ObjMesh => "obj",
            Self::Csv | Self::Levels => "csv",
            Self::Gxl => "gxl",
            Self::Svg => "svg",
            Self::Eps => "eps",
            Self::Glb => "glb",
            Self::Stl => "stl",
            Self::Ply => "ply",
            Self::Off => "off",
        }
    }
}
