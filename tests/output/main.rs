//! Files: written whole or not at all, readable by other programs, and read back bit for bit.

mod csv;
mod obj;
#[path = "../common/shared.rs"]
mod shared;
mod whole;

use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::io::{ObjOptions, ReadError, SwcOptions, SwcReadOptions, load_swc, read_swc, write_swc};
use bevy_vessels::synthesis::mesh::MAX_COORDINATE;
use bevy_vessels::synthesis::random::Stream;
use bevy_vessels::synthesis::tree::{NO_PARENT, VesselKind, VesselTree};
use bevy_vessels::synthesis::units::Scale;
use rand::{Rng, RngExt};
use std::path::PathBuf;
use std::{fs, io};

/// A temporary folder of a test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_vessels_{name}_{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder for temporary files");
        Self(path)
    }

    fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn names(&self) -> Vec<String> {
        let name =
            |entry: io::Result<fs::DirEntry>| entry.expect("an entry").file_name().to_string_lossy().into_owned();
        let mut names: Vec<String> = fs::read_dir(&self.0).expect("a folder").map(name).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

/// A forest with coordinates of all f32 magnitudes that can be read.
fn random(seed: u64, size: usize) -> VesselTree {
    let mut rng = Stream::Statistics.rng(seed);
    let mut number = || loop {
        let value = f32::from_bits(rng.next_u32());
        if value.abs() <= MAX_COORDINATE {
            return value;
        }
    };
    let positions = (0..size).map(|_| vec3(number(), number(), number())).collect();
    let radii = (0..size).map(|_| number().abs().max(f32::MIN_POSITIVE)).collect();
    let mut rng = Stream::Roots.rng(seed);
    let parent = |node| if node == 0 || rng.random_range(0..9) == 0 { NO_PARENT } else { rng.random_range(0..node) };
    let parents = (0..size as u32).map(parent).collect();
    VesselTree::from_arrays(positions, parents, radii).expect("a well-formed tree")
}

/// A trunk with two daughters and a thin side branch, and a second tree.
fn small() -> VesselTree {
    let positions = vec![Vec3::ZERO, Vec3::X, vec3(1.5, 0.5, 0.0), vec3(1.5, -0.5, 0.25), Vec3::Z, Vec3::Z + Vec3::X];
    VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, 1, NO_PARENT, 4], vec![0.2, 0.2, 0.15, 0.1, 0.1, 0.05])
        .expect("a well-formed tree")
}

fn swc(tree: &VesselTree) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_swc(&mut bytes, tree, &SwcOptions::default()).expect("memory takes all");
    bytes
}

fn read(text: impl AsRef<[u8]>) -> Result<VesselTree, ReadError> {
    read_swc(text.as_ref(), &SwcReadOptions::default())
}

#[test]
fn swc_comes_back_to_the_bit() {
    for seed in 0..40 {
        let tree = random(seed, seed as usize * 5);
        let back = read(swc(&tree)).expect("what was written");
        assert_eq!(back.hash64(), tree.hash64(), "seed {seed}");
    }
}

#[test]
fn swc_is_what_another_reader_takes_it_for() {
    let tree = random(1, 300);
    let options = SwcOptions { comments: vec!["unit: m\nseed: 7".into()], structure: 5, ..SwcOptions::default() };
    let mut bytes = Vec::new();
    write_swc(&mut bytes, &tree, &options).expect("memory takes all");
    let other = swc_neuron::AnySwc::from_reader(bytes.as_slice()).expect("a standard SWC file");
    assert_eq!(other.samples.len(), tree.len());
    let header = other.header.expect("a header");
    assert!(header.trim_start().starts_with("bevy_vessels "), "{header}");
    assert!(header.contains("unit: m") && header.contains("seed: 7"), "{header}");
    for (node, sample) in other.samples.iter().enumerate() {
        assert_eq!(sample.sample_id, node as u64 + 1);
        assert_eq!(isize::from(sample.structure), 5);
        let position = vec3(sample.x as f32, sample.y as f32, sample.z as f32);
        assert_eq!(position, tree.positions()[node]);
        assert_eq!(sample.radius as f32, tree.radii()[node]);
        let parent = tree.parents()[node];
        assert_eq!(sample.parent_id, (parent != NO_PARENT).then_some(u64::from(parent) + 1));
    }
}

#[test]
fn swc_with_a_unit_is_in_micrometres() {
    let tree = small();
    let options = SwcOptions { scale: Some(Scale::MILLIMETRES), ..SwcOptions::default() };
    let mut bytes = Vec::new();
    write_swc(&mut bytes, &tree, &options).expect("memory takes all");
    assert!(String::from_utf8_lossy(&bytes).contains("\n# unit: um; a tissue length is 0.001 m\n"));
    let back = read(bytes).expect("a tree");
    for node in 0..tree.len() {
        assert!(back.positions()[node].distance(1e3 * tree.positions()[node]) < 1e-3);
        assert!((back.radii()[node] - 1e3 * tree.radii()[node]).abs() < 1e-3);
    }
    assert_eq!(back.parents(), tree.parents());
}

/// A path with line breaks must not become a node or a vertex.
#[test]
fn comments_never_become_data() {
    let tree = small();
    let comments = vec!["tissue: a\r1 0 0 0 0 1 -1\nv 0 0 0\u{2028}b\\".to_owned()];
    let mut bytes = Vec::new();
    let options = SwcOptions { comments: comments.clone(), ..SwcOptions::default() };
    write_swc(&mut bytes, &tree, &options).expect("memory takes all");
    assert_eq!(read(bytes).expect("a tree"), tree);
    let trees = [(VesselKind::Artery, &tree)];
    let plain = obj::obj(&trees, &ObjOptions::default());
    let with = obj::obj(&trees, &ObjOptions { comments, ..ObjOptions::default() });
    let data = |bytes: &[u8]| {
        String::from_utf8_lossy(bytes)
            .lines()
            .filter(|line| !line.starts_with('#'))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(data(&with), data(&plain));
    assert!(with.starts_with(b"# ") && String::from_utf8_lossy(&with).contains("\n# tissue: a\n# 1 0 0 0 0 1 -1\n"));
}

#[test]
fn swc_in_any_order_gives_the_same_tree() {
    let tree = small();
    let text = String::from_utf8(swc(&tree)).expect("text");
    let mut lines: Vec<&str> = text.lines().collect();
    lines.reverse();
    let back = read(lines.join("\n")).expect("a tree in reverse");
    assert_eq!((back.len(), back.roots().count()), (6, 2));
    let (a, b) = (tree.statistics(), back.statistics());
    assert_eq!((a.leaves, a.bifurcations, a.strahler_orders()), (b.leaves, b.bifurcations, b.strahler_orders()));
    assert!((a.total_length - b.total_length).abs() < 1e-9);
    let mut nodes: Vec<[u32; 4]> = Vec::new();
    for tree in [&tree, &back] {
        let key = |(p, r): (&Vec3, &f32)| [p.x, p.y, p.z, *r].map(f32::to_bits);
        let mut keys: Vec<[u32; 4]> = tree.positions().iter().zip(tree.radii()).map(key).collect();
        keys.sort_unstable();
        assert!(nodes.is_empty() || nodes == keys, "the same nodes");
        nodes = keys;
    }
}

#[test]
fn swc_of_other_programs_is_read() {
    let text = b"\xef\xbb\xbf# scale in \xb5m\r\n\r\n  10 3 1e0 -2.5E-1 .5 +1.5 -1 extra 9\r\n7\t0\t2\t3\t4\t1\t10 # to 10\r\n";
    let tree = read(text).expect("a tree");
    assert_eq!(tree.positions(), [vec3(1.0, -0.25, 0.5), vec3(2.0, 3.0, 4.0)]);
    assert_eq!((tree.parents(), tree.radii()), (&[NO_PARENT, 0][..], &[1.5, 1.0][..]));
    assert!(read("").expect("nothing").is_empty());
    assert!(read("# only\n\n#comments").expect("nothing").is_empty());
}

#[test]
fn swc_errors_name_the_line_and_what_is_expected() {
    let message = |text: &str| read(text).expect_err(text).to_string();
    let root = "1 0 0 0 0 1 -1\n";
    for (line, expected) in [
        ("2 0 0 0 0 1", "line 2 has 6 columns"),
        ("2 0 0 zero 0 1 1", "line 2: y must be a number within ±1e9"),
        ("2 0 0 0 NaN 1 1", "line 2: z must be a number"),
        ("2 0 1e39 0 0 1 1", "line 2: x must be a number"),
        ("2 0 0 0 0 inf 1", "line 2: radius must be a number"),
        ("2 0 0 0 0 0 1", "line 2: radius must be above 0"),
        ("2 0 0 0 0 -1 1", "line 2: radius must be above 0"),
        ("2.5 0 0 0 0 1 1", "line 2: id must be a whole number"),
        ("-2 0 0 0 0 1 1", "line 2: id must be"),
        ("2 axon 0 0 0 1 1", "line 2: type must be"),
        ("2 0 0 0 0 1 -2", "line 2: parent must be"),
        ("1 0 0 0 0 1 -1", "line 2: the node has the id of the node in line 1"),
        ("2 0 0 0 0 1 99", "line 2: no node has the parent's id"),
        ("2 0 0 0 0 1 2", "line 2: the node is its own ancestor"),
        ("99999999999999999999 0 0 0 0 1 1", "line 2: id must be"),
    ] {
        let found = message(&format!("{root}{line}\n"));
        assert!(found.starts_with(expected), "{line}: {found}");
    }
    let loops = message("1 0 0 0 0 1 -1\n2 0 0 0 0 1 3\n3 0 0 0 0 1 4\n4 0 0 0 0 1 3\n");
    assert!(
        loops.starts_with("line 3: the node") || loops.starts_with("line 4: the node"),
        "2 is not on the loop: {loops}"
    );
    let long = message(&format!("1 0 {} 0 0 1 -1", "x".repeat(100_000)));
    assert!(long.len() < 200, "a message of {} bytes", long.len());
    let missing = load_swc("no/such/file.swc", &SwcReadOptions::default()).expect_err("no file").to_string();
    assert!(missing.contains("file.swc"), "{missing}");
}

#[test]
fn swc_of_any_bytes_never_panics() {
    let good = swc(&random(3, 30));
    let mut rng = Stream::Attraction.rng(9);
    let mut read_well = 0;
    for _ in 0..3000 {
        let mut bytes = good.clone();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..bytes.len());
            match rng.random_range(0..4) {
                0 => bytes[at] = rng.random(),
                1 => bytes.truncate(at.max(1)),
                2 => bytes.insert(at, b"0123456789-. \n#e"[rng.random_range(0..16)]),
                _ => drop(bytes.remove(at)),
            }
            if bytes.is_empty() {
                break;
            }
        }
        if let Ok(tree) = read(&bytes) {
            tree.validate().expect("what is read is well formed");
            read_well += 1;
        }
    }
    assert!(read_well > 100 && read_well < 3000, "{read_well} of 3000 were still trees");
}

#[test]
fn least_radius_lifts_what_is_too_thin() {
    let text = "1 0 0 0 0 0 -1\n2 0 1 0 0 -3 1\n3 0 2 0 0 4 2\n";
    let options = SwcReadOptions { least_radius: Some(0.5) };
    assert_eq!(read_swc(text.as_bytes(), &options).expect("a tree").radii(), [0.5, 0.5, 4.0]);
    for without_effect in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let options = SwcReadOptions { least_radius: Some(without_effect) };
        assert!(read_swc(text.as_bytes(), &options).is_err());
    }
}

/// Nodes, roots, leaves and total length of the shared test vessels, and `N_k` if they are trees.
#[test]
fn real_vessels_come_back_and_have_the_published_statistics() {
    let Some(folder) = shared::folder("data/vessels") else { return };
    let published = fs::read_to_string(folder.join("vessel_stats.json")).expect("published statistics");
    let published: serde_json::Value = serde_json::from_str(&published).expect("JSON");
    for (name, expected) in published.as_object().expect("an object") {
        let path = folder.join(format!("{name}.swc"));
        let strict = load_swc(&path, &SwcReadOptions::default());
        let has_zero_radii = expected["radius_min"].as_f64() == Some(0.0);
        assert_eq!(strict.is_err(), has_zero_radii, "{name}");
        let tree = load_swc(&path, &SwcReadOptions { least_radius: Some(1e-3) }).expect(name);
        tree.validate().expect(name);
        assert_eq!(read(swc(&tree)).expect(name), tree, "{name}");
        let statistics = tree.statistics();
        assert_eq!(Some(statistics.nodes as u64), expected["nodes"].as_u64(), "{name}");
        assert_eq!(Some(statistics.roots as u64), expected["components"].as_u64(), "{name}");
        if expected["independent_cycles"].as_u64() == Some(0) {
            let length = expected["total_length"].as_f64().expect("a length");
            assert!((statistics.total_length / length - 1.0).abs() < 1e-3, "{name}: {}", statistics.total_length);
            let counts: Vec<u64> = statistics.strahler.iter().map(|order| order.streams as u64).collect();
            let expected: Vec<u64> = expected["morph"]["strahler_stream_counts"]
                .as_array()
                .map(|counts| counts.iter().filter_map(serde_json::Value::as_u64).collect())
                .unwrap_or_default();
            assert_eq!(counts, expected, "{name}");
        }
    }
}
