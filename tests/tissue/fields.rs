//! Masks, guides, density fields and stages.

use super::{Outcome, assert_closest, assert_moments, ball_soup, grid, in_cube, rng, samples};
use bevy_math::{UVec2, UVec3, Vec2, Vec3};
use bevy_vessels::synthesis::tissue::*;
use std::sync::Arc;

#[test]
fn masks_are_sampled_evenly_and_answer_for_their_cells() -> Outcome {
    let full = Mask::image(UVec2::new(4, 3), Vec2::new(0.5, 1.0), Vec3::new(1.0, 2.0, 3.0), &[true; 12])?;
    assert_eq!(full.extent(), Extent::Area(6.0));
    assert_moments(&full, Vec3::new(2.0, 3.5, 3.0), Vec3::new(4.0, 9.0, 0.0) / 12.0);
    let mut cells = [false; 60];
    for cell in [0, 1, 4, 25, 26, 27, 59, 58, 40] {
        cells[cell] = true;
    }
    let image = Mask::image(UVec2::new(6, 10), Vec2::new(0.1, 0.2), Vec3::ZERO, &cells)?;
    let volume = Mask::voxels(UVec3::new(5, 4, 3), Vec3::new(0.2, 0.1, 0.3), Vec3::NEG_ONE, &cells)?;
    assert_closest(&image, 1);
    assert_closest(&volume, 2);
    for (mask, dimensions) in [(&image, [6usize, 10, 1]), (&volume, [5, 4, 3])] {
        let mut rng = rng(9);
        let bounds = mask.bounds();
        let (origin, spacing) = match mask.extent() {
            Extent::Area(_) => (Vec3::ZERO, Vec3::new(0.1, 0.2, 1.0)),
            _ => (Vec3::NEG_ONE, Vec3::new(0.2, 0.1, 0.3)),
        };
        for _ in 0..2000 {
            let mut point = Vec3::from(bounds.min).lerp(bounds.max.into(), 0.5) + in_cube(&mut rng, 1.0);
            if dimensions[2] == 1 {
                point.z = 0.0;
            }
            let local = ((point - origin) / spacing).floor().as_ivec3().to_array();
            let inside = (0..3).all(|axis| (0..dimensions[axis] as i32).contains(&local[axis]))
                && cells[((local[2] * dimensions[1] as i32 + local[1]) * dimensions[0] as i32 + local[0]) as usize];
            assert_eq!(mask.contains(point), inside, "{point}");
        }
    }
    let grey = [0, 100, 200, 255, 199, 0];
    let mask = Mask::image_from_grey(UVec2::new(3, 2), Vec2::ONE, Vec3::ZERO, &grey, 200)?;
    assert_eq!(mask.set_cells(), 2);
    assert_eq!(Mask::voxels_from_grey(UVec3::new(3, 2, 1), Vec3::ONE, Vec3::ZERO, &grey, 100)?.set_cells(), 4);
    Ok(())
}

#[test]
fn impossible_masks_are_refused() {
    let image = |size, spacing, cells: &[bool]| Mask::image(size, spacing, Vec3::ZERO, cells).err();
    assert_eq!(image(UVec2::new(2, 2), Vec2::ONE, &[false; 4]), Some(TissueError::EmptyMask));
    assert_eq!(image(UVec2::ZERO, Vec2::ONE, &[]), Some(TissueError::EmptyMask));
    assert!(matches!(image(UVec2::new(2, 2), Vec2::ONE, &[true; 5]), Some(TissueError::MaskSize { cells: 5, .. })));
    assert!(matches!(image(UVec2::MAX, Vec2::ONE, &[true; 5]), Some(TissueError::MaskSize { .. })));
    assert!(matches!(image(UVec2::ONE, Vec2::ZERO, &[true]), Some(TissueError::NotPositive { .. })));
    assert!(matches!(image(UVec2::ONE, Vec2::NAN, &[true]), Some(TissueError::NotFinite { .. })));
}

#[test]
fn guides_are_sampled_along_their_length() -> Outcome {
    let corner = vec![Vec3::ZERO, Vec3::X * 3.0, Vec3::X * 3.0, Vec3::new(3.0, 1.0, 0.0)];
    let line = GuidePath::new(corner.clone(), 0.0)?;
    assert_eq!(line.extent(), Extent::Length(4.0));
    assert_eq!(line.entrance(), Some(Vec3::ZERO));
    let points = samples(&line, 40_000, 1);
    let first = points.iter().filter(|point| point.y == 0.0).count() as f32 / points.len() as f32;
    assert!((first - 0.75).abs() < 0.01, "{first} of the points are on three quarters of the line");
    assert_closest(&line, 2);
    let tube = GuidePath::new(corner.clone(), 0.2)?;
    assert_closest(&tube, 3);
    assert!(samples(&tube, 1000, 4).iter().any(|point| point.z.abs() > 0.15));
    let straight = GuidePath::new(vec![Vec3::ZERO, Vec3::X], 0.3)?.with_end_deviation(0.0)?;
    let points = samples(&straight, 5000, 5);
    for (range, most) in [(0.0..0.3, 0.3), (0.7..1.0, 0.1)] {
        let widest = points.iter().filter(|p| range.contains(&p.x)).map(|p| p.with_x(0.0).length()).fold(0.0, f32::max);
        assert!(widest <= most && widest > 0.6 * most, "{widest} within {range:?}");
    }
    assert!(matches!(GuidePath::new(vec![Vec3::ZERO], 0.1), Err(TissueError::GuidePoints { points: 1, .. })));
    assert!(matches!(GuidePath::new(vec![Vec3::X; 5], 0.1), Err(TissueError::GuideLength { .. })));
    assert!(matches!(GuidePath::new(corner.clone(), -0.1), Err(TissueError::Negative { .. })));
    assert!(matches!(GuidePath::new(vec![Vec3::X, Vec3::NAN], 0.1), Err(TissueError::NotFinite { .. })));
    assert!(GuidePath::new(corner, f32::NAN).is_err());
    Ok(())
}

#[test]
fn a_guide_keeps_to_the_surface_it_is_laid_on() -> Outcome {
    let ball = Arc::new(MeshSurface::new(ball_soup(40, false)?)?);
    let points = vec![Vec3::X * 1.4, Vec3::Y, Vec3::new(-0.5, 0.3, 0.8)];
    for deviation in [0.0, 0.1] {
        let guide = GuidePath::new(points.clone(), deviation)?.over(ball.clone())?;
        assert!(guide.length() > 2.0, "{} is no way around a ball", guide.length());
        for point in samples(&guide, 1000, 6) {
            assert!((point.length() - 1.0).abs() < 0.01);
        }
        let mut rng = rng(7);
        for _ in 0..300 {
            let found = guide.closest_point(in_cube(&mut rng, 2.0));
            assert!(guide.contains(found.position));
            assert!(found.normal.dot(found.position) > 0.98, "{found:?}");
        }
    }
    assert!(matches!(
        GuidePath::new(vec![Vec3::X, Vec3::X * 2.0], 0.0)?.over(Arc::new(Ball::new(Vec3::ZERO, 1.0)?)),
        Err(TissueError::GuideLength { .. })
    ));
    Ok(())
}

#[test]
fn density_keeps_its_share_of_the_samples() -> Outcome {
    let mesh = grid(10, 1.0)?;
    let share = |field: DensityField| -> Result<(f32, Vec3), Box<dyn std::error::Error>> {
        let tissue = DensityTissue::new(Arc::new(MeshSurface::new(grid(10, 1.0)?)?), field)?;
        let points = samples(&tissue, 40_000, 3);
        Ok((points.len() as f32 / 40_000.0, points.iter().sum::<Vec3>() / points.len() as f32))
    };
    // Probability x: half of the samples are kept, and their mean is at 2/3.
    let painted: Vec<f32> = mesh.positions().iter().map(|position| position.x).collect();
    let on_grid = [0.0, 1.0, 0.0, 1.0];
    for field in [
        DensityField::function(|point| point.x),
        DensityField::on_vertices(&mesh, &painted)?,
        DensityField::on_grid(UVec3::new(2, 2, 1), Vec3::ONE, Vec3::ZERO, &on_grid)?,
    ] {
        let (kept, mean) = share(field)?;
        assert!((kept - 0.5).abs() < 0.01, "{kept} kept");
        assert!((mean - Vec3::new(2.0 / 3.0, 0.5, 0.0)).length() < 0.01, "mean {mean}");
    }
    assert_eq!(share(DensityField::function(|_| 7.0))?.0, 1.0);
    assert_eq!(share(DensityField::function(|_| -7.0))?.0, 0.0);
    assert_eq!(share(DensityField::function(|_| f32::NAN))?.0, 0.0);
    let field = DensityField::on_grid(UVec3::new(2, 2, 1), Vec3::ONE, Vec3::ZERO, &on_grid)?;
    assert_eq!((field.at(Vec3::splat(-5.0)), field.at(Vec3::splat(5.0)), field.at(Vec3::NAN)), (0.0, 1.0, 0.0));
    assert!(matches!(DensityField::on_vertices(&mesh, &[1.0]), Err(TissueError::DensityCount { values: 1, .. })));
    let mut painted = painted;
    painted[4] = f32::NAN;
    let error = DensityField::on_vertices(&mesh, &painted).err();
    assert_eq!(error, Some(TissueError::DensityNotANumber { index: 4 }));
    assert!(DensityField::on_grid(UVec3::ZERO, Vec3::ONE, Vec3::ZERO, &[]).is_err());
    Ok(())
}

#[test]
fn stages_follow_each_other() -> Outcome {
    let disc: Arc<dyn Tissue> = Arc::new(Disc::flat(1.0)?);
    let ball: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::X * 3.0, 0.5)?);
    let line: Arc<dyn Tissue> = Arc::new(GuidePath::new(vec![Vec3::ZERO, Vec3::Y], 0.0)?);
    let staged = Staged::new(vec![(line, 5), (ball.clone(), 0), (disc.clone(), 10)], ball.clone())?;
    let whole: &dyn Tissue = &staged;
    let extents: Vec<Extent> = [1, 5, 6, 15, 16, 99].iter().map(|&step| whole.at_step(step).extent()).collect();
    let [line, disc_extent, ball_extent] = [Extent::Length(1.0), disc.extent(), ball.extent()];
    assert_eq!(extents, [line, line, disc_extent, disc_extent, ball_extent, ball_extent]);
    assert_eq!(whole.extent(), ball_extent);
    assert_eq!(whole.entrance(), Some(Vec3::ZERO));
    assert!(whole.contains(Vec3::X) && whole.contains(Vec3::X * 3.2) && !whole.contains(Vec3::X * 2.0));
    let near = whole.closest_point(Vec3::new(0.5, 0.0, 0.3));
    assert_eq!((near.position, near.normal), (Vec3::X * 0.5, Vec3::Z));
    samples(whole, 100, 1);
    // A tissue without stages is always in force.
    assert_eq!(disc.at_step(7).extent(), disc.extent());
    let staged = Arc::new(staged);
    let field = DensityField::function(|_| 0.5);
    assert_eq!(DensityTissue::new(staged.clone(), field).err(), Some(TissueError::DensityOverStages));
    assert_eq!(Staged::new(vec![(staged, 3)], disc).err(), Some(TissueError::StagesWithinStages));
    Ok(())
}
