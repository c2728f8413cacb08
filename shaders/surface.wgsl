// The lit cloth: two-sided, with smooth normals, in the side's colour or coloured by values.

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f,
    @location(2) value: f32,
};

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> Corner {
    let world = position_of(i);
    var value = 0.0;
    if cloth.sizes.w > 0.5 {
        value = values[i] / cloth.sizes.z;
    }
    return Corner(view.clip_from_world * vec4f(world, 1.0), world, normals[i].xyz, value);
}

@fragment
fn fragment(in: Corner, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let eye = to_eye(in.world);
    var normal = normalize(in.normal);
    normal = select(-normal, normal, front);
    // A smooth normal may lean away from the eye near a silhouette; light from behind would make it flicker.
    let lean = dot(normal, eye);
    if lean < 0.02 {
        normal = normalize(normal + eye * (0.02 - lean));
    }
    var albedo = linear(select(cloth.back.rgb, cloth.front.rgb, front));
    if cloth.sizes.w > 0.5 {
        albedo = linear(ramp(in.value));
    }
    return vec4f(display(studio(albedo, normal, eye, 0.55)), 1.0);
}
