// Particles as spheres: one square each, on which the fragment finds the sphere, its light and its depth.

// Empty for the free particles; the pinned, grabbed and selected ones by number.
@group(2) @binding(0) var<storage, read> marked: array<u32>;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) centre: vec3f,
    @location(1) world: vec3f,
    @location(2) @interpolate(flat) radius: f32,
    @location(3) @interpolate(flat) colour: vec4f,
    // Width of the outline, in radii; 0 has none.
    @location(4) @interpolate(flat) outline: f32,
    @location(5) @interpolate(flat) outline_colour: vec3f,
};

fn corner_of(n: u32) -> vec2f {
    return array<vec2f, 6>(vec2f(-1.0, -1.0), vec2f(1.0, -1.0), vec2f(-1.0, 1.0), vec2f(-1.0, 1.0), vec2f(1.0, -1.0), vec2f(1.0, 1.0))[n % 6u];
}

// Metres that a pixel covers at a point.
fn pixel_size(centre: vec3f) -> f32 {
    var depth = 1.0;
    if view.eye.w > 0.5 {
        depth = max(dot(centre - view.eye.xyz, view.forward.xyz), 1e-6);
    }
    return 2.0 * length(view.up.xyz) * depth * view.viewport.w;
}

fn square(n: u32, centre: vec3f, radius: f32, colour: vec3f, outline: f32, outline_colour: vec3f) -> Corner {
    let c = corner_of(n);
    // Faces the eye, not the picture's plane: seen in perspective a sphere off the middle would be cut otherwise.
    let eye = to_eye(centre);
    let right = normalize(cross(normalize(view.up.xyz), eye));
    let up = cross(eye, right);
    let reach = radius * 1.15 + 1.5 * pixel_size(centre);
    let world = centre + reach * (c.x * right + c.y * up) + eye * radius;
    return Corner(view.clip_from_world * vec4f(world, 1.0), centre, world, radius, vec4f(colour, 1.0), outline, outline_colour);
}

@vertex
fn free_vertex(@builtin(vertex_index) n: u32) -> Corner {
    let i = n / 6u * cloth.stride.x;
    let centre = position_of(i);
    // Marked particles are drawn by their own call, larger.
    let shown = flags[i] == 0u;
    let pixel = pixel_size(centre);
    // Below a pixel they fade and vanish instead of flickering.
    let radius = select(0.0, max(cloth.sizes.x, 0.8 * pixel), shown);
    var out = square(n, centre, radius, cloth.particle.rgb, 0.0, vec3f(0.0));
    out.colour.a = clamp(cloth.sizes.x / (0.8 * pixel) - 0.2, 0.0, 1.0);
    if !shown || out.colour.a == 0.0 {
        out.clip = vec4f(2.0, 2.0, 2.0, 1.0);
    }
    return out;
}

@vertex
fn marked_vertex(@builtin(vertex_index) n: u32) -> Corner {
    let i = marked[n / 6u];
    let flag = flags[i];
    let centre = position_of(i);
    let point = view.forward.w * pixel_size(centre);
    var colour = cloth.particle.rgb;
    var outline_colour = cloth.selected.rgb;
    var outline = 0.0;
    var radius = max(1.5 * cloth.sizes.x, 3.0 * point);
    if (flag & PINNED) != 0u {
        colour = cloth.pinned.rgb;
        radius = max(1.8 * cloth.sizes.x, 4.0 * point);
    }
    if (flag & SELECTED) != 0u {
        outline = 0.42;
        radius = max(1.5 * radius, 5.0 * point);
    }
    if (flag & GRABBED) != 0u {
        colour = cloth.grabbed.rgb;
        outline = 0.3;
        outline_colour = cloth.pinned.rgb;
        radius = max(1.5 * radius, 6.0 * point);
    }
    return square(n, centre, radius, colour, outline, outline_colour);
}

struct Pixel {
    @location(0) colour: vec4f,
    @builtin(frag_depth) depth: f32,
};

@fragment
fn fragment(in: Corner) -> Pixel {
    var ray = Ray(view.eye.xyz, normalize(in.world - view.eye.xyz));
    if view.eye.w < 0.5 {
        ray = Ray(in.world + view.forward.xyz * -2.0 * in.radius, view.forward.xyz);
    }
    let to_centre = in.centre - ray.origin;
    let along = dot(to_centre, ray.direction);
    let miss = length(to_centre - along * ray.direction);
    // Half a pixel inside and outside of the rim the sphere fades: its edge is smooth also without multisampling.
    let pixel = pixel_size(in.centre);
    let cover = clamp((in.radius - miss) / pixel + 0.5, 0.0, 1.0) * in.colour.a;
    if cover < 0.02 {
        discard;
    }
    let depth_inside = sqrt(max(in.radius * in.radius - miss * miss, 0.0));
    let hit = ray.origin + (along - depth_inside) * ray.direction;
    let normal = normalize(hit - in.centre);
    var colour = studio(linear(in.colour.rgb), normal, -ray.direction, 0.25);
    let ring = smoothstep(-0.6, 0.6, (miss - in.radius * (1.0 - in.outline)) / pixel);
    colour = mix(colour, linear(in.outline_colour), ring * step(0.01, in.outline));
    let clip = view.clip_from_world * vec4f(hit, 1.0);
    // A little forward, so that a particle is not cut in half by the edges that meet in it.
    return Pixel(vec4f(display(colour), cover), clip.z / clip.w);
}
