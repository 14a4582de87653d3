//! Closed meshes, drawn in place of segments.
//!
//! In: [`VesselMesh`]es and the entities that draw them. Out: their materials and distances, and segments that are
//! hidden while a mesh is shown. Nothing here needs storage buffers.
//!
//! A mesh that is new may take some frames until the graphics card has it. Segments are hidden only after these, so that
//! there is always something to see: until then both are drawn, in the same place and colour.

use super::{
    buffer::SegmentBuffer,
    chunk::SegmentChunk,
    material::{VesselMaterials, set_opacity},
};
use crate::{
    plugin::{OrganVessels, SurfaceLevel, VesselAppearance, VesselMesh, VesselSurface, Vessels, VesselsOf},
    synthesis::tree::VesselKind,
};
use bevy::{camera::visibility::VisibilityRange, prelude::*};

/// Gives new entities of meshes their material: one for each vessel entity.
pub(super) fn dress_levels(
    mut commands: Commands,
    meshes: Query<(&VesselMesh, &Vessels, &VesselsOf)>,
    new: Query<(), Added<SurfaceLevel>>,
    dressed: Query<&MeshMaterial3d<StandardMaterial>>,
    looks: Query<&VesselAppearance>,
    templates: Res<VesselMaterials>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (mesh, vessels, of) in &meshes {
        let bare = || mesh.entities().iter().filter(|&&entity| new.contains(entity) && !dressed.contains(entity));
        if bare().next().is_none() {
            continue;
        }
        let kind = vessels.kind();
        let known = mesh.entities().iter().find_map(|&entity| dressed.get(entity).ok());
        let material = known.cloned().unwrap_or_else(|| {
            let base = &templates.0[kind];
            let mut material = base.clone();
            tint(&mut material, base, looks.get(of.0).ok(), kind);
            MeshMaterial3d(materials.add(material))
        });
        for &entity in bare() {
            commands.entity(entity).try_insert(material.clone());
        }
    }
}

/// Gives a material the colour and opacity of a kind, multiplied by those of its template, as with segments.
fn tint(
    material: &mut StandardMaterial,
    template: &StandardMaterial,
    look: Option<&VesselAppearance>,
    kind: VesselKind,
) {
    let own = look.map_or(VesselAppearance::DEFAULT_COLORS[kind], |look| look.colors[kind]).to_linear();
    let base = template.base_color.to_linear();
    material.base_color = Color::linear_rgb(own.red * base.red, own.green * base.green, own.blue * base.blue);
    set_opacity(material, template, own.alpha);
}

/// Recolours meshes when their organ's appearance changes.
pub(super) fn recolor_levels(
    organs: Query<(&VesselAppearance, &OrganVessels), Changed<VesselAppearance>>,
    meshes: Query<(&VesselMesh, &Vessels)>,
    dressed: Query<&MeshMaterial3d<StandardMaterial>>,
    templates: Res<VesselMaterials>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (look, vessels) in &organs {
        for (mesh, vessels) in meshes.iter_many(vessels.entities()) {
            let (kind, template) = (vessels.kind(), &templates.0[vessels.kind()]);
            for handle in mesh.entities().iter().filter_map(|&entity| dressed.get(entity).ok()) {
                let Some(mut material) = materials.get(&handle.0).cloned() else { continue };
                let before = (material.base_color, material.alpha_mode);
                tint(&mut material, template, Some(look), kind);
                if before != (material.base_color, material.alpha_mode) {
                    materials.insert(handle.0.id(), material).ok();
                }
            }
        }
    }
}

/// Keeps the distances from which meshes are seen up to date with the size of their organ in the world.
pub(super) fn range_levels(
    mut commands: Commands,
    meshes: Query<(&VesselMesh, &VesselsOf, &GlobalTransform)>,
    organs: Query<&VesselSurface>,
    mut levels: Query<(&SurfaceLevel, Option<&mut VisibilityRange>)>,
) {
    for (mesh, of, place) in &meshes {
        let Ok(surface) = organs.get(of.0) else { continue };
        let axes = place.affine().matrix3;
        let scale = axes.x_axis.length().max(axes.y_axis.length()).max(axes.z_axis.length());
        let size = mesh.size() * scale;
        let ranges = surface.detail.filter(|_| mesh.entities().len() > 1).map(|detail| detail.ranges());
        for &entity in mesh.entities() {
            let Ok((level, range)) = levels.get_mut(entity) else { continue };
            let wanted = ranges.and_then(|ranges| ranges.get(level.level as usize).map(|range| scaled(*range, size)));
            match (wanted, range) {
                (Some(wanted), Some(mut range)) => drop(range.set_if_neq(wanted)),
                (Some(wanted), None) => drop(commands.entity(entity).try_insert(wanted)),
                (None, Some(_)) => drop(commands.entity(entity).try_remove::<VisibilityRange>()),
                (None, None) => {}
            }
        }
    }
}

/// A range of distances in sizes, as one in the world.
fn scaled(range: [f32; 4], size: f32) -> VisibilityRange {
    let [from, whole, until, gone] = range.map(|distance| (distance * size).min(f32::MAX));
    VisibilityRange { start_margin: from..whole, end_margin: until..gone, use_aabb: false }
}

/// Hides the chunks of segments that a mesh covers, and shows those that none covers any more.
pub(super) fn hide_covered(
    drawn: Query<(&SegmentBuffer, &VesselMesh)>,
    mut chunks: Query<&mut Visibility, With<SegmentChunk>>,
) {
    for (segments, _) in &drawn {
        let visibility = if segments.is_covered() { Visibility::Hidden } else { Visibility::Inherited };
        set_visibility(segments, visibility, &mut chunks);
    }
}

/// Shows the segments of vessels that lost their mesh.
pub(super) fn uncover(
    removed: On<Remove, VesselMesh>,
    drawn: Query<&SegmentBuffer>,
    mut chunks: Query<&mut Visibility, With<SegmentChunk>>,
) {
    if let Ok(segments) = drawn.get(removed.entity) {
        set_visibility(segments, Visibility::Inherited, &mut chunks);
    }
}

fn set_visibility(
    segments: &SegmentBuffer,
    visibility: Visibility,
    chunks: &mut Query<&mut Visibility, With<SegmentChunk>>,
) {
    let mut chunks = chunks.iter_many_mut(segments.chunks().iter().chain(segments.stump_chunks()));
    while let Some(mut chunk) = chunks.fetch_next() {
        chunk.set_if_neq(visibility);
    }
}
