//! What distinguishes a run from every other: the names of its files, and what stands in them.
//!
//! All files of a run begin with its name: tissue, mode, preset, and a hash of everything that its organs depend on
//! besides their seeds. The same in full is the file with the run's plain name: a preset for `--settings`.

use super::procedural::Procedural;
use super::{Failure, Job, Mode, Options};
use bevy_vessels::synthesis::{
    generator::Generator,
    io::write_atomically,
    mesh::TriangleMesh,
    preset::Preset,
    tissue::{Extent, Tissue, TissueMode, TissueSource},
    tree::{VesselKind, hash_bytes},
};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Most bytes of a part of a file's name. The run's hash covers what is cut off.
const MOST_BYTES: usize = 80;

/// A run: all organs that differ in nothing but the seed.
pub struct Run {
    /// Hash of everything that its organs and files depend on, besides the seed.
    pub hash: String,
    /// Where on a mesh its vessels grow.
    pub mode: Option<Mode>,
    /// The beginning of its files' names.
    name: String,
    /// Lines for the headers of files.
    facts: Vec<String>,
    /// Contents of the file with the run's name.
    record: String,
}

impl Run {
    /// The run of a command. `generator` is as it grows, fitted to the tissue, which is made of `mesh` if of any. `textures`
    /// describes those that are made.
    pub fn new(
        options: &Options,
        (preset, preset_name): (&Preset, &str),
        generator: &Generator,
        (tissue, mesh): (&dyn Tissue, Option<&TriangleMesh>),
        textures: Option<String>,
    ) -> Result<Self, Failure> {
        let mode = mode_of(&preset.tissue);
        let organ_seed = Procedural::seed(options);
        let of_seed = organ_seed.map_or(String::new(), |seed| format!(" of seed {seed}"));
        let mut facts = vec![format!("tissue: {}{of_seed}, {}", options.tissue.display(), described(tissue, mesh))];
        facts.extend(mode.map(|mode| format!("mode: {}", mode.name())));
        facts.push(format!("preset: {preset_name}"));
        facts.extend(changes(options).map(|changes| format!("changed: {changes}")));
        let unit = options.unit.map(|unit| format!("a tissue length is 1 {}", unit.name()));
        facts.push(unit.unwrap_or_else(|| "unit: that of the tissue".to_owned()));
        let meshes = format!("closed meshes: level {}, {} sides", options.mesh_level, options.mesh_sides);
        facts.push(format!("{meshes}; round cones: {} sides", options.obj_sides));
        let grown = Preset { generator: generator.clone(), fit: false, ..preset.clone() };
        if options.flow {
            facts.push("tables: with the flow".to_owned());
        }
        facts.extend(textures);
        let mut record = format!("// {} {}\n", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
        // Escaped, so that a path stays in its line.
        facts.iter().for_each(|fact| record.push_str(&format!("// {}\n", fact.escape_debug())));
        record.push_str(&grown.to_ron().map_err(Failure::run)?);
        record.push('\n');
        let hash = format!("{:08x}", hash_bytes([&record]) >> 32);
        let stem = options.tissue.file_stem().unwrap_or(options.tissue.as_os_str()).to_string_lossy();
        let stem = organ_seed.map_or_else(|| stem.to_string(), |seed| format!("{stem}-{seed}"));
        let parts = [Some(&*stem), mode.map(Mode::name), Some(preset_name), Some(&hash)];
        let name = parts.into_iter().flatten().map(file_name).collect::<Vec<_>>().join("_");
        Ok(Self { hash, mode, name, facts, record })
    }

    /// The beginning of the names of an organ's files.
    pub fn organ(&self, seed: u64) -> String {
        format!("{}_{}", self.name, padded(seed))
    }

    /// The name of a file about several organs.
    pub fn organs(&self, seeds: &str, ending: &str) -> String {
        format!("{}_{seeds}{ending}", self.name)
    }

    /// Header comments with all that is needed to grow a file's vessels again.
    ///
    /// `kind` is that of the vessels if the file has only one.
    pub fn comments(&self, job: &Job, kind: Option<VesselKind>, seed: u64, hash: u64) -> Vec<String> {
        let kind = kind.map_or(String::new(), |kind| format!("{} ", kind.name()));
        let first = format!("{kind}vessels of {}, preset {}, seed {seed}", job.tissue_name, job.preset_name);
        let whole = [format!("run: {}.ron", self.name), format!("hash of all kinds of vessels: {hash:016x}")];
        [first].into_iter().chain(self.facts.iter().cloned()).chain(whole).collect()
    }

    /// Writes the run's settings into a folder, beside those of other runs.
    ///
    /// Another run with the same name cannot go on there.
    pub fn claim(&self, folder: &Path) -> Result<(), Failure> {
        let path = folder.join(format!("{}.ron", self.name));
        match fs::read(&path) {
            Ok(there) if there == self.record.as_bytes() => Ok(()),
            Ok(_) => {
                let remedy = "files of this run would take the place of those; choose another --out";
                Err(Failure::Run(format!("{} holds other settings: {remedy}", path.display())))
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {
                write_atomically(&path, |out| out.write_all(self.record.as_bytes())).map_err(Failure::run)
            }
            Err(error) => Err(Failure::Run(format!("cannot read {}: {error}", path.display()))),
        }
    }
}

/// A seed as in names: names of up to a million organs are in the order of their seeds.
pub fn padded(seed: u64) -> String {
    format!("{seed:06}")
}

fn mode_of(source: &TissueSource) -> Option<Mode> {
    let TissueSource::Mesh(mesh) = source else { return None };
    Some(match mesh.mode {
        TissueMode::Surface => Mode::Surface,
        TissueMode::Lining => Mode::Lining,
        TissueMode::Volume => Mode::Volume,
        TissueMode::Staged { .. } => Mode::Staged,
    })
}

/// The extent of a tissue, and the hash of the mesh that it is made of.
fn described(tissue: &dyn Tissue, mesh: Option<&TriangleMesh>) -> String {
    let extent = match tissue.extent() {
        Extent::Length(value) => format!("length {value}"),
        Extent::Area(value) => format!("area {value}"),
        Extent::Volume(value) | Extent::Sheet { volume: value, .. } => format!("volume {value}"),
    };
    let Some(mesh) = mesh else { return extent };
    let corners = mesh.positions().iter().flat_map(|at| at.to_array()).map(f32::to_le_bytes);
    let triangles = mesh.triangles().iter().flatten().map(|corner| corner.to_le_bytes());
    let hash = hash_bytes(corners.chain(triangles));
    format!("{extent}, {} triangles with the hash {hash:016x}", mesh.triangles().len())
}

/// The options that change a preset, as they were given.
fn changes(options: &Options) -> Option<String> {
    let given = |name: &str, value: Option<String>| value.map(|value| format!("--{name} {value}"));
    let changes: Vec<String> = [
        given("mode", options.mode.map(|mode| mode.name().to_owned())),
        given("method", options.method.map(|method| method.name().to_owned())),
        given("terminals", options.terminals.map(|terminals| terminals.to_string())),
        given("steps", options.steps.map(|steps| steps.to_string())),
        given("samples", options.samples.map(|samples| samples.to_string())),
        given("lengths", (options.lengths != 1.0).then(|| options.lengths.to_string())),
        options.no_veins.then(|| "--no-veins".to_owned()),
    ]
    .into_iter()
    .flatten()
    .chain(options.set.iter().map(|set| format!("--set {set}")))
    .collect();
    (!changes.is_empty()).then(|| changes.join(" "))
}

/// A name without characters that are special to a file system or a shell. Letters of any script stay.
fn file_name(name: &str) -> String {
    let is_letter = |c: char| !(c.is_ascii() || c.is_whitespace() || c.is_control());
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.' || is_letter(c);
    let mut plain: String = name.chars().map(|c| if is_plain(c) { c } else { '-' }).collect();
    plain.truncate(plain.floor_char_boundary(MOST_BYTES));
    plain
}
