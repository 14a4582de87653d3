//! What has been painted, over the organ: shown while a painting tool is in hand.

use super::{painting::Painting, state::VesselPanel};
use crate::{
    plugin::{GrowthState, OrganPaint, Vasculature, VesselAppearance},
    synthesis::{mesh::TriangleMesh, roots::RootPlacement, tissue::TissuePaint, tree::VesselKind},
};
use bevy::{
    asset::RenderAssetUsages,
    light::{NotShadowCaster, NotShadowReceiver},
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};
use bevy_egui::{
    EguiContexts,
    egui::{Color32, LayerId, Painter, Pos2, Stroke},
};

/// Height of the painted layer above the organ, as a share of its size.
const LIFT: f32 = 0.0015;
/// Colour of thinned tissue and of no-go regions, linear.
const THINNED: [f32; 3] = [0.05, 0.2, 0.9];
const FORBIDDEN: [f32; 3] = [0.9, 0.05, 0.03];
const GUIDE: Color32 = Color32::from_rgb(255, 220, 90);

/// The painted layer of an organ.
#[derive(Component)]
pub(super) struct PaintLayer(Entity);

/// Shows density and no-go regions as a layer over the organ, and takes it away with the tool.
pub(super) fn lay_paint(
    mut commands: Commands,
    panel: Res<VesselPanel>,
    organs: Query<(Entity, &GrowthState, Ref<OrganPaint>)>,
    layers: Query<(Entity, &PaintLayer, &Mesh3d)>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let shows = panel.open && panel.tool.paints();
    let is_painted = |paint: &TissuePaint| paint.density.is_some() || paint.no_go.vertices.is_some();
    for (layer, PaintLayer(organ), _) in &layers {
        let stays = shows && organs.get(*organ).is_ok_and(|(_, _, paint)| is_painted(&paint));
        if !stays {
            commands.entity(layer).despawn();
        }
    }
    for (organ, state, paint) in organs.iter().filter(|(_, _, paint)| shows && is_painted(paint)) {
        let Some(canvas) = state.canvas() else { continue };
        match layers.iter().find(|(_, layer, _)| layer.0 == organ) {
            Some((_, _, mesh)) if paint.is_changed() => {
                if let Some(mut mesh) = meshes.get_mut(&mesh.0) {
                    mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, colors(canvas.mesh(), &paint));
                }
            }
            Some(_) => {}
            None => {
                let look = StandardMaterial { unlit: true, alpha_mode: AlphaMode::Blend, ..default() };
                let layer = (Mesh3d(meshes.add(layer(canvas.mesh(), &paint))), MeshMaterial3d(materials.add(look)));
                let place = (ChildOf(organ), Transform::default());
                commands.spawn((PaintLayer(organ), layer, place, NotShadowCaster, NotShadowReceiver));
            }
        }
    }
}

fn layer(mesh: &TriangleMesh, paint: &TissuePaint) -> Mesh {
    let normals = mesh.vertex_normals_with(&mesh.weld());
    let bounds = mesh.bounds();
    let lift = LIFT * Vec3::from(bounds.max - bounds.min).length();
    let positions: Vec<Vec3> = mesh.positions().iter().zip(&normals).map(|(&at, &up)| at + lift * up).collect();
    let triangles = mesh.triangles().as_flattened().to_vec();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors(mesh, paint))
        .with_inserted_indices(Indices::U32(triangles))
}

/// A colour for each vertex, clear where nothing is painted.
fn colors(mesh: &TriangleMesh, paint: &TissuePaint) -> Vec<[f32; 4]> {
    let color = |vertex: usize| {
        let forbidden = paint.no_go.vertices.as_ref().and_then(|painted| painted.get(vertex)).is_some_and(|&is| is);
        let density =
            paint.density.as_ref().and_then(|values| values.get(vertex)).map_or(1.0, |value| value.clamp(0.0, 1.0));
        let ([r, g, b], a) = if forbidden { (FORBIDDEN, 0.55) } else { (THINNED, 0.55 * (1.0 - density)) };
        [r, g, b, a]
    };
    (0..mesh.positions().len()).map(color).collect()
}

/// Draws guides and placed roots over the picture.
pub(super) fn draw_lines(
    mut contexts: EguiContexts,
    panel: Res<VesselPanel>,
    cameras: Query<(&Camera, &GlobalTransform), With<Camera3d>>,
    organs: Query<(&Vasculature, Option<&OrganPaint>, &VesselAppearance, &GlobalTransform)>,
    painting: Res<Painting>,
) {
    if !panel.tool.paints() {
        return;
    }
    let Some((camera, eye)) = cameras.iter().find(|(camera, _)| camera.is_active) else { return };
    let Ok(context) = contexts.ctx_mut() else { return };
    let painter = context.layer_painter(LayerId::background());
    let zoom = context.zoom_factor();
    let width = if painting.goes_on() { 2.5 } else { 1.5 };
    for (wish, paint, look, place) in &organs {
        let on_screen = |point: Vec3| {
            let at = camera.world_to_viewport(eye, place.transform_point(point)).ok()?;
            Some(Pos2::new(at.x / zoom, at.y / zoom))
        };
        for guide in paint.iter().flat_map(|paint| &paint.guides) {
            let points: Vec<Pos2> = guide.points.iter().copied().filter_map(on_screen).collect();
            for &at in &points {
                painter.circle_filled(at, 2.0 * width, GUIDE);
            }
            painter.line(points, Stroke::new(width, GUIDE));
        }
        for kind in VesselKind::ALL {
            let (RootPlacement::Nearest(points) | RootPlacement::Exact(points)) = &wish.roots[kind] else { continue };
            let [r, g, b, _] = look.colors[kind].to_srgba().to_u8_array();
            for at in points.iter().copied().filter_map(on_screen) {
                draw_root(&painter, at, Color32::from_rgb(r, g, b));
            }
        }
    }
}

fn draw_root(painter: &Painter, at: Pos2, color: Color32) {
    painter.circle_filled(at, 5.0, color);
    painter.circle_stroke(at, 6.0, Stroke::new(1.5, Color32::WHITE));
}
