//! The L-systems of the example: texts, turtles, errors, and closed surfaces of what they draw.

#[path = "../examples/lsystem_tree/mod.rs"]
mod lsystem_tree;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    mesh::self_intersections,
    surface::{Surface, SurfaceSettings},
    tree::VesselTree,
};
use lsystem_tree::{
    error::LSystemError,
    presets::{PRESETS, Preset},
    rewriting::Grammar,
    turtle::Turtle,
};

const TURTLE: Turtle = Turtle { angle: 90.0, length: 2.0, length_ratio: 0.5, diameter: 1.0, diameter_ratio: 0.8 };

fn draw(text: &str) -> VesselTree {
    TURTLE.draw(text).expect("a tree")
}

#[test]
fn texts_are_rewritten_all_at_once() {
    // Lindenmayer's algae: lengths are Fibonacci's numbers.
    let algae = Grammar { axiom: "A", rules: &[('A', "AB"), ('B', "A")] };
    assert_eq!(algae.expand(0).expect("a text"), "A");
    assert_eq!(algae.expand(4).expect("a text"), "ABAABABA");
    let lengths: Vec<usize> = (0..9).map(|generation| algae.expand(generation).expect("a text").len()).collect();
    assert_eq!(lengths, [1, 2, 3, 5, 8, 13, 21, 34, 55]);
    let koch = Grammar { axiom: "F-F", rules: &[('F', "F+F-F"), ('F', "never")] };
    assert_eq!(koch.expand(1).expect("a text"), "F+F-F-F+F-F", "symbols without a rule stay; the first rule counts");
    let still = Grammar { axiom: "FÄ[x]", rules: &[] };
    assert_eq!(still.expand(u32::MAX).expect("a text"), "FÄ[x]", "what does not change takes no time");
}

#[test]
fn a_text_without_end_is_an_error_in_time() {
    let doubling = Grammar { axiom: "A", rules: &[('A', "AA")] };
    let most = Grammar::MOST_SYMBOLS;
    assert_eq!(doubling.expand(20).expect("a text").len(), most);
    assert_eq!(doubling.expand(21), Err(LSystemError::TooLong { generation: 21, most }));
    assert_eq!(doubling.expand(u32::MAX), Err(LSystemError::TooLong { generation: 21, most }));
}

#[test]
fn each_turn_goes_its_way() {
    // From heading y, left −x, up z.
    for (text, direction) in [
        ("F", Vec3::Y),
        ("+F", Vec3::NEG_X),
        ("-F", Vec3::X),
        ("&F", Vec3::NEG_Z),
        ("^F", Vec3::Z),
        // Left goes down, or the right does.
        ("\\+F", Vec3::NEG_Z),
        ("/+F", Vec3::Z),
        ("\\-F", Vec3::Z),
        ("+&F", Vec3::NEG_Z),
        ("&+F", Vec3::NEG_X),
        ("+-^&/\\F", Vec3::Y),
        ("++++F", Vec3::Y),
        ("xAF\n B", Vec3::Y),
    ] {
        let tree = draw(text);
        assert_eq!((tree.len(), tree.parents()[1]), (2, 0), "{text:?}");
        assert!(tree.positions()[1].distance(2.0 * direction) < 1e-5, "{text:?} ends at {}", tree.positions()[1]);
    }
}

#[test]
fn brackets_return_and_ratios_stay_within_them() {
    let tree = draw("F[+!\"F[!\"F]]-F");
    assert_eq!(tree.parents()[1..], [0, 1, 2, 1]);
    let radii = [0.5, 0.5, 0.4, 0.32, 0.5];
    assert!(tree.radii().iter().zip(radii).all(|(radius, expected)| (radius - expected).abs() < 1e-6), "{tree:?}");
    let lengths: Vec<f64> = (1..5).map(|node| (1e4 * tree.segment_length(node)).round() / 1e4).collect();
    assert_eq!(lengths, [2.0, 1.0, 0.5, 2.0]);
    assert_eq!(draw("").len(), 1, "the root alone");
}

#[test]
fn what_is_wrong_is_named_with_its_position() {
    let error = |text: &str| TURTLE.draw(text).expect_err("an error");
    assert_eq!(error("F]"), LSystemError::Unopened { position: 2 });
    assert_eq!(error("F[+F]]F[F"), LSystemError::Unopened { position: 6 });
    assert_eq!(error("[F[F]F"), LSystemError::Unclosed { position: 1 });
    assert_eq!(error("ÄÖ[F[F"), LSystemError::Unclosed { position: 5 });
    assert_eq!(error("FF(F)"), LSystemError::Unknown { symbol: '(', position: 3 });
    assert!(error("F[+F]]").to_string().starts_with("symbol 6 is a ']' without a '['"));
    for turtle in [
        Turtle { diameter: 0.0, ..TURTLE },
        Turtle { diameter_ratio: -1.0, ..TURTLE },
        Turtle { length: f32::NAN, ..TURTLE },
        Turtle { angle: f32::INFINITY, ..TURTLE },
    ] {
        assert!(matches!(turtle.draw("F+!\"F"), Err(LSystemError::Tree(_))), "{turtle:?}");
    }
}

fn preset(name: &str) -> Preset {
    PRESETS.into_iter().find(|preset| preset.name == name).expect("a preset")
}

#[test]
fn presets_have_as_many_nodes_as_their_rules_say() {
    for generations in 0..7 {
        let tree = |name| preset(name).tree(generations).expect("a tree");
        let tips = 1 << generations;
        assert_eq!(tree("stem").len(), 3 + 4 * (tips - 1));
        let binary = tree("binary");
        assert_eq!((binary.len(), binary.tips().len()), (2 + 2 * (tips - 1), tips));
        // A segment of the trunk and a side branch each generation; the branch then gets three segments each generation.
        let grown: u32 = (0..generations).map(|age| 2 + 3 * age).sum();
        assert_eq!(tree("monopodial").len(), 2 + grown as usize);
    }
}

#[test]
fn the_binary_tree_is_symmetric_and_follows_murrays_law() {
    let binary = preset("binary");
    let tree = binary.tree(binary.generations).expect("a tree");
    assert!(tree.murray_residual(3.0) < 1e-4, "{}", tree.murray_residual(3.0));
    let statistics = tree.statistics();
    let angle = statistics.bifurcation_angle.expect("bifurcations");
    assert!((angle.mean - 75.0).abs() < 0.1 && angle.standard_deviation < 0.1, "{angle:?}");
    for (node, depth) in tree.depths().into_iter().enumerate().skip(1) {
        let expected = 0.15 * binary.turtle.diameter_ratio.powi(depth as i32 - 1);
        assert!((tree.radii()[node] / expected - 1.0).abs() < 1e-5);
    }
}

/// With the four-sided cages of the paper, at the three levels of its figures.
#[test]
fn surfaces_of_presets_are_closed_and_cross_nothing() {
    for preset in PRESETS {
        let tree = preset.tree(preset.generations).expect("a tree");
        for level in 0..3 {
            let settings = SurfaceSettings { level, most_sides: 4, least_sides: 4, ..SurfaceSettings::default() };
            let surface = Surface::new(&tree, &settings).expect("a surface");
            let (closure, name) = (surface.mesh.closure(), preset.name);
            assert!(closure.is_closed() && closure.is_oriented() && closure.is_manifold(), "{name}: {closure:?}");
            assert_eq!((closure.euler(), closure.degenerate_faces), (2, 0), "{name} at level {level}");
            assert!(surface.report.absorbed.is_empty(), "{name}: {:?}", surface.report);
            let triangles: Vec<[u32; 3]> = surface.mesh.closed_triangles().collect();
            let crossings = self_intersections(&surface.mesh.positions, &triangles);
            println!(
                "{name} {level}: {} nodes, {} triangles, {} crossings",
                tree.len(),
                triangles.len(),
                crossings.len()
            );
        }
    }
}
