//! Sources of tissues, and paint on them.

use super::{Outcome, ball_soup, grid, rng, samples};
use bevy_math::{UVec3, Vec3};
use bevy_vessels::synthesis::{
    mesh::{TriangleMesh, VoxelError},
    tissue::*,
};
use std::sync::Arc;

fn source(mode: TissueMode) -> MeshTissue {
    MeshTissue { mode, resolution: 24 }
}

fn painted(mode: TissueMode, mesh: &TriangleMesh, paint: &TissuePaint) -> Result<Arc<dyn Tissue>, TissueError> {
    source(mode).prepare(mesh.clone())?.painted(paint)
}

#[test]
fn meshes_become_what_their_mode_says() -> Outcome {
    let ball = ball_soup(24, false)?;
    let (area, volume) = (ball.area() as f32, ball.signed_volume() as f32);
    let surface = source(TissueMode::Surface).prepare(ball.clone())?;
    assert!(matches!(surface.tissue().extent(), Extent::Area(found) if (found / area - 1.0).abs() < 1e-4));
    let solid = source(TissueMode::Volume).prepare(ball.clone())?;
    assert!(matches!(solid.tissue().extent(), Extent::Volume(found) if (found / volume - 1.0).abs() < 0.02));
    let guide = Guide { points: vec![Vec3::X, Vec3::Y], deviation: 0.05, steps: 4 };
    let paint = TissuePaint { guides: vec![guide], ..TissuePaint::default() };
    let tissue = painted(TissueMode::Staged { surface_steps: 10 }, &ball, &paint)?;
    assert!(matches!(tissue.at_step(4).extent(), Extent::Length(_)));
    assert!(matches!(tissue.at_step(5).extent(), Extent::Area(_)));
    assert!(matches!(tissue.at_step(14).extent(), Extent::Area(_)));
    assert!(matches!(tissue.at_step(15).extent(), Extent::Volume(_)));
    assert!(matches!(tissue.extent(), Extent::Volume(_)));

    // Nothing below the equator.
    let upper: Vec<f32> = ball.positions().iter().map(|p| if p.z > 0.0 { 1.0 } else { -1.0 }).collect();
    let paint = TissuePaint { density: Some(upper), ..TissuePaint::default() };
    for mode in [TissueMode::Surface, TissueMode::Volume, TissueMode::Staged { surface_steps: 1 }] {
        let tissue = painted(mode, &ball, &paint)?;
        for step in [1, 2] {
            let points = samples(tissue.at_step(step), 2000, 3);
            assert!(points.len() > 700 && points.len() < 1300, "{} of 2000 kept", points.len());
            assert!(points.iter().all(|point| point.z > -0.15));
        }
    }
    Ok(())
}

#[test]
fn paint_gives_what_its_fields_give_bit_for_bit() -> Outcome {
    let ball = ball_soup(16, false)?;
    let density: Vec<f32> = ball.positions().iter().map(|p| 0.5 + 0.5 * p.x).collect();
    let field = DensityField::on_vertices(&ball, &density)?;
    let paint = TissuePaint { density: Some(density), ..TissuePaint::default() };
    for mode in [TissueMode::Surface, TissueMode::Volume] {
        let bare: Arc<dyn Tissue> = match mode {
            TissueMode::Surface => Arc::new(MeshSurface::new(ball.clone())?),
            _ => Arc::new(MeshVolume::new(&ball, 24)?),
        };
        let by_hand = DensityTissue::new(bare, field.clone())?;
        let by_paint = painted(mode, &ball, &paint)?;
        let (mut one, mut other) = (Vec::new(), Vec::new());
        by_hand.draw(&mut rng(5), 4000, &mut one);
        by_paint.draw(&mut rng(5), 4000, &mut other);
        assert!(one.len() > 1000 && one == other, "{mode:?}");
    }
    Ok(())
}

#[test]
fn what_is_not_painted_is_the_prepared_tissue_itself() -> Outcome {
    let prepared = source(TissueMode::Staged { surface_steps: 5 }).prepare(ball_soup(8, false)?)?;
    let blank = TissuePaint { no_go: NoGo { vertices: Some(vec![false; 3]), ..NoGo::default() }, ..Default::default() };
    assert!(Arc::ptr_eq(&prepared.painted(&TissuePaint::default())?, prepared.tissue()));
    assert!(Arc::ptr_eq(&prepared.painted(&blank)?, prepared.tissue()));
    assert!(prepared.tissue().at_step(1).no_go().is_none() && prepared.tissue().no_go().is_none());
    Ok(())
}

#[test]
fn shapes_need_no_mesh() -> Outcome {
    let nothing = SourceData::default();
    let diagonal = TissueShape::Rectangle { center: Vec3::ONE, half_x: Vec3::X, half_y: Vec3::Y * 0.5 };
    let ellipsoid = TissueShape::Ellipsoid { center: Vec3::ZERO, half_axes: Vec3::new(1.0, 2.0, 3.0) };
    for (shape, extent) in [
        (TissueShape::disc(2.0), Disc::flat(2.0)?.extent()),
        (TissueShape::ball(0.5), Ball::new(Vec3::ZERO, 0.5)?.extent()),
        (TissueShape::cuboid(Vec3::ONE), Extent::Volume(1.0)),
        (diagonal, Extent::Area(2.0)),
        (ellipsoid, Ellipsoid::new(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0))?.extent()),
    ] {
        assert_eq!(TissueSource::from(shape).prepare(&nothing)?.tissue().extent(), extent);
    }
    assert!(matches!(TissueShape::disc(-1.0).build().err(), Some(TissueError::NotPositive { .. })));
    assert_eq!(TissueSource::default().prepare(&nothing).err(), Some(TissueError::NoMesh));
    let image = TissueSource::from(ImageTissue::default());
    assert_eq!(image.prepare(&nothing).err(), Some(TissueError::NoImage));
    Ok(())
}

#[test]
fn images_stand_upright_and_volumes_from_their_lowest_corner() -> Outcome {
    let of = |settings: ImageTissue, image: &TissueImage| -> Result<Arc<dyn Tissue>, TissueError> {
        let data = SourceData { image: Some(Arc::new(image.clone())), ..SourceData::default() };
        Ok(Arc::clone(TissueSource::from(settings).prepare(&data)?.tissue()))
    };
    // Two columns, three rows; only the left of the top row is white.
    let picture = TissueImage { size: UVec3::new(2, 3, 1), values: vec![1.0, 0.0, 0.4, 0.0, f32::NAN, 0.0] };
    let top = of(ImageTissue { spacing: Vec3::new(1.0, 2.0, 9.0), ..ImageTissue::default() }, &picture)?;
    assert_eq!(top.extent(), Extent::Area(2.0));
    assert!(top.contains(Vec3::new(0.5, 5.0, 0.0)) && !top.contains(Vec3::new(0.5, 1.0, 0.0)));
    let lower = ImageTissue { threshold: 0.3, ..ImageTissue::default() };
    assert_eq!(of(lower.clone(), &picture)?.extent(), Extent::Area(2.0));
    // NaN is not part of the inverted tissue.
    let rest = of(ImageTissue { inverted: true, ..lower }, &picture)?;
    assert_eq!(rest.extent(), Extent::Area(3.0));
    let volume = TissueImage { size: UVec3::new(1, 1, 2), values: vec![1.0, 0.0] };
    let bottom = of(ImageTissue { origin: Vec3::Z, ..ImageTissue::default() }, &volume)?;
    assert_eq!(bottom.extent(), Extent::Volume(1.0));
    assert!(bottom.contains(Vec3::new(0.5, 0.5, 1.5)) && !bottom.contains(Vec3::new(0.5, 0.5, 2.5)));

    let short = TissueImage { size: UVec3::new(4, 4, 1), values: vec![1.0; 5] };
    assert!(matches!(of(ImageTissue::default(), &short).err(), Some(TissueError::MaskSize { cells: 5, .. })));
    let dark = TissueImage { size: UVec3::ONE, values: vec![0.1] };
    assert_eq!(of(ImageTissue::default(), &dark).err(), Some(TissueError::EmptyMask));
    let vague = ImageTissue { threshold: f32::NAN, ..ImageTissue::default() };
    assert!(matches!(of(vague, &picture).err(), Some(TissueError::NotFinite { .. })));
    let grey = ImageChannel::Grey.of([0.3, 0.6, 0.9, 1.0]);
    assert!((grey - 0.6).abs() < 1e-6 && ImageChannel::Blue.of([0.3, 0.6, 0.9, 1.0]) == 0.9);
    Ok(())
}

#[test]
fn impossible_sources_and_paint_are_refused() -> Outcome {
    let ball = ball_soup(6, false)?;
    let staged = TissueMode::Staged { surface_steps: 3 };
    let with = |change: fn(&mut TissuePaint)| {
        let mut paint = TissuePaint::default();
        change(&mut paint);
        painted(staged, &ball, &paint).err()
    };
    assert_eq!(with(|_| ()), None);
    let coarse = MeshTissue { mode: staged, resolution: 0 };
    assert_eq!(coarse.prepare(ball.clone()).err(), Some(TissueError::Voxels(VoxelError::NoResolution)));
    assert!(matches!(with(|paint| paint.density = Some(vec![])), Some(TissueError::DensityCount { .. })));
    assert!(matches!(with(|paint| paint.guides.push(Guide::default())), Some(TissueError::GuidePoints { .. })));
    let marks = with(|paint| paint.no_go.vertices = Some(vec![true]));
    assert!(matches!(marks, Some(TissueError::NoGoCount { values: 1, .. })), "{marks:?}");
    let region = |region: NoGoRegion| {
        let no_go = NoGo { regions: vec![region], ..NoGo::default() };
        painted(staged, &ball, &TissuePaint { no_go, ..TissuePaint::default() }).err()
    };
    assert!(matches!(
        region(NoGoRegion::Ball { center: Vec3::ZERO, radius: 0.0 }),
        Some(TissueError::NotPositive { .. })
    ));
    assert!(matches!(region(NoGoRegion::Ball { center: Vec3::NAN, radius: 1.0 }), Some(TissueError::NotFinite { .. })));
    let flat = NoGoRegion::Cuboid { center: Vec3::ZERO, size: Vec3::new(1.0, 1.0, -1.0) };
    assert!(matches!(region(flat), Some(TissueError::NotPositive { .. })));
    let sheet = grid(3, 1.0)?;
    let inside = source(TissueMode::Volume).prepare(sheet.clone()).err();
    assert_eq!(inside, Some(TissueError::NoInside { resolution: 24 }));
    assert!(source(TissueMode::Surface).prepare(sheet).is_ok());
    let disc = PreparedTissue::new(TissueShape::disc(1.0).build()?)?;
    let density = TissuePaint { density: Some(vec![1.0]), ..TissuePaint::default() };
    assert_eq!(disc.painted(&density).err(), Some(TissueError::NoVertices { what: "the density" }));
    let staged = Staged::new(vec![], TissueShape::disc(1.0).build()?)?;
    let nowhere = NoGoField::function(|_| false);
    assert_eq!(PreparedTissue::new(Arc::new(staged.clone())).err(), Some(TissueError::PaintOverStages));
    assert_eq!(NoGoTissue::new(Arc::new(staged), nowhere).err(), Some(TissueError::NoGoOverStages));
    Ok(())
}

#[cfg(feature = "serialize")]
#[test]
fn sources_and_paint_are_written_and_read_as_ron() -> Outcome {
    let paint = TissuePaint {
        density: Some(vec![0.5]),
        no_go: NoGo { vertices: Some(vec![true]), regions: vec![NoGoRegion::Ball { center: Vec3::X, radius: 0.1 }] },
        guides: vec![Guide { points: vec![Vec3::X, Vec3::Y], deviation: 0.1, steps: 7 }],
    };
    assert_eq!(ron::from_str::<TissuePaint>(&ron::to_string(&paint)?)?, paint);
    assert_eq!(ron::from_str::<TissuePaint>("()")?, TissuePaint::default());
    for source in [
        TissueSource::from(source(TissueMode::Staged { surface_steps: 9 })),
        TissueShape::ball(2.0).into(),
        ImageTissue { channel: ImageChannel::Alpha, ..ImageTissue::default() }.into(),
    ] {
        assert_eq!(ron::from_str::<TissueSource>(&ron::to_string(&source)?)?, source);
    }
    assert_eq!(ron::from_str::<TissueSource>("Mesh(())")?, TissueSource::default());
    assert_eq!(ron::from_str::<TissueSource>("Shape(Disc(radius: 3.0))")?, TissueShape::disc(3.0).into());
    let volume: TissueSource = ron::from_str("Mesh((mode: Volume))")?;
    assert_eq!((volume.mode(), volume.needs_mesh()), (Some(TissueMode::Volume), true));
    assert!(ron::from_str::<TissueSource>("Mesh((mood: Volume))").is_err());
    Ok(())
}
