//! Files: written whole or not at all, readable by other programs, and read back bit for bit.

use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::io::{
    ObjOptions, ReadError, SwcOptions, SwcReadOptions, WriteError, load_swc, read_swc, save_csv, save_obj, save_swc,
    write_atomically, write_csv, write_obj, write_swc,
};
use bevy_vessels::synthesis::mesh::MAX_COORDINATE;
use bevy_vessels::synthesis::random::Stream;
use bevy_vessels::synthesis::tree::{NO_PARENT, VesselKind, VesselTree};
use rand::{Rng, RngExt};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

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
    let options = SwcOptions { comments: vec!["unit: m\nseed: 7".into()], structure: 5 };
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
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/vessels"));
    let Ok(published) = fs::read_to_string(folder.join("vessel_stats.json")) else {
        println!("skipped: no real vessels at {}", folder.display());
        return;
    };
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

#[test]
fn csv_has_one_line_per_segment_and_one_value_per_column() {
    let (arteries, veins) = (random(5, 80), small());
    let mut bytes = Vec::new();
    write_csv(&mut bytes, &[(VesselKind::Artery, &arteries), (VesselKind::Vein, &veins)]).expect("memory takes all");
    let text = String::from_utf8(bytes).expect("text");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let column = |name: &str| header.iter().position(|&other| other == name).expect("a column");
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), arteries.segments().count() + veins.segments().count());
    assert!(rows.iter().all(|row| row.len() == header.len()));
    assert!(rows.iter().all(|row| row[1..].iter().all(|value| value.parse::<f64>().is_ok())));
    let segments = arteries.segments().map(|s| (&arteries, "arterial", s));
    for (row, (tree, system, (node, parent))) in
        rows.iter().zip(segments.chain(veins.segments().map(|s| (&veins, "venous", s))))
    {
        let float = |name: &str| row[column(name)].parse::<f32>().expect("a number");
        assert_eq!(row[column("system")], system);
        assert_eq!(row[column("id")], node.to_string());
        assert_eq!(row[column("parent")], parent.to_string());
        assert_eq!(vec3(float("x0"), float("y0"), float("z0")), tree.positions()[parent]);
        assert_eq!(vec3(float("x1"), float("y1"), float("z1")), tree.positions()[node]);
        assert_eq!([float("r0"), float("r1")], [tree.radii()[parent], tree.radii()[node]]);
        assert_eq!(row[column("strahler")], tree.strahler_orders()[node].to_string());
    }
    let mut empty = Vec::new();
    write_csv(&mut empty, &[]).expect("memory takes all");
    assert_eq!(String::from_utf8(empty).expect("text").lines().count(), 1, "the header alone");
}

/// Triangles of an OBJ file by group, read by another program.
fn parse_obj(bytes: &[u8]) -> Vec<tobj::Model> {
    let options = tobj::LoadOptions { single_index: true, ..Default::default() };
    let mut reader = io::BufReader::new(bytes);
    tobj::load_obj_buf(&mut reader, &options, |_| Err(tobj::LoadError::OpenFileFailed)).expect("an OBJ file").0
}

fn obj(trees: &[(VesselKind, &VesselTree)], options: &ObjOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_obj(&mut bytes, trees, options).expect("memory takes all");
    bytes
}

fn points(values: &[f32]) -> Vec<Vec3> {
    values.chunks_exact(3).map(Vec3::from_slice).collect()
}

#[test]
fn obj_segments_are_closed_outward_round_cones() {
    let tree = small();
    for (sides, cap_rings) in [(3, 1), (8, 2), (13, 5), (64, 32)] {
        let options = ObjOptions { sides, cap_rings };
        let models = parse_obj(&obj(&[(VesselKind::Artery, &tree), (VesselKind::Vein, &tree)], &options));
        assert_eq!(models.iter().map(|model| model.name.as_str()).collect::<Vec<_>>(), ["arterial", "venous"]);
        for model in &models {
            let positions = points(&model.mesh.positions);
            let normals = points(&model.mesh.normals);
            let triangles: Vec<[u32; 3]> = model.mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            let per_segment = 2 + 2 * cap_rings * sides;
            let segments = tree.segments().count() as u32;
            assert_eq!(positions.len() as u32, per_segment * segments);
            assert_eq!(triangles.len() as u32, (2 * per_segment - 4) * segments, "V − E + F = 2 for each");
            // Closed and oriented: every directed edge once, and its opposite, too.
            let mut edges: Vec<(u32, u32)> = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
            edges.sort_unstable();
            assert!(edges.windows(2).all(|pair| pair[0] != pair[1]));
            assert!(edges.iter().all(|&(a, b)| edges.binary_search(&(b, a)).is_ok()));
            for [a, b, c] in triangles.iter().map(|t| t.map(|i| i as usize)) {
                let normal = (positions[b] - positions[a]).cross(positions[c] - positions[a]);
                assert!(normal.length() > 0.0, "no triangle without area");
                assert!(normal.dot(normals[a] + normals[b] + normals[c]) > 0.0, "triangles face outwards");
            }
            assert!(normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-3));
        }
    }
}

/// Volume of the hull of two spheres, by integrating its cross-section: at each plane across the axis, the widest of
/// the spheres between both ends.
fn round_cone_volume(a: (Vec3, f32), b: (Vec3, f32)) -> f64 {
    let length = f64::from(a.0.distance(b.0));
    let (ra, rb) = (f64::from(a.1), f64::from(b.1));
    let (low, high) = ((-ra).min(length - rb), ra.max(length + rb));
    let slice = (high - low) / 2000.0;
    let area = |x: f64| {
        let squared_radius = |t: f64| (ra + (rb - ra) * t).powi(2) - (x - length * t).powi(2);
        std::f64::consts::PI * (0..=200).map(|i| squared_radius(f64::from(i) / 200.0)).fold(0.0, f64::max)
    };
    (0..2000).map(|i| area(low + (f64::from(i) + 0.5) * slice) * slice).sum()
}

#[test]
fn obj_has_the_volume_of_its_round_cones() {
    for (length, r0, r1) in [(1.0, 0.2, 0.2), (1.0, 0.25, 0.2), (0.02, 0.2, 0.19), (0.1, 0.13, 0.5)] {
        let ends = [(Vec3::ONE, r0), (Vec3::ONE + vec3(0.6, 0.0, -0.8) * length, r1)];
        let tree =
            VesselTree::from_arrays(ends.map(|e| e.0).to_vec(), vec![NO_PARENT, 0], vec![r0, r1]).expect("a tree");
        let models = parse_obj(&obj(&[(VesselKind::Artery, &tree)], &ObjOptions { sides: 64, cap_rings: 32 }));
        let positions = points(&models[0].mesh.positions);
        let corner = |i: u32| positions[i as usize].as_dvec3();
        let volume: f64 = models[0]
            .mesh
            .indices
            .chunks_exact(3)
            .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0)
            .sum();
        let expected = round_cone_volume(ends[0], ends[1]);
        assert!((volume / expected - 1.0).abs() < 0.01, "{length} {r0} {r1}: {volume} is not {expected}");
    }
}

#[test]
fn obj_stands_coinciding_nodes_lone_roots_and_odd_options() {
    let positions = vec![Vec3::ONE, Vec3::ONE, Vec3::ONE + Vec3::X * 1e-3, Vec3::ZERO];
    let tree = VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, NO_PARENT], vec![0.1, 0.1, 0.05, 1.0])
        .expect("a tree");
    for options in [ObjOptions { sides: 0, cap_rings: 0 }, ObjOptions { sides: u32::MAX, cap_rings: u32::MAX }] {
        let models = parse_obj(&obj(&[(VesselKind::Vein, &tree)], &options));
        let positions = points(&models[0].mesh.positions);
        assert!(positions.iter().all(|p| p.is_finite() && p.distance(Vec3::ONE) < 0.2));
        for t in models[0].mesh.indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize]);
            assert!((b - a).cross(c - a).length() > 0.0);
        }
    }
    assert_eq!(obj(&[], &ObjOptions::default()).iter().filter(|&&byte| byte == b'\n').count(), 1);
}

#[test]
fn the_same_tree_gives_the_same_bytes() {
    let tree = random(8, 100);
    assert_eq!(swc(&tree), swc(&tree.clone()));
    let trees = [(VesselKind::Artery, &tree)];
    assert_eq!(obj(&trees, &ObjOptions::default()), obj(&trees, &ObjOptions::default()));
}

#[test]
fn saved_files_hold_what_is_written() {
    let folder = Folder::new("saved");
    let (tree, options) = (random(2, 60), ObjOptions::default());
    let trees = [(VesselKind::Vein, &tree)];
    save_swc(folder.join("a.swc"), &tree, &SwcOptions::default()).expect("a file");
    save_obj(folder.join("a.obj"), &trees, &options).expect("a file");
    save_csv(folder.join("a.csv"), &trees).expect("a file");
    assert_eq!(folder.names(), ["a.csv", "a.obj", "a.swc"]);
    let content = |name| fs::read(folder.join(name)).expect("a file");
    assert_eq!(content("a.swc"), swc(&tree));
    assert_eq!(content("a.obj"), obj(&trees, &options));
    assert!(content("a.csv").starts_with(b"system,id,"));
    assert_eq!(load_swc(folder.join("a.swc"), &SwcReadOptions::default()).expect("a tree"), tree);
}

#[test]
fn a_file_is_replaced_whole() {
    let folder = Folder::new("replaced");
    let path = folder.join("tree.swc");
    for content in ["first", "second, longer", "3rd"] {
        write_atomically(&path, |out| out.write_all(content.as_bytes())).expect("a file");
        assert_eq!(fs::read_to_string(&path).expect("a file"), content);
    }
    assert_eq!(folder.names(), ["tree.swc"]);
}

#[test]
fn a_failing_writer_leaves_the_old_file() {
    let folder = Folder::new("failing");
    let path = folder.join("tree.swc");
    fs::write(&path, "old").expect("a file");
    // More than any buffer, so that some data is on the disk when the writer fails.
    let fail = |out: &mut dyn Write| {
        out.write_all(&vec![b'x'; 1 << 20])?;
        Err(io::Error::other("out of ink"))
    };
    let error = write_atomically(&path, fail).expect_err("the writer fails");
    assert!(matches!(&error, WriteError::Write { path: named, .. } if *named == path), "{error:?}");
    assert!(error.to_string().contains("tree.swc") && error.to_string().contains("out of ink"), "{error}");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "old");
    assert_eq!(folder.names(), ["tree.swc"], "nothing is left behind");
    write_atomically(folder.join("new.swc"), fail).expect_err("the writer fails");
    assert_eq!(folder.names(), ["tree.swc"], "nothing half written appears");
    let panicking = path.clone();
    std::thread::spawn(move || write_atomically(panicking, |_| panic!("a bug in a writer")))
        .join()
        .expect_err("a panic");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "old");
    assert_eq!(folder.names(), ["tree.swc"]);
}

#[test]
fn paths_that_cannot_be_written_are_named() {
    let folder = Folder::new("paths");
    let nothing = |_: &mut dyn Write| Ok(());
    let missing = write_atomically(folder.join("no/such/tree.swc"), nothing).expect_err("no folder");
    assert!(matches!(missing, WriteError::Create { .. }) && missing.to_string().contains("tree.swc"), "{missing}");
    fs::create_dir_all(folder.join("taken/full")).expect("a folder");
    let taken = write_atomically(folder.join("taken"), nothing).expect_err("a folder has the name");
    assert!(matches!(taken, WriteError::Replace { .. }), "{taken}");
    assert!(matches!(write_atomically("/", nothing), Err(WriteError::NoFileName { .. })));
    assert!(matches!(write_atomically("..", nothing), Err(WriteError::NoFileName { .. })));
    assert_eq!(folder.names(), ["taken"]);
}

#[test]
fn many_writers_of_one_file_leave_one_whole_content() {
    let folder = Folder::new("many");
    let path = folder.join("tree.csv");
    std::thread::scope(|scope| {
        for writer in 0..8u8 {
            let path = &path;
            scope.spawn(move || {
                for _ in 0..10 {
                    write_atomically(path, |out| out.write_all(&vec![b'a' + writer; 50_000])).expect("a file");
                    let found = fs::read(path).expect("a file");
                    assert!(found.len() == 50_000 && found.iter().all(|byte| *byte == found[0]));
                }
            });
        }
    });
    assert_eq!(folder.names(), ["tree.csv"]);
}

/// Set for the process that must die while it writes.
const VICTIM: &str = "BEVY_VESSELS_TEST_DIE_WRITING";

#[test]
fn a_killed_process_leaves_the_old_file() {
    if let Some(path) = std::env::var_os(VICTIM) {
        let result = write_atomically(path, |out| {
            out.write_all(&vec![b'x'; 1 << 20])?;
            std::process::abort()
        });
        unreachable!("the process is dead: {result:?}");
    }
    let folder = Folder::new("killed");
    let path = folder.join("tree.swc");
    fs::write(&path, "old").expect("a file");
    let victim = std::process::Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", "a_killed_process_leaves_the_old_file", "--nocapture"])
        .env(VICTIM, &path)
        .output()
        .expect("a process");
    assert!(!victim.status.success(), "the process should have died");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "old");
    let leftovers: Vec<String> = folder.names().into_iter().filter(|name| name != "tree.swc").collect();
    assert_eq!(leftovers.len(), 1, "the process died while it wrote: {leftovers:?}");
    assert!(leftovers[0].ends_with(".tmp"));
    write_atomically(&path, |out| out.write_all(b"new")).expect("leftovers are in nobody's way");
    assert_eq!(fs::read_to_string(&path).expect("a file"), "new");
}
