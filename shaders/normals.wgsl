// Smooth normals: each particle sums the area vectors of its triangles. Gathered, not scattered, so that no atomics are needed
// and every run adds in the same order.

@group(0) @binding(0) var<storage, read> positions: array<f32>;
@group(0) @binding(1) var<storage, read> triangles: array<u32>;
// Particle i has the triangles around[starts[i]] .. around[starts[i + 1]].
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> around: array<u32>;
@group(0) @binding(4) var<storage, read_write> normals: array<vec4f>;

fn position_of(i: u32) -> vec3f {
    return vec3f(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = id.x + id.y * groups.x * 64u;
    if i >= arrayLength(&normals) {
        return;
    }
    var sum = vec3f(0.0);
    for (var k = starts[i]; k < starts[i + 1u]; k++) {
        let t = 3u * around[k];
        let a = position_of(triangles[t]);
        sum += cross(position_of(triangles[t + 1u]) - a, position_of(triangles[t + 2u]) - a);
    }
    let len = length(sum);
    normals[i] = vec4f(select(vec3f(0.0, 1.0, 0.0), sum / len, len > 0.0), 0.0);
}
