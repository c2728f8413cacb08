// The buffers of one cloth, bound as group 1 for every primitive that draws it.

@group(1) @binding(0) var<uniform> cloth: Cloth;
@group(1) @binding(1) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> normals: array<vec4f>;
@group(1) @binding(3) var<storage, read> flags: array<u32>;
@group(1) @binding(4) var<storage, read> values: array<f32>;

fn position_of(i: u32) -> vec3f {
    return vec3f(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
}

// The ramp at -1 (first stop) to 1 (seventh).
fn ramp(value: f32) -> vec3f {
    let place = (clamp(value, -1.0, 1.0) + 1.0) * 3.0;
    let stop = min(u32(place), 5u);
    return mix(cloth.ramp[stop].rgb, cloth.ramp[stop + 1u].rgb, place - f32(stop));
}
