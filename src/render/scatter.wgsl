// Writes segments to their slots: one invocation per segment.

// `SegmentInstance` of `synthesis::instances`: only its size matters here
struct Segment {
    words: array<vec4<f32>, 3>,
}

@group(0) @binding(0) var<storage, read_write> buffer: array<Segment>;
@group(0) @binding(1) var<storage, read> slots: array<u32>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;

@compute @workgroup_size(64)
fn scatter(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&slots) {
        buffer[slots[id.x]] = segments[id.x];
    }
}
