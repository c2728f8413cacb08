// Springs and edges as ribbons of constant width on the screen: two triangles a line, no instance, no draw call of its own.

struct Kind {
    // 0 stretch, 1 shear, 2 bend, 3 edges.
    index: u32,
    padding: vec3u,
};

@group(2) @binding(0) var<uniform> kind: Kind;
@group(2) @binding(1) var<storage, read> pairs: array<vec2u>;
@group(2) @binding(2) var<storage, read> rest: array<f32>;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) colour: vec4f,
    // Pixels from the middle of the line, not divided by depth.
    @location(1) @interpolate(linear) across: f32,
    @location(2) @interpolate(flat) half_width: f32,
};

@vertex
fn vertex(@builtin(vertex_index) n: u32) -> Corner {
    // 0 1 2, 2 1 3: bit 0 is the end, bit 1 the side.
    let corner = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u)[n % 6u];
    var stride = 1u;
    if kind.index < 3u {
        stride = cloth.stride[kind.index + 1u];
    }
    let line = n / 6u * stride;
    let pair = pairs[line];
    let a = position_of(pair.x);
    let b = position_of(pair.y);
    var ca = view.clip_from_world * vec4f(a, 1.0);
    var cb = view.clip_from_world * vec4f(b, 1.0);
    // Cut at the eye's plane: beyond it the division turns the line around.
    let near = 1e-4;
    if ca.w < near && cb.w >= near {
        ca = mix(cb, ca, (cb.w - near) / (cb.w - ca.w));
    } else if cb.w < near && ca.w >= near {
        cb = mix(ca, cb, (ca.w - near) / (ca.w - cb.w));
    }
    let pa = ca.xy / ca.w * view.viewport.xy;
    let pb = cb.xy / cb.w * view.viewport.xy;
    let along = pb - pa;
    let len = length(along);
    let direction = select(vec2f(1.0, 0.0), along / len, len > 1e-6);
    var clip = select(ca, cb, (corner & 1u) == 1u);
    let side = select(-1.0, 1.0, (corner & 2u) == 2u);
    var width = cloth.sizes.y;
    var colour = vec4f(cloth.lines[kind.index].rgb, 1.0);
    if kind.index == 3u {
        // Edges recede where they would cover the surface: few pixels apart, they are gone.
        width = 1.0;
        colour.a = 0.5 * smoothstep(6.0, 22.0, len);
    } else if cloth.rest_scale.w > 0.5 {
        let natural = rest[line] * cloth.rest_scale[kind.index];
        colour = vec4f(ramp((distance(a, b) / natural - 1.0) / cloth.sizes.z), 1.0);
    }
    let half_width = 0.5 * width * view.forward.w;
    let reach = half_width + 0.75;
    let normal = vec2f(-direction.y, direction.x) * side * reach;
    // Clip space is 2 units wide: half a pixel's offset is one over the size.
    clip = vec4f(clip.xy + 2.0 * normal * view.viewport.zw * clip.w, clip.zw);
    // Nearer than the surface that the line lies in (depth is reversed).
    clip.z += 2e-4 * select(1.0, clip.z, view.eye.w > 0.5);
    return Corner(clip, colour, side * reach, half_width);
}

@fragment
fn fragment(in: Corner) -> @location(0) vec4f {
    let cover = clamp(in.half_width + 0.5 - abs(in.across), 0.0, 1.0) * min(2.0 * in.half_width, 1.0);
    if cover * in.colour.a < 0.01 {
        discard;
    }
    return vec4f(in.colour.rgb, in.colour.a * cover);
}
