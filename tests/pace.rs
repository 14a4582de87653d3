//! Work with rests: equal results with any pauses, progress that rises to its end, and no long stretch without a rest.

#[path = "common/solid_box.rs"]
mod solid_box;

use bevy_math::{UVec2, UVec3, Vec2, Vec3};
use bevy_vessels::synthesis::{
    binding::Binding,
    haemodynamics::{BedSettings, Circulation, FlowSettings, Network, Supply, TissueSupply},
    mesh::{IndexedMesh, TriangleIndex, TriangleMesh},
    pace::Pace,
    random::Stream,
    segment_index::SegmentIndex,
    tissue::*,
    tree::{BedLink, NO_PARENT, NodeId, VesselTree},
    units::Resistance,
};
use cpu_time::ThreadTime;
use solid_box::solid_box;
use std::{
    f32::consts::{PI, TAU},
    fmt::{self, Debug, Write},
    pin::pin,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll, Waker},
    time::Duration,
};

/// Items of a stretch, if they are light.
const STRETCH: usize = 1024;

/// A ball of radius 1 with a seam, of 4 · `rings`² triangles.
fn ball(rings: u32) -> Arc<TriangleMesh> {
    let sectors = 2 * rings;
    let point = |ring: u32, sector: u32| {
        let (down, around) = (PI * ring as f32 / rings as f32, TAU * sector as f32 / sectors as f32);
        Vec3::new(down.sin() * around.cos(), down.sin() * around.sin(), down.cos())
    };
    let positions = (0..=rings).flat_map(|ring| (0..=sectors).map(move |sector| point(ring, sector))).collect();
    let corner = |ring: u32, sector: u32| ring * (sectors + 1) + sector;
    let quads = (0..rings).flat_map(|ring| (0..sectors).map(move |sector| (ring, sector)));
    let triangles = quads.flat_map(|(ring, sector)| {
        let [a, b] = [corner(ring, sector), corner(ring + 1, sector)];
        [[a, b, b + 1], [a, b + 1, a + 1]]
    });
    Arc::new(TriangleMesh::new(positions, triangles.collect(), None).expect("a ball"))
}

/// A tree in the ball, each node near its parent.
fn tree(nodes: usize, seed: usize) -> VesselTree {
    let number = |node: usize, salt: usize| ((node * 7919 + salt * 104_729 + seed * 31) % 10_007) as f32 / 10_007.0;
    let (mut positions, mut parents) = (vec![Vec3::X * 0.5], vec![NO_PARENT]);
    for node in 1..nodes {
        let parent = node - 1 - (number(node, 1) * node.min(40) as f32 * 0.99) as usize;
        let step = Vec3::new(number(node, 2), number(node, 3), number(node, 4)) - 0.5;
        positions.push((positions[parent] + 0.1 * step).clamp_length_max(0.9));
        parents.push(parent as u32);
    }
    let radii = (0..nodes).map(|node| 0.001 + 0.01 / (1.0 + node as f32)).collect();
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

fn settings() -> FlowSettings {
    let bed = BedSettings { resistance: Some(Resistance::from_mmhg_min_per_ml(5.0)), ..FlowSettings::default().bed };
    FlowSettings { bed, ..FlowSettings::default() }
}

fn circulation(nodes: usize) -> (Network, Network, Vec<BedLink>) {
    let [arteries, veins] = [1, 2].map(|seed| tree(nodes, seed));
    let tips = arteries.tips().into_iter().zip(veins.tips());
    let links = tips.map(|(arterial, venous)| BedLink { arterial: NodeId(arterial), venous: NodeId(venous) }).collect();
    let network = |tree: &VesselTree| Network::new(tree, settings()).expect("a network");
    (network(&arteries), network(&veins), links)
}

/// A hash of the `Debug` output, which has all fields, with numbers to the last bit.
#[derive(Debug)]
struct Shown(u64);

impl Write for Shown {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0 = text.bytes().fold(self.0, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
        Ok(())
    }
}

fn shown(value: &dyn Debug) -> u64 {
    let mut shown = Shown(0xcbf2_9ce4_8422_2325);
    write!(shown, "{value:?}").expect("hashing doesn't fail");
    shown.0
}

/// A tissue, hashed also by its behaviour, since `Debug` of paint fields doesn't show all their data.
fn deeds(tissue: Result<Arc<dyn Tissue>, TissueError>) -> u64 {
    let tissue = tissue.expect("a tissue");
    let mut rng = Stream::Attraction.rng(5);
    let points: Vec<_> = (0..500).map(|_| tissue.sample(&mut rng)).collect();
    let near: Vec<_> = points.iter().flatten().map(|&point| tissue.closest_point(1.1 * point).position).collect();
    let forbidden: Vec<_> = near.iter().map(|&point| tissue.no_go().map(|field| field.forbids(point))).collect();
    shown(&(&tissue, points, near, forbidden))
}

/// The record of work that was polled until it was done.
struct Walk {
    /// Shows the result.
    shown: Box<dyn FnOnce() -> u64>,
    /// Pauses.
    pauses: usize,
    /// The longest CPU time of this thread between two pauses, and the total.
    longest: Duration,
    total: Duration,
}

/// Polls work to its end, and checks its progress.
fn walk<T: Debug + 'static>(name: &str, pace: &Pace, work: impl Future<Output = T>) -> Walk {
    walk_to(name, pace, work, |result| shown(&result))
}

fn walk_to<T: 'static>(name: &str, pace: &Pace, work: impl Future<Output = T>, show: fn(T) -> u64) -> Walk {
    let mut work = pin!(work);
    let (mut pauses, mut longest, mut total) = (0, Duration::ZERO, Duration::ZERO);
    let mut last = 0.0;
    loop {
        let start = ThreadTime::now();
        let polled = work.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        let time = start.elapsed();
        longest = longest.max(time);
        total += time;
        let progress = pace.progress();
        assert!((last..=1.0).contains(&progress), "{name}: {progress} after {last}");
        last = progress;
        let Poll::Ready(result) = polled else {
            pauses += 1;
            continue;
        };
        assert_eq!(progress, 1.0, "{name}: progress at its end");
        return Walk { shown: Box::new(move || show(result)), pauses, longest, total };
    }
}

/// A builder of something.
struct Case {
    name: &'static str,
    /// The least number of light items that it processes.
    items: usize,
    /// Its result without rests.
    unpaced: Box<dyn Fn() -> u64>,
    paced: Box<dyn Fn(&Pace) -> Walk>,
}

/// A case, from both forms of a builder.
macro_rules! case {
    ($name:literal, $items:expr, [$($held:ident),*], $unpaced:expr, |$pace:ident| $paced:expr) => {{
        let unpaced = { $(let $held = $held.clone();)* move || shown(&$unpaced) };
        let paced = {
            $(let $held = $held.clone();)*
            move |$pace: &Pace| { $(let $held = $held.clone();)* walk($name, $pace, async move { $paced }) }
        };
        Case { name: $name, items: $items, unpaced: Box::new(unpaced), paced: Box::new(paced) }
    }};
}

/// Every builder that rests: of meshes.
fn meshes(rings: u32) -> Vec<Case> {
    let mesh = ball(rings);
    let count = mesh.triangles().len();
    let (positions, triangles) = (mesh.positions().to_vec(), mesh.triangles().to_vec());
    vec![
        case!(
            "TriangleMesh",
            count,
            [positions, triangles],
            TriangleMesh::new(positions.clone(), triangles.clone(), None),
            |pace| TriangleMesh::new_paced(positions, triangles, None, pace).await
        ),
        case!("TriangleIndex", 4 * count, [mesh], TriangleIndex::new(&mesh), |pace| {
            TriangleIndex::new_paced(&mesh, pace).await
        }),
        case!("IndexedMesh", 4 * count, [mesh], IndexedMesh::new(mesh.clone()), |pace| {
            IndexedMesh::new_paced(mesh.clone(), pace).await
        }),
        case!("topology", 2 * count, [mesh], mesh.topology(), |pace| mesh.topology_paced(pace).await),
    ]
}

/// Of tissues.
fn tissues(rings: u32) -> Vec<Case> {
    let mesh = ball(rings);
    let count = mesh.triangles().len();
    let inward = Arc::new(TriangleMesh::clone(&mesh).with_flipped(|_| true));
    let (flat, deep) = (UVec2::splat(4 * rings), UVec3::splat(rings / 2));
    let set = |count: u32| -> Vec<bool> { (0..count).map(|cell| cell % 7 > 2).collect() };
    let (pixels, voxels) = (set(flat.element_product()), set(deep.element_product()));
    let values = (0..flat.element_product()).map(|cell| (cell % 97) as f32 / 97.0).collect();
    let (image, picture) = (ImageTissue::default(), Arc::new(TissueImage { size: flat.extend(1), values }));
    let data = SourceData { mesh: Some(Arc::clone(&mesh)), image: Some(Arc::clone(&picture)) };
    let mut cases = vec![
        case!("MeshSurface", 8 * count, [mesh], MeshSurface::new(mesh.clone()), |pace| {
            MeshSurface::new_paced(mesh.clone(), pace).await
        }),
        case!("MeshSurface from inside", 8 * count, [inward], MeshSurface::new(inward.clone()), |pace| {
            MeshSurface::new_paced(inward.clone(), pace).await
        }),
        case!("MeshVolume", 16 * count, [mesh], MeshVolume::new(&mesh, 48), |pace| {
            MeshVolume::new_paced(&mesh, 48, pace).await
        }),
        case!("MeshVolume from inside", 16 * count, [inward], MeshVolume::new(&inward, 48), |pace| {
            MeshVolume::new_paced(&inward, 48, pace).await
        }),
        case!("Mask of an image", pixels.len(), [pixels], Mask::image(flat, Vec2::ONE, Vec3::ZERO, &pixels), |pace| {
            Mask::image_paced(flat, Vec2::ONE, Vec3::ZERO, &pixels, pace).await
        }),
        case!("Mask of voxels", voxels.len(), [voxels], Mask::voxels(deep, Vec3::ONE, Vec3::ZERO, &voxels), |pace| {
            Mask::voxels_paced(deep, Vec3::ONE, Vec3::ZERO, &voxels, pace).await
        }),
        case!("ImageTissue", 2 * picture.values.len(), [image, picture], image.mask(&picture), |pace| {
            image.mask_paced(&picture, pace).await
        }),
    ];
    for (name, items, source) in [
        ("a surface", 8 * count, TissueSource::from(TissueMode::Surface)),
        ("a volume", 16 * count, TissueMode::Volume.into()),
        ("stages", 16 * count, TissueMode::Staged { surface_steps: 9 }.into()),
        ("a shape", 0, TissueShape::ball(1.0).into()),
        ("an image", picture.values.len(), ImageTissue::default().into()),
    ] {
        let case = case!("TissueSource", items, [source, data], source.prepare(&data), |pace| {
            source.prepare_paced(&data, pace).await
        });
        cases.push(Case { name, ..case });
    }
    cases
}

/// Of paint.
fn paints(rings: u32) -> Vec<Case> {
    let mesh = ball(rings);
    let count = mesh.positions().len();
    let ball = NoGoRegion::Ball { center: Vec3::Y, radius: 0.3 };
    let line: Vec<Vec3> = (0..=rings).map(|i| Vec3::new(0.1, i as f32 / rings as f32 - 0.5, 1.0)).collect();
    let density: Vec<f32> = mesh.positions().iter().map(|point| point.z).collect();
    let vertices: Vec<bool> = mesh.positions().iter().map(|point| point.x > 0.8).collect();
    let blank = TissuePaint::default();
    let all = TissuePaint {
        density: Some(density.clone()),
        no_go: NoGo { vertices: Some(vertices.clone()), regions: vec![ball] },
        guides: vec![
            Guide { points: line.clone(), deviation: 0.05, steps: 5 },
            Guide { points: line.iter().map(|point| -*point).collect(), ..Guide::default() },
        ],
    };
    let guides = TissuePaint { guides: all.guides.clone(), ..TissuePaint::default() };
    let mut cases = Vec::new();
    for mode in [TissueMode::Surface, TissueMode::Volume, TissueMode::Staged { surface_steps: 9 }] {
        for (name, items, paint) in [("blank", 0, &blank), ("painted", 2 * count, &all), ("guided", STRETCH, &guides)] {
            let (mesh, paint) = (mesh.clone(), paint.clone());
            // Made again each time, since later paint reuses the index of the first.
            let prepare = move || MeshTissue { mode, resolution: 24 }.prepare(mesh.clone()).expect("a tissue");
            let unpaced = {
                let (prepare, paint) = (prepare.clone(), paint.clone());
                move || deeds(prepare().painted(&paint))
            };
            let paced = move |pace: &Pace| {
                let prepared = prepare();
                walk_to(name, pace, prepared.painted_paced(&paint, pace), deeds)
            };
            cases.push(Case { name, items, unpaced: Box::new(unpaced), paced: Box::new(paced) });
        }
    }
    let surface: Arc<dyn Tissue> = Arc::new(MeshSurface::new(mesh).expect("a surface"));
    let guide = GuidePath::new(line, 0.1).expect("a guide");
    cases.push(case!("GuidePath", STRETCH, [guide, surface], guide.clone().over(surface.clone()), |pace| {
        guide.over_paced(surface, pace).await
    }));
    cases
}

/// Of trees.
fn products(nodes: usize) -> Vec<Case> {
    let (mesh, solid, whole, vertices) = (ball(60), solid_box(16, 2.0), tree(nodes, 0), tree(nodes / 2, 3));
    let vertices = vertices.positions().to_vec();
    let (arteries, veins, links) = circulation(nodes);
    let joined = Circulation::new(arteries.clone(), veins.clone(), &links).expect("a circulation");
    let mut solved = arteries.clone();
    solved.solve().expect("flow that converges");
    let supply = Supply::against(&tree(nodes, 1), &solved);
    let (artery, unsolved) = (tree(nodes, 1), arteries.clone());
    vec![
        case!("Binding to a surface", 8 * nodes, [whole, mesh], Binding::to_surface(&whole, &mesh), |pace| {
            Binding::to_surface_paced(&whole, &mesh, pace).await
        }),
        case!("Binding to tetrahedra", 8 * nodes, [whole, solid], Binding::to_tetrahedra(&whole, &solid), |pace| {
            Binding::to_tetrahedra_paced(&whole, &solid, pace).await
        }),
        case!("SegmentIndex", 4 * nodes, [whole], SegmentIndex::new(&whole), |pace| {
            SegmentIndex::new_paced(&whole, pace).await
        }),
        case!("Network", nodes, [artery], Network::new(&artery, settings()), |pace| {
            Network::new_paced(&artery, settings(), pace).await
        }),
        case!(
            "Network solved",
            2 * nodes,
            [unsolved],
            {
                let mut network = unsolved.clone();
                (network.solve(), network)
            },
            |pace| {
                let mut network = unsolved;
                (network.solve_paced(pace).await, network)
            }
        ),
        case!(
            "Circulation",
            nodes,
            [arteries, veins, links],
            Circulation::new(arteries.clone(), veins.clone(), &links),
            |pace| Circulation::new_paced(arteries, veins, &links, pace).await
        ),
        case!(
            "Circulation solved",
            4 * nodes,
            [joined],
            {
                let mut joined = joined.clone();
                (joined.solve(), joined)
            },
            |pace| {
                let mut joined = joined;
                (joined.solve_paced(pace).await, joined)
            }
        ),
        case!("Supply", nodes, [artery, solved], Supply::against(&artery, &solved), |pace| {
            Supply::against_paced(&artery, &solved, pace).await
        }),
        case!(
            "Supply again",
            2 * nodes,
            [artery, solved, supply],
            {
                let mut supply = supply.clone();
                supply.update(&artery, &solved);
                supply
            },
            |pace| {
                let mut supply = supply;
                supply.update_paced(&artery, &solved, pace).await;
                supply
            }
        ),
        case!("TissueSupply", 8 * nodes, [artery, vertices], TissueSupply::new(&artery, &vertices), |pace| {
            TissueSupply::new_paced(&artery, &vertices, pace).await
        }),
    ]
}

fn cases(size: u32) -> impl Iterator<Item = Case> {
    let nodes = 200 * size as usize;
    [meshes(size), tissues(size), paints(size), products(nodes)].into_iter().flatten()
}

#[test]
fn the_same_comes_out_with_any_pauses() {
    for case in cases(24) {
        let expected = (case.unpaced)();
        let every = |rest: usize| {
            let rests = AtomicUsize::new(0);
            Pace::new(move || (rests.fetch_add(1, Ordering::Relaxed) + 1).is_multiple_of(rest))
        };
        for pace in [every(1), every(7), Pace::new(|| false)] {
            assert_eq!(((case.paced)(&pace).shown)(), expected, "{}", case.name);
        }
    }
}

#[test]
fn there_is_a_rest_for_every_stretch_of_items() {
    for case in cases(64) {
        let walk = (case.paced)(&Pace::new(|| true));
        assert!(walk.pauses * STRETCH >= case.items, "{}: {} pauses, {} items", case.name, walk.pauses, case.items);
    }
}

/// Each time is the least of several runs, to exclude other processes.
#[test]
fn no_stretch_is_a_large_part_of_the_work() {
    /// Time that any stretch may take, more than on a slow machine.
    const ROOM: Duration = Duration::from_millis(4);
    for case in cases(128) {
        let walks = [0; 3].map(|_| (case.paced)(&Pace::new(|| true)));
        let longest = walks.iter().map(|walk| walk.longest).min().unwrap_or_default();
        let total = walks.iter().map(|walk| walk.total).min().unwrap_or_default();
        println!("{:24} {:5} pauses, longest {longest:?} of {total:?}", case.name, walks[0].pauses);
        assert!(longest < ROOM + total / 20, "{}: {longest:?} of {total:?}", case.name);
    }
}
