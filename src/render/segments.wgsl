// Vertex stage of vessel segments, for the main, prepass, shadow and deferred passes alike.
//
// The mesh is many copies of one template, a cone with round ends. A vertex holds its segment of the chunk and its place
// on the template; the segment's end points, radii and colour come from a storage buffer, in which the chunk starts at
// the mesh tag. Slots without length or thickness collapse to a point and draw nothing. An end with a negative radius was
// cut: it is flat, and shows its wall and its lumen.
//
// As a segment gets small in the picture, its vertices slide to the corners of the coarser levels, and below a pixel
// segments drop out one by one while the others get wider: see `detail.rs`.

#import bevy_pbr::{
    mesh_bindings::mesh,
    mesh_view_bindings::view,
    mesh_functions,
    view_transformations::position_world_to_clip,
}
#ifdef PREPASS_PIPELINE
#import bevy_pbr::prepass_io::VertexOutput
#else
#import bevy_pbr::forward_io::VertexOutput
#endif

// `SegmentInstance` of `synthesis::instances`
struct Segment {
    start: vec3<f32>,
    start_radius: f32,
    end: vec3<f32>,
    end_radius: f32,
    color: vec3<f32>,
    birth: f32,
}

struct TemplateVertex {
    @builtin(instance_index) instance_index: u32,
    // cosine and sine of the angle around the axis, times the reach of the polygon's corners; 0 at the start and 1 at the end
    @location(0) around: vec3<f32>,
    // segment within the chunk; latitude within the round end, 0 at its rim and 1 at its pole
    @location(1) place: vec2<f32>,
    // the vertex's first goal: cosine and sine, latitude
    @location(2) first_goal: vec3<f32>,
    // radius in pixels below which it has arrived; most segments kept, as a share; width in pixels below which
    // segments drop out
    @location(3) detail: vec3<f32>,
    // its next goals, with the radius in pixels below which it has arrived
    @location(4) second_goal: vec4<f32>,
    @location(5) third_goal: vec4<f32>,
}

struct SurfacePoint {
    position: vec3<f32>,
    normal: vec3<f32>,
    color: vec3<f32>,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<storage, read> segments: array<Segment>;

const QUARTER_TURN: f32 = 1.5707963;

// Height of the shallow dome that closes a segment's start, in radii.
const START_DOME: f32 = 0.4;

// Width of the lumen of an open end, as a share of the vessel's, and its visible depth, in radii. Walls are drawn thicker
// than the tenth of the calibre that they have in arteries, so that they are visible.
const LUMEN: f32 = 0.7;
const LUMEN_DEPTH: f32 = 1.2;
// The cut wall is paler than the vessel's outside, and the lumen is dark with blood. Linear sRGB.
const CUT_WALL: vec3<f32> = vec3(0.62, 0.36, 0.3);
const LUMEN_BLOOD: vec3<f32> = vec3(0.03, 0.001, 0.002);

// The face of a cut: from the rim, at latitude 0, over the wall to the lumen's edge at 0.5, then down into it.
fn open_end(center: vec3<f32>, radial: vec3<f32>, outward: vec3<f32>, radius: f32, latitude: f32, color: vec3<f32>) -> SurfacePoint {
    let over_wall = saturate(2.0 * latitude);
    let into_lumen = saturate(2.0 * latitude - 1.0);
    let across = mix(1.0, LUMEN, over_wall) * (1.0 - into_lumen);
    let position = center + radius * (across * radial - LUMEN_DEPTH * into_lumen * outward);
    // the wall lies across the vessel, the lumen's inside faces its axis
    let normal = normalize(mix(mix(radial, outward, over_wall), outward - radial, into_lumen * (1.0 - into_lumen)));
    let face = mix(mix(color, CUT_WALL, over_wall), LUMEN_BLOOD, select(into_lumen, 1.0, into_lumen > 0.0));
    return SurfacePoint(position, normal, face);
}

// Share beyond its threshold at which a segment is gone, as in `levels.rs`.
const FADE: f32 = 0.25;

// Pixels of a unit length, in local space, at a point in the world.
fn pixels_per_length(world_from_local: mat4x4<f32>, world: vec3<f32>) -> f32 {
    let depth = (view.clip_from_world * vec4(world, 1.0)).w;
    let axes = mat3x3(world_from_local[0].xyz, world_from_local[1].xyz, world_from_local[2].xyz);
    let squared = max(dot(axes[0], axes[0]), max(dot(axes[1], axes[1]), dot(axes[2], axes[2])));
    // at and behind the camera, everything is large
    return 0.5 * view.viewport.w * abs(view.clip_from_view[1][1]) * sqrt(squared) / max(depth, 1e-12);
}

// Slides a vertex towards a goal, by the radius of its end in pixels: it sets out at twice the radius at which it arrives.
fn slide(place: vec3<f32>, goal: vec3<f32>, radius: f32, slid_below: f32) -> vec3<f32> {
    let slid = saturate(2.0 - radius / max(slid_below, 1e-12));
    // exactly at the goal in the end, which `mix` doesn't guarantee
    return select(mix(place, goal, slid), goal, slid == 1.0);
}

// Factor by which an end is drawn wider: 1 while it is thick enough to be visible. Below that, the share of kept segments
// falls with their width, and these are widened so that together they cover the same area as all would.
fn widening(slot: u32, radius: f32, detail: vec3<f32>) -> f32 {
    let kept = clamp(2.0 * radius / max(detail.z, 1e-12), 1e-6, detail.y);
    if kept >= 1.0 {
        return 1.0;
    }
    let threshold = f32(slot * 0x9e3779b9u) / 4294967296.0;
    let own = saturate(((1.0 + FADE) * kept - threshold) / (FADE * kept));
    let rest = 1.0 - kept;
    let all = select(1.0 - rest * rest / (2.0 * FADE * kept), (1.0 + 0.5 * FADE) * kept, (1.0 + FADE) * kept <= 1.0);
    return own / all;
}

// The point of a segment's surface for a template vertex, in the mesh's local space. `around` has the end in
// its third component.
fn surface_point(segment: Segment, around: vec3<f32>, latitude: f32, widening: f32) -> SurfacePoint {
    let along = segment.end - segment.start;
    let distance = length(along);
    let radii = abs(vec2(segment.start_radius, segment.end_radius));
    if distance == 0.0 || max(radii.x, radii.y) <= 0.0 {
        return SurfacePoint(segment.start, vec3(0.0, 0.0, 1.0), segment.color);
    }
    let axis = along / distance;
    let other = select(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), abs(axis.x) > 0.7);
    let side = normalize(cross(axis, other));
    let reach = length(around.xy);
    let radial = (around.x * side + around.y * cross(axis, side)) / reach;

    let center = mix(segment.start, segment.end, around.z);
    let radius = widening * mix(radii.x, radii.y, around.z);
    if select(segment.start_radius, segment.end_radius, around.z > 0.5) < 0.0 && latitude > 0.0 {
        return open_end(center, radial, select(-axis, axis, around.z > 0.5), reach * radius, latitude, segment.color);
    }

    // the cone touches both end spheres, so its normals lean towards the thinner end by this angle
    let lean = asin(clamp((radii.x - radii.y) / distance, -0.999, 0.999));
    let pole = select(-QUARTER_TURN, QUARTER_TURN, around.z > 0.5);
    let elevation = mix(lean, pole, latitude);
    let normal = cos(elevation) * radial + sin(elevation) * axis;
    // the start has no rings of its own: a full pole would make it pointed where a vessel begins
    let dome = select(1.0, START_DOME, latitude == 1.0 && around.z < 0.5);
    let offset = reach * cos(elevation) * radial + dome * sin(elevation) * axis;
    return SurfacePoint(center + radius * offset, normal, segment.color);
}

@vertex
fn vertex(in: TemplateVertex) -> VertexOutput {
    let slot = u32(in.place.x);
    let segment = segments[mesh_functions::get_tag(in.instance_index) + slot];
    let world_from_local = mesh_functions::get_world_from_local(in.instance_index);

    let center = mix(segment.start, segment.end, in.around.z);
    let world_center = mesh_functions::mesh_position_local_to_world(world_from_local, vec4(center, 1.0)).xyz;
    let radius = mix(abs(segment.start_radius), abs(segment.end_radius), in.around.z) * pixels_per_length(world_from_local, world_center);
    var across_and_latitude = vec3(in.around.xy, in.place.y);
    across_and_latitude = slide(across_and_latitude, in.first_goal, radius, in.detail.x);
    across_and_latitude = slide(across_and_latitude, in.second_goal.xyz, radius, in.second_goal.w);
    across_and_latitude = slide(across_and_latitude, in.third_goal.xyz, radius, in.third_goal.w);
    let across = across_and_latitude.xy;
    let latitude = across_and_latitude.z;

    // a mirroring transform turns triangles inside out; the reverse order around the axis turns them back
    let mirror = mesh_functions::sign_determinant_model_3x3m(mesh[in.instance_index].flags);
    let around = vec3(across.x, across.y * mirror, in.around.z);
    let point = surface_point(segment, around, latitude, widening(slot, radius, in.detail));

    var out: VertexOutput;
    out.world_position = mesh_functions::mesh_position_local_to_world(world_from_local, vec4(point.position, 1.0));
    out.position = position_world_to_clip(out.world_position.xyz);
#ifdef VERTEX_UVS_A
    out.uv = vec2(atan2(across.y, across.x) / (4.0 * QUARTER_TURN) + 0.5, in.around.z);
#endif
#ifdef VERTEX_COLORS
    out.color = vec4(point.color, 1.0);
#endif
#ifdef VERTEX_OUTPUT_INSTANCE_INDEX
    out.instance_index = in.instance_index;
#endif
#ifdef VISIBILITY_RANGE_DITHER
    out.visibility_range_dither =
        mesh_functions::get_visibility_range_dither_level(in.instance_index, world_from_local[3]);
#endif

#ifdef PREPASS_PIPELINE
#ifdef NORMAL_PREPASS_OR_DEFERRED_PREPASS
    out.world_normal = mesh_functions::mesh_normal_local_to_world(point.normal, in.instance_index);
#endif
#ifdef MOTION_VECTOR_PREPASS
    out.previous_world_position = mesh_functions::mesh_position_local_to_world(
        mesh_functions::get_previous_world_from_local(in.instance_index), vec4(point.position, 1.0));
#endif
#ifdef UNCLIPPED_DEPTH_ORTHO_EMULATION
    out.unclipped_depth = out.position.z;
    out.position.z = min(out.position.z, 1.0);
#endif
#else
    out.world_normal = mesh_functions::mesh_normal_local_to_world(point.normal, in.instance_index);
#endif
    return out;
}
