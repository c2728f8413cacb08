// What every shader shares: the view, the cloth's data, light and colour ramp. Rust puts it in front of each primitive.

struct View {
    clip_from_world: mat4x4f,
    // xyz: the eye; w: 1 in perspective, 0 in orthographic projection.
    eye: vec4f,
    // The camera's right and up, as long as half of the picture is wide and high at distance 1 (orthographic: at any distance).
    right: vec4f,
    up: vec4f,
    // xyz: unit vector; w: pixels per point.
    forward: vec4f,
    // Size and its inverse, pixels.
    viewport: vec4f,
    sky_top: vec4f,
    sky_bottom: vec4f,
    grid: vec4f,
    // Height of the ground, cell size, distance at which the grid has faded, 1 to draw the axes.
    ground: vec4f,
    // xyz: the camera's target; w: strength of the shadow.
    target_point: vec4f,
    // x, z of the shadow map's centre, half of its side, height of the cloth above the ground.
    shadow: vec4f,
};

struct Cloth {
    front: vec4f,
    back: vec4f,
    particle: vec4f,
    pinned: vec4f,
    grabbed: vec4f,
    selected: vec4f,
    // Stretch, shear, bend, edges.
    lines: array<vec4f, 4>,
    ramp: array<vec4f, 8>,
    // Particle radius (m), line width (points), largest value of the ramp, 1 if values colour the surface.
    sizes: vec4f,
    // Rest length scales of stretch, shear, bend; w: 1 if strain colours the springs.
    rest_scale: vec4f,
    // Every n-th of: particles, stretch, shear, bend.
    stride: vec4u,
};

const PINNED = 1u;
const GRABBED = 2u;
const SELECTED = 4u;

@group(0) @binding(0) var<uniform> view: View;

struct Ray {
    origin: vec3f,
    direction: vec3f,
};

fn view_ray(ndc: vec2f) -> Ray {
    let offset = ndc.x * view.right.xyz + ndc.y * view.up.xyz;
    if view.eye.w > 0.5 {
        return Ray(view.eye.xyz, normalize(view.forward.xyz + offset));
    }
    return Ray(view.eye.xyz + offset, view.forward.xyz);
}

// Unit vector from a point to the eye.
fn to_eye(world: vec3f) -> vec3f {
    if view.eye.w > 0.5 {
        return normalize(view.eye.xyz - world);
    }
    return -view.forward.xyz;
}

fn linear(display: vec3f) -> vec3f {
    return pow(display, vec3f(2.2));
}

fn display(linear_colour: vec3f) -> vec3f {
    return pow(clamp(linear_colour, vec3f(0.0), vec3f(1.0)), vec3f(1.0 / 2.2));
}

// A quiet studio: sky and ground light, a key light over the camera's left shoulder, a weak fill from the right.
// It turns with the camera, so that no side of the cloth is ever dark.
fn studio(albedo: vec3f, normal: vec3f, eye: vec3f, sheen: f32) -> vec3f {
    let right = normalize(view.right.xyz);
    let up = vec3f(0.0, 1.0, 0.0);
    let back = -view.forward.xyz;
    let key = normalize(-0.85 * right + 0.75 * up + 0.55 * back);
    let fill = normalize(0.9 * right - 0.1 * up + 0.35 * back);
    let sky = mix(vec3f(0.09, 0.08, 0.09), vec3f(0.21, 0.235, 0.28), 0.5 + 0.5 * normal.y);
    // Wrapped: cloth lets light through, its terminator is soft.
    let lit = max((dot(normal, key) + 0.15) / 1.15, 0.0);
    let filled = max(dot(normal, fill), 0.0);
    var colour = albedo * (sky + 1.22 * lit * vec3f(1.0, 0.96, 0.90) + 0.14 * filled * vec3f(0.70, 0.82, 1.0));
    let halfway = normalize(key + eye);
    colour += 0.05 * lit * pow(max(dot(normal, halfway), 0.0), 20.0);
    // Fibres that stand off catch light at the rim.
    let rim = pow(1.0 - clamp(dot(normal, eye), 0.0, 1.0), 3.0);
    colour += sheen * rim * (0.45 * albedo + vec3f(0.05)) * (0.6 + 0.4 * normal.y);
    return colour;
}
