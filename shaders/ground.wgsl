// Backdrop, and the ground: a grid that fades in the distance, the axes, and the cloth's soft shadow.

@group(1) @binding(0) var shadow_map: texture_2d<f32>;
@group(1) @binding(1) var shadow_sampler: sampler;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) ndc: vec2f,
};

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> Corner {
    let ndc = vec2f(f32(i & 1u), f32(i >> 1u)) * 4.0 - 1.0;
    return Corner(vec4f(ndc, 0.0, 1.0), ndc);
}

@fragment
fn backdrop(in: Corner) -> @location(0) vec4f {
    let height = smoothstep(-1.0, 1.0, in.ndc.y);
    var colour = mix(view.sky_bottom.rgb, view.sky_top.rgb, height);
    // A quiet pool of light behind the cloth. A grain hides the steps of 8 bits; it repeats every 4 pixels, which
    // picture files compress well.
    colour *= 1.0 + 0.10 * exp(-1.2 * dot(in.ndc, in.ndc));
    let y = u32(in.clip.y);
    let d = u32(in.clip.x) ^ y;
    let grain = f32((d & 1u) * 8u + (y & 1u) * 4u + (d & 2u) + ((y >> 1u) & 1u)) / 16.0 - 0.47;
    return vec4f(colour + grain / 255.0, 1.0);
}

// How much of a line of the given width (pixels) at every multiple of `cell` covers this pixel.
fn lines(place: vec2f, width: vec2f, cell: f32, pixels: f32) -> vec2f {
    let distance = abs(fract(place / cell - 0.5) - 0.5) * cell;
    let cover = 1.0 - smoothstep(vec2f(0.0), width * pixels, distance);
    // Lines nearer than a few pixels to each other become an even tone, here none.
    return cover * clamp(1.5 - 4.0 * width / cell, vec2f(0.0), vec2f(1.0));
}

struct Pixel {
    @location(0) colour: vec4f,
    @builtin(frag_depth) depth: f32,
};

@fragment
fn ground(in: Corner) -> Pixel {
    let ray = view_ray(in.ndc);
    let t = (view.ground.x - ray.origin.y) / ray.direction.y;
    let world = ray.origin + t * ray.direction;
    let width = fwidth(world.xz);
    let shade = shadow(world.xz);
    if !(t > 0.0) || abs(ray.direction.y) < 1e-4 {
        discard;
    }
    let away = distance(world.xz, view.target_point.xz) / view.ground.z;
    let grazing = clamp(abs(ray.direction.y) * 7.0, 0.0, 1.0);
    let fade = exp(-3.0 * away * away) * grazing;
    let cell = view.ground.y;
    let minor = lines(world.xz, width, cell, 1.2);
    let major = lines(world.xz, width, 5.0 * cell, 1.5);
    var alpha = max(0.38 * max(minor.x, minor.y), 0.85 * max(major.x, major.y)) * view.grid.a;
    var colour = view.grid.rgb;
    if view.ground.w > 0.5 {
        let axis = 1.0 - smoothstep(vec2f(0.4), vec2f(1.6), abs(world.zx) / width.yx);
        colour = mix(colour, vec3f(0.86, 0.30, 0.32), axis.x);
        colour = mix(colour, vec3f(0.28, 0.50, 0.92), axis.y);
        alpha = max(alpha, 0.8 * max(axis.x, axis.y));
    }
    alpha *= fade;
    // Seen from below, the grid stays a hint.
    alpha *= select(1.0, 0.35, ray.direction.y > 0.0);
    let dark = select(shade, 0.0, ray.direction.y > 0.0) * fade;
    let all = dark + alpha * (1.0 - dark * 0.5);
    let clip = view.clip_from_world * vec4f(world, 1.0);
    return Pixel(vec4f(colour * alpha / max(all, 1e-4), all), clip.z / clip.w);
}

// The blurred shadow map: 16 taps in a spiral, turned by the pixel's noise-free place so that pictures repeat.
fn shadow(place: vec2f) -> f32 {
    if view.target_point.w <= 0.0 {
        return 0.0;
    }
    let centre = (place - view.shadow.xy) / (2.0 * view.shadow.z) + 0.5;
    var sum = 0.0;
    for (var i = 0; i < 16; i++) {
        let angle = 2.399963 * f32(i);
        let radius = 0.075 * sqrt((f32(i) + 0.5) / 16.0);
        sum += textureSampleLevel(shadow_map, shadow_sampler, centre + radius * vec2f(cos(angle), sin(angle)), 0.0).r;
    }
    let inside = step(abs(centre.x - 0.5), 0.5) * step(abs(centre.y - 0.5), 0.5);
    return view.target_point.w * inside * sum / 16.0;
}
