//! Tables of segments, with and without the flow.

use crate::{random, small};
use bevy_math::vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{FlowSettings, Network},
    io::{CsvOptions, write_csv},
    tree::{ByKind, VesselKind},
    units::Scale,
};

#[test]
fn csv_has_one_line_per_segment_and_one_value_per_column() {
    let (arteries, veins) = (random(5, 80), small());
    let mut bytes = Vec::new();
    write_csv(&mut bytes, &[(VesselKind::Artery, &arteries), (VesselKind::Vein, &veins)], &CsvOptions::default())
        .expect("memory takes all");
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
    write_csv(&mut empty, &[], &CsvOptions::default()).expect("memory takes all");
    assert_eq!(String::from_utf8(empty).expect("text").lines().count(), 1, "the header alone");
}

#[test]
fn csv_has_the_flow_of_each_segment() {
    let (arteries, veins) = (small(), small());
    let settings = FlowSettings { scale: Scale::CENTIMETRES, ..FlowSettings::arterial() };
    let mut network = Network::new(&arteries, settings).expect("a network");
    network.solve().expect("a solution");
    let flows = ByKind { artery: Some(&network), ..ByKind::default() };
    let mut bytes = Vec::new();
    let trees = [(VesselKind::Artery, &arteries), (VesselKind::Vein, &veins)];
    write_csv(&mut bytes, &trees, &CsvOptions { flows }).expect("memory takes all");
    let text = String::from_utf8(bytes).expect("text");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|&other| other == name).expect("a column");
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    let number = |row: &[&str], name: &str| row[column(name)].parse::<f64>().expect("a number");
    let mut inflow = 0.0;
    for row in rows.iter().filter(|row| row[0] == "arterial") {
        let [p0, p1, flow] = ["p0_mmhg", "p1_mmhg", "flow_ml_per_min"].map(|name| number(row, name));
        let [radius, length] = ["r1", "length"].map(|name| 0.01 * number(row, name));
        let flow = flow * 1e-6 / 60.0;
        let velocity = flow / (std::f64::consts::PI * radius * radius);
        assert!((number(row, "velocity_m_per_s") / velocity - 1.0).abs() < 1e-6);
        // The balance of forces on the blood in a straight tube: Δp·πr² = τ·2πr·L.
        let shear = (p0 - p1) * 133.322_387_415 * radius / (2.0 * length);
        assert!((number(row, "shear_pa") / shear - 1.0).abs() < 1e-6, "{} is not {shear}", number(row, "shear_pa"));
        if row[column("parent")] == "0" || row[column("parent")] == "4" {
            assert!((p0 - 95.0).abs() < 1e-9, "roots have the arterial pressure");
            inflow += number(row, "flow_ml_per_min");
        }
    }
    assert!((inflow / network.inflow().ml_per_min() - 1.0).abs() < 1e-9);
    assert!(rows.iter().filter(|row| row[0] == "venous").all(|row| row[15..].iter().all(|cell| cell.is_empty())));
    let other = Network::new(&random(1, 9), FlowSettings::arterial()).expect("a network");
    let flows = ByKind { artery: Some(&other), ..ByKind::default() };
    let mut bytes = Vec::new();
    let error = write_csv(&mut bytes, &trees, &CsvOptions { flows }).expect_err("the flow of another tree");
    assert!(error.to_string().contains("9 nodes, but the tree 6") && bytes.is_empty(), "{error}");
}
