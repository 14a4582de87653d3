//! What is wrong with an input is said, with the value and the remedy; and what comes out is the same everywhere.

use crate::meshes::{baked, cube, linear, plain, square, vessel};
use bevy_math::{Vec2, Vec3};
use bevy_vessels::synthesis::{
    mesh::{ShadedMesh, TriangleMesh},
    organ::KidneySettings,
    pace::{Pace, at_once},
    texture::{
        Bake, BakeError, BakeSettings, BakeWarning, BaseImage, Canvas, CanvasAttributes, Layer, MapKind, Maps,
        VertexColors, VesselLook,
    },
    tree::{VesselKind, VesselTree},
};

fn with_uvs(change: impl Fn(Vec2) -> Vec2) -> Result<Canvas, BakeError> {
    let mesh = square(4);
    let uvs = mesh.uvs().expect("texture coordinates").iter().map(|uv| change(*uv)).collect();
    Canvas::new(mesh, CanvasAttributes { uvs, ..CanvasAttributes::default() })
}

#[test]
fn useless_texture_coordinates_are_refused_with_a_reason() {
    let plain = square(4);
    let without = TriangleMesh::new(plain.positions().to_vec(), plain.triangles().to_vec(), None).expect("a mesh");
    assert_eq!(Canvas::of_mesh(&without).err(), Some(BakeError::NoUvs));
    assert!(matches!(with_uvs(|_| Vec2::ZERO), Err(BakeError::UselessUvs { .. })));
    assert!(matches!(with_uvs(|uv| uv * f32::NAN), Err(BakeError::BadUv { vertex: 0, .. })));
    assert!(matches!(with_uvs(|uv| uv * 1.0e9), Err(BakeError::BadUv { .. })));
    assert!(matches!(with_uvs(|uv| uv * 12.0), Err(BakeError::TiledUvs { .. })));
    assert!(with_uvs(|uv| uv + 3.0).is_ok(), "wrapped");
    let bad = CanvasAttributes { uvs: vec![Vec2::ZERO; 3], ..CanvasAttributes::default() };
    let error = Canvas::new(square(4), bad).expect_err("an error");
    assert_eq!(error.to_string(), "the mesh has 3 texture coordinates for 25 vertices; give one per vertex, or none");
}

#[test]
fn settings_out_of_their_limits_are_named() {
    let error = BakeSettings { size: 1000, ..BakeSettings::default() }.validate().expect_err("an error");
    assert_eq!(error.to_string(), "a texture cannot be 1000 texels wide; set a power of two from 16 to 8192");
    let none = BakeSettings { maps: Maps::NONE, ..BakeSettings::default() };
    assert_eq!(none.validate(), Err(BakeError::NoMaps));
    for kind in VesselKind::ALL {
        assert_eq!(VesselLook::of(kind).validate(), Ok(()));
    }
    for look in [
        VesselLook { strength: f32::NAN, ..VesselLook::default() },
        VesselLook { blur: -1.0, ..VesselLook::default() },
        VesselLook { max_depth: f32::INFINITY, ..VesselLook::default() },
        VesselLook { thin_color: [0.0, 2.0, 0.0], ..VesselLook::default() },
    ] {
        assert!(matches!(look.validate(), Err(BakeError::Setting { .. })), "{look:?}");
    }
    assert!(BaseImage::new(2, 2, vec![0; 15]).is_err() && BaseImage::new(2, 2, vec![0; 16]).is_ok());
}

#[test]
fn thin_and_overlapping_charts_are_warned_of() {
    let canvas = with_uvs(|uv| uv * Vec2::new(0.02, 1.0)).expect("a canvas");
    let tree = vessel(&[Vec3::new(0.2, 0.5, 0.0), Vec3::new(0.8, 0.5, 0.0)], 0.1);
    let bake = baked(&canvas, &[&tree], &plain(), 256, &[MapKind::Albedo]);
    let thin = bake.report.warnings.iter().find_map(|warning| match warning {
        BakeWarning::ThinCharts { charts, thinnest, suffices } => Some((*charts, *thinnest, *suffices)),
        _ => None,
    });
    let (charts, thinnest, suffices) = thin.expect("a warning");
    assert!(charts == 1 && (thinnest - 5.12).abs() < 0.2 && suffices == Some(512), "{thinnest} {suffices:?}");
    let enough = baked(&canvas, &[&tree], &plain(), 512, &[MapKind::Albedo]);
    assert!(!enough.report.warnings.iter().any(|warning| matches!(warning, BakeWarning::ThinCharts { .. })));
    // All sides of the box on one place.
    let mesh = cube();
    let uvs = mesh.uvs().expect("texture coordinates").iter().map(|uv| uv.fract_gl() * Vec2::new(1.0, 1.0));
    let stacked: Vec<Vec2> = uvs.map(|uv| Vec2::new(uv.x % (1.0 / 3.0), uv.y % 0.5)).collect();
    let canvas = Canvas::new(mesh, CanvasAttributes { uvs: stacked, ..CanvasAttributes::default() }).expect("a canvas");
    let bake = baked(&canvas, &[&tree], &plain(), 128, &[MapKind::Albedo]);
    assert!(bake.report.warnings.iter().any(|warning| matches!(warning, BakeWarning::Overlaps { .. })));
}

#[test]
fn colours_per_vertex_are_part_of_the_base() {
    let mesh = square(8);
    let color = |at: &Vec3| Vec3::new(0.25 + 0.5 * at.x, 0.4, 0.9 - 0.6 * at.y);
    let uvs = mesh.uvs().expect("texture coordinates").to_vec();
    let tree = vessel(&[Vec3::new(0.2, 0.5, 0.0), Vec3::new(0.8, 0.5, 0.0)], 0.1);
    // Dark enough that a renderer's product reaches it everywhere.
    let look = VesselLook { strength: 0.7, thin_color: [0.1, 0.05, 0.2], wide_color: [0.1, 0.05, 0.2], ..plain() };
    let settings = BakeSettings { size: 64, base_color: [0.8, 0.6, 0.5], ..BakeSettings::default() };
    let albedo = |are_drawn: Option<bool>| {
        let colors = mesh.positions().iter().map(color).collect::<Vec<_>>();
        let colors = are_drawn.map(|are_drawn| VertexColors { colors, are_drawn });
        let attributes = CanvasAttributes { uvs: uvs.clone(), colors, ..CanvasAttributes::default() };
        let canvas = Canvas::new(mesh.clone(), attributes).expect("a canvas");
        let layers = [Layer { tree: &tree, look: look.clone() }];
        Bake::new(&canvas, &layers, None, &settings).expect("a bake").maps.swap_remove(0).levels.swap_remove(0)
    };
    let [without, baked, drawn] = [None, Some(false), Some(true)].map(albedo);
    let mut covered = 0;
    for texel in 0..64 * 64 {
        let at = Vec3::new((texel % 64) as f32 + 0.5, 63.5 - (texel / 64) as f32, 0.0) / 64.0;
        for (channel, tint) in color(&at).to_array().into_iter().enumerate() {
            let byte = 4 * texel + channel;
            let [plain, in_map, by_renderer] = [&without, &baked, &drawn].map(|map| linear(map[byte]));
            let (base, vessel) = (settings.base_color[channel], look.thin_color[channel]);
            let alpha = (base - plain) / (base - vessel);
            let exact = base * tint * (1.0 - alpha) + vessel * alpha;
            // Two bytes at most, in linear light.
            let off = 0.02 * (1.0 + 1.0 / tint);
            assert!((in_map - exact).abs() < off, "{in_map} for {exact}");
            assert!((by_renderer * tint - exact).abs() < off, "{by_renderer} times {tint} for {exact}");
            covered += usize::from(alpha > 0.5);
        }
    }
    assert!(covered > 500);
    let bad = VertexColors { colors: vec![Vec3::NEG_ONE; uvs.len()], are_drawn: true };
    let attributes = CanvasAttributes { uvs, colors: Some(bad), ..CanvasAttributes::default() };
    assert_eq!(Canvas::new(mesh, attributes).err(), Some(BakeError::BadAttribute { what: "colour", vertex: 0 }));
}

#[test]
fn a_shaded_mesh_without_colours_is_white() {
    let mut mesh = KidneySettings { triangles: 2_000, ..KidneySettings::default() }.generate().expect("a kidney").mesh;
    let tree = vessel(&[Vec3::new(-0.02, 0.0, 0.02), Vec3::new(0.02, 0.0, 0.02)], 0.004);
    let painted = |mesh: &ShadedMesh| {
        baked(&Canvas::of_shaded(mesh).expect("a canvas"), &[&tree], &plain(), 64, &[MapKind::Albedo])
    };
    mesh.colors.fill([1.0; 4]);
    let white = painted(&mesh);
    mesh.colors.clear();
    assert!(painted(&mesh) == white && white.maps[0].levels[0].contains(&0));
    mesh.colors = vec![[1.0; 4]; 3];
    assert!(matches!(Canvas::of_shaded(&mesh), Err(BakeError::AttributeCount { what: "colours", count: 3, .. })));
}

#[test]
fn nothing_to_paint_leaves_the_base() {
    let canvas = Canvas::of_mesh(&square(1)).expect("a canvas");
    let bake = baked(&canvas, &[], &plain(), 16, &MapKind::ALL);
    let first = |kind: MapKind| bake.map(kind).expect("a map").levels[0].clone();
    assert!(first(MapKind::Albedo).iter().all(|byte| *byte == 255));
    assert!(first(MapKind::Normal).chunks(4).all(|texel| *texel == [128, 128, 255, 255]));
    assert!(first(MapKind::Id).iter().all(|byte| *byte == 0));
    assert!(first(MapKind::Depth).iter().all(|byte| *byte == 255));
    assert!(baked(&canvas, &[&VesselTree::new()], &plain(), 16, &[MapKind::Albedo]).report.texels == 256);
    // The base image shows through at its own size, byte for byte.
    let picture: Vec<u8> = (0..16 * 16 * 4u32).map(|k| if k % 4 == 3 { 255 } else { (k * 37 % 251) as u8 }).collect();
    let base = BaseImage::new(16, 16, picture.clone()).expect("a picture");
    let settings = BakeSettings { size: 16, ..BakeSettings::default() };
    let bake = Bake::new(&canvas, &[], Some(&base), &settings).expect("a bake");
    assert_eq!(bake.map(MapKind::Albedo).expect("albedo").levels[0], picture);
}

#[test]
fn pauses_and_threads_change_nothing() {
    let canvas = Canvas::of_mesh(&cube()).expect("a canvas");
    let points: Vec<Vec3> = (0..40)
        .map(|k| {
            let turn = k as f32 * 0.5;
            let way = Vec3::new(turn.cos(), turn.sin(), (0.3 * turn).sin()).normalize();
            way * (0.5 / way.abs().max_element())
        })
        .collect();
    let tree = vessel(&points, 0.03);
    let settings = BakeSettings { size: 256, maps: MapKind::ALL.into_iter().collect(), ..BakeSettings::default() };
    let layers = [Layer { tree: &tree, look: VesselLook::of(VesselKind::Vein) }];
    let bake = || Bake::new(&canvas, &layers, None, &settings).expect("a bake");
    let one = bake();
    let pace = Pace::new(|| true);
    let paused = at_once(Bake::new_paced(&canvas, &layers, None, &settings, &pace)).expect("a bake");
    assert!(one == paused && pace.progress() == 1.0);
    #[cfg(feature = "parallel")]
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        assert!(pool.install(bake) == one, "{threads} threads");
    }
}
