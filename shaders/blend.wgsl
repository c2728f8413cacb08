// The picture between two states: positions on the way from the earlier to the later one, so that a frame between two steps
// uploads one number.

@group(0) @binding(0) var<storage, read> earlier: array<f32>;
@group(0) @binding(1) var<storage, read> later: array<f32>;
// x: how much of the way has passed, 0 to 1.
@group(0) @binding(2) var<uniform> part: vec4f;
@group(0) @binding(3) var<storage, read_write> positions: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = id.x + id.y * groups.x * 64u;
    if i < arrayLength(&positions) {
        positions[i] = mix(earlier[i], later[i], part.x);
    }
}
