//! Files of trees with flow: graphs, pictures, and diameters by level in comparison with those of OpenCCO.

use crate::{arteries, settings};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::Cco,
    io::{GxlOptions, save_eps, save_gxl, save_levels, save_svg, write_eps, write_gxl, write_levels, write_svg},
    tissue::{Ball, Disc, Tissue},
    tree::{VesselKind, VesselTree},
};
use std::{io, sync::Arc};

fn grown(tissue: Arc<dyn Tissue>, terminals: u32, polish_sweeps: u32, seed: u64) -> Cco {
    let mut settings = settings(&*tissue, terminals);
    settings.polish_sweeps = polish_sweeps;
    let mut growth = arteries(tissue, settings, Vec3::Y * 0.5, seed);
    growth.run().expect("room for all");
    growth
}

fn disc(terminals: u32) -> Cco {
    grown(Arc::new(Disc::flat(0.5).expect("a disc")), terminals, 4, 1)
}

fn text(write: impl FnOnce(&mut Vec<u8>) -> io::Result<()>) -> String {
    let mut bytes = Vec::new();
    write(&mut bytes).expect("memory takes all");
    String::from_utf8(bytes).expect("text")
}

/// The numbers of an attribute, in the order of the file.
fn values(gxl: &str, name: &str) -> Vec<f64> {
    let start = format!("<attr name=\" {name}\">");
    let attributes = gxl.split(&start).skip(1);
    let value = |text: &str| text.split("<float>").nth(1)?.split("</float>").next()?.parse().ok();
    attributes.map(|text| value(text).expect("a number")).collect()
}

#[test]
fn a_graph_has_the_tree_its_flow_and_its_pressures() {
    let growth = disc(200);
    let tree = growth.tree(VesselKind::Artery);
    let flow = growth.settings().flow.artery;
    let options = GxlOptions { name: "a <b> & \"c\"".into(), flow, millimetres: growth.millimetres(), is_flat: true };
    let gxl = text(|out| write_gxl(out, tree, &options));
    assert!(gxl.starts_with("<gxl><graph id=\"a &lt;b&gt; &amp; &quot;c&quot;\" edgeids=\" true\""));
    assert!(gxl.ends_with("</graph></gxl>\n"));
    let count = |part: &str| gxl.matches(part).count();
    assert_eq!((count("<node "), count("<edge ")), (400, 399));
    assert_eq!((count("<string> root node </string>"), count("<string> terminal node </string>")), (1, 200));
    assert_eq!((count("<string> bifurication </string>"), count("<float>")), (199, 2 + 2 * 400 + 3 * 399));
    for (node, parent) in tree.segments() {
        assert!(gxl.contains(&format!("<edge id=\"e{node}\" to=\"n{node}\" from=\"n{parent}\">")));
    }
    // What flows through the root loses all pressure on its way: Q·R*/r⁴ (Eq. 5).
    let [flows, resistances, radii] = ["flow", "resistance", "radius"].map(|name| values(&gxl, name));
    assert!((flows[0] - 8330.0).abs() < 1e-6, "{}", flows[0]);
    let drop = flows[0] * resistances[0] / radii[0].powi(4);
    let expected = values(&gxl, "pPerf")[0] - values(&gxl, "pTerm")[0];
    assert!((drop / expected - 1.0).abs() < 1e-4, "{drop} instead of {expected}");
    // In space, positions have three coordinates.
    let solid = text(|out| write_gxl(out, tree, &GxlOptions { is_flat: false, ..options }));
    assert_eq!(solid.matches("<float>").count(), 2 + 3 * 400 + 3 * 399);
    assert_eq!(text(|out| write_gxl(out, &VesselTree::new(), &GxlOptions::default())).matches("<node").count(), 0);
}

#[test]
fn pictures_have_a_line_for_each_segment_within_their_frame() {
    let growth = disc(150);
    let tree = growth.tree(VesselKind::Artery);
    let trees = [(VesselKind::Artery, tree), (VesselKind::Duct, tree)];
    let svg = text(|out| write_svg(out, &trees));
    assert_eq!(svg.matches("<line ").count(), 2 * 299);
    let eps = text(|out| write_eps(out, &trees));
    assert!(eps.starts_with("%!PS-Adobe-3.0 EPSF-3.0\n") && eps.ends_with("%%EOF\n"));
    let lines: Vec<Vec<f64>> = eps
        .lines()
        .filter_map(|line| line.strip_suffix(" v"))
        .map(|line| line.split(' ').map(|number| number.parse().expect("a number")).collect())
        .collect();
    assert_eq!(lines.len(), 2 * 299);
    for line in lines {
        let [x1, y1, x2, y2, width] = line[..] else { panic!("{line:?}") };
        assert!([x1, y1, x2, y2].iter().all(|value| (7.9..=504.1).contains(value)) && width > 0.0, "{line:?}");
    }
    let empty = [(VesselKind::Vein, &VesselTree::new())];
    assert_eq!(text(|out| write_svg(out, &empty)).matches("<line ").count(), 0);
    assert!(text(|out| write_eps(out, &empty)).contains("%%BoundingBox: 0 0 512 512"));
}

#[test]
fn files_are_written_whole_or_not_at_all() {
    let growth = disc(20);
    let tree = growth.tree(VesselKind::Artery);
    let trees = [(VesselKind::Artery, tree)];
    let folder = std::env::temp_dir().join(format!("bevy_vessels_cco_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    save_gxl(folder.join("a.gxl"), tree, &GxlOptions::default()).expect("a file");
    save_svg(folder.join("a.svg"), &trees).expect("a file");
    save_eps(folder.join("a.eps"), &trees).expect("a file");
    save_levels(folder.join("a.csv"), &trees, 1.0).expect("a file");
    let mut names: Vec<_> =
        std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["a.csv", "a.eps", "a.gxl", "a.svg"]);
    assert!(save_gxl(folder.join("missing").join("a.gxl"), tree, &GxlOptions::default()).is_err());
    std::fs::remove_dir_all(folder).expect("the folder");
}

/// OpenCCO's mean diameters in mm by level, of single trees or of two.
const BALL: [(u32, &[(usize, f64)]); 2] = [
    (250, &[(0, 2.573), (1, 1.70), (2, 1.24), (3, 1.03), (4, 0.87), (5, 0.74), (6, 0.66), (8, 0.59), (10, 0.60)]),
    (1000, &[(0, 2.769), (1, 1.81), (2, 1.32), (3, 0.92), (4, 0.74), (5, 0.63), (6, 0.55), (8, 0.45), (10, 0.43)]),
];

#[test]
fn diameters_by_level_are_as_those_of_opencco() {
    for (terminals, expected) in BALL {
        let mut means: Vec<Vec<f64>> = vec![Vec::new(); 40];
        for seed in 1..=8 {
            let growth = grown(Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball")), terminals, 0, seed);
            let trees = [(VesselKind::Artery, growth.tree(VesselKind::Artery))];
            let csv = text(|out| write_levels(out, &trees, growth.millimetres()));
            assert!(csv.starts_with("system,level,segments,mean_diameter,sd_diameter,mean_length\narterial,0,1,"));
            let segments: usize =
                csv.lines().skip(1).map(|line| line.split(',').nth(2).unwrap().parse::<usize>().unwrap()).sum();
            assert_eq!(segments, 2 * terminals as usize - 1);
            for line in csv.lines().skip(1) {
                let columns: Vec<&str> = line.split(',').collect();
                let level: usize = columns[1].parse().expect("a level");
                if level < means.len() {
                    means[level].push(columns[3].parse().expect("a diameter"));
                }
            }
        }
        for &(level, diameter) in expected {
            let of = &means[level];
            let mean = of.iter().sum::<f64>() / of.len() as f64;
            let deviation = (of.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / of.len() as f64).sqrt();
            println!("{terminals} terminals, level {level}: {mean:.3} ± {deviation:.3}, OpenCCO {diameter}");
            // A single tree of OpenCCO is one draw from its spread, which at the root is small.
            assert!(
                (mean - diameter).abs() <= 2.0 * deviation + 0.05 * diameter,
                "level {level}: {mean} ± {deviation}"
            );
        }
    }
}
