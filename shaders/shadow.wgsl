// The cloth seen from straight above, as a mask: the ground blurs it into a shadow.

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    let place = (position_of(i).xz - view.shadow.xy) / view.shadow.z;
    return vec4f(place.x, -place.y, 0.5, 1.0);
}

@fragment
fn fragment() -> @location(0) vec4f {
    return vec4f(1.0);
}
