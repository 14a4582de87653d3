//! The same organ in any unit grows the same vessels.

#[path = "common/torus.rs"]
mod torus;

use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    mesh::TriangleMesh,
    roots::Roots,
    tissue::{MeshTissue, TissueMode},
};

/// An organ of unit size, scaled by a factor.
fn grown(mesh: &TriangleMesh, factor: f32, mode: TissueMode, seed: u64) -> Colonization {
    let positions = mesh.positions().iter().map(|&position| position * factor).collect();
    let mesh = TriangleMesh::new(positions, mesh.triangles().to_vec(), None).expect("a mesh");
    let tissue = MeshTissue { mode, resolution: 48 }.prepare(mesh).expect("a tissue").tissue().clone();
    let settings = ColonizationSettings::default().fit(tissue.extent());
    let mut growth = Colonization::new(tissue, settings, &Roots::default(), seed).expect("a growth");
    growth.run();
    growth
}

/// 0.2 m, the same in millimetres, and sizes between them.
#[test]
fn metres_millimetres_and_units_grow_the_same_vessels() {
    let mesh = torus::torus();
    for mode in [TissueMode::Surface, TissueMode::Volume] {
        for seed in 0..2 {
            let toy = grown(&mesh, 1.0, mode, seed);
            for (factor, exact) in [(1.0 / 1024.0, true), (1024.0, true), (0.2, false), (200.0, false)] {
                let organ = grown(&mesh, factor, mode, seed);
                for kind in Colonization::KINDS {
                    let (a, b) = (toy.tree(kind), organ.tree(kind));
                    let case = format!("{mode:?}, seed {seed}, {}, times {factor}", kind.name());
                    if exact {
                        // Powers of two have the toy's rounding, so nothing may differ.
                        assert_eq!(a.parents(), b.parents(), "{case}");
                    }
                    // Others differ by rounding, which changes the paths of single vessels.
                    let ratio = b.len() as f32 / a.len() as f32;
                    assert!((ratio - 1.0).abs() < 0.08, "{case}: {} nodes, {} in the toy", b.len(), a.len());
                }
            }
        }
    }
}
