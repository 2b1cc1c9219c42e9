//! Materials, lights, cameras and the environment in words and units.

use super::facts::material_images;
use oscura::math::DVec3;
use oscura::scene::{
    AlphaMode, Camera, ColorSlot, Environment, FloatSlot, GlassReflection, Light, LightKind, Material, Model,
    Panorama, Parameter, Parameters, PbrMaterial, Projection, Scene,
};

/// Up to four digits behind the point.
pub fn number(x: f64) -> String {
    let text = format!("{x:.4}");
    let trimmed = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    match trimmed {
        "0" | "-0" if x != 0.0 => format!("{x:.3e}"),
        "-0" => "0".to_string(),
        _ => trimmed.to_string(),
    }
}

/// Numbers in brackets.
pub fn list<T: Into<f64> + Copy>(values: &[T]) -> String {
    let shown: Vec<String> = values.iter().map(|&v| number(v.into())).collect();
    format!("({})", shown.join(", "))
}

/// A material's properties that differ from the default.
pub fn material(scene: &Scene, m: &Material) -> String {
    let mut parts = vec![match &m.model {
        Model::SchlickMetal { color: c, roughness } => {
            format!("metal, colour {}, roughness {}", color(c), share(roughness))
        }
        Model::Conductor { eta, k, roughness, .. } => {
            format!("metal of index {} + i {}, roughness {}", list(eta), list(k), share(roughness))
        }
        Model::Dielectric { ior, tint, .. } => {
            format!("glass of index {}, tint {}", number((*ior).into()), color(tint))
        }
        Model::Glass { ior, tint, roughness, is_thin } => {
            let (ior, kind) = (number((*ior).into()), if *is_thin { "thin glass" } else { "glass" });
            format!("{kind} of index {ior}, tint {}, roughness {}", color(tint), share(roughness))
        }
        Model::Pbr(p) => pbr(p),
        plain => parameters(plain),
    }];
    if let Some(e) = &m.emission {
        let sides = if e.two_sided { "both sides" } else { "its front" };
        parts.push(format!("emits {} W/sr/m2 from {sides}", color(&e.radiance)));
    }
    if let Some(medium) = &m.medium {
        let (extinction, albedo) = (list(&medium.extinction), list(&medium.albedo));
        parts.push(format!("filled with a medium of extinction {extinction} a metre, albedo {albedo}"));
    }
    match m.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => {
            parts.push(format!("alpha {} cut at {}", share(&m.alpha), number(cutoff.into())))
        }
        AlphaMode::Blend => parts.push(format!("alpha {}", share(&m.alpha))),
    }
    if m.normal_map.is_some() {
        parts.push("normal map".to_string());
    }
    if !m.double_sided {
        parts.push("one-sided".to_string());
    }
    if m.use_vertex_colors {
        parts.push("vertex colours".to_string());
    }
    let images: Vec<String> =
        material_images(scene, m).into_iter().map(|i| format!("'{}'", scene.images[i].name)).collect();
    if !images.is_empty() {
        parts.push(format!("images {}", images.join(", ")));
    }
    parts.join("; ")
}

/// The name of a model and its parameters.
fn parameters(model: &Model) -> String {
    let mut text = model.name().to_string();
    model.visit("", &mut |name, parameter| {
        let name = if name == "color" { "colour" } else { name };
        match parameter {
            Parameter::Color(slot) => text += &format!(", {name} {}", color(slot)),
            Parameter::Number(slot) => text += &format!(", {name} {}", share(slot)),
            Parameter::Constant(value) => text += &format!(", {name} {}", number((*value).into())),
            Parameter::Texture(_) => {}
        }
    });
    text
}

fn pbr(p: &PbrMaterial) -> String {
    let mut parts = vec![format!(
        "glTF, base colour {}, metallic {}, roughness {}",
        color(&p.base_color),
        share(&p.metallic),
        share(&p.roughness)
    )];
    if p.transmission.factor > 0.0 {
        let wall = match (p.has_volume, p.keeps_radiance) {
            (true, _) => "solid",
            (false, true) => "an open sheet that bends light",
            (false, false) => "thin-walled",
        };
        let ior = number(p.ior.into());
        parts.push(format!("transmission {} ({wall}, index {ior})", share(&p.transmission)));
    }
    if p.specular.factor != 1.0 || p.specular.texture.is_some() {
        parts.push(format!("specular {}", share(&p.specular)));
    }
    let layers = [
        ("rough diffuse", p.diffuse_roughness.factor > 0.0),
        ("clearcoat", p.clearcoat.is_some()),
        ("sheen", p.sheen.is_some()),
        ("anisotropy", p.anisotropy.is_some()),
        ("iridescence", p.iridescence.is_some()),
        ("diffuse transmission", p.diffuse_transmission.is_some()),
        ("dispersion", p.dispersion > 0.0),
        ("tinted reflection", p.glass_reflection == GlassReflection::Tinted),
        ("no reflection", p.glass_reflection == GlassReflection::None),
    ];
    parts.extend(layers.iter().filter(|l| l.1).map(|l| l.0.to_string()));
    parts.join(", ")
}

fn color(slot: &ColorSlot) -> String {
    match (slot.texture, slot.factor) {
        (None, c) => list(&c),
        (Some(_), [1.0, 1.0, 1.0]) => "texture".to_string(),
        (Some(_), c) => format!("texture x {}", list(&c)),
    }
}

fn share(slot: &FloatSlot) -> String {
    match (slot.texture, slot.factor) {
        (None, x) => number(x.into()),
        (Some(_), 1.0) => "texture".to_string(),
        (Some(_), x) => format!("texture x {}", number(x.into())),
    }
}

/// The kind of a light, and the unit of its strength.
pub fn light_kind(light: &Light) -> (&'static str, &'static str) {
    match light.kind {
        LightKind::Point { .. } => ("point", "W/sr"),
        LightKind::Spot { .. } => ("spot", "W/sr"),
        LightKind::Profiled { .. } => ("profiled", "W/sr"),
        LightKind::Directional { .. } => ("directional", "W/m2"),
        LightKind::Sun { .. } => ("sun", "W/m2"),
    }
}

/// A light with its strength and place.
pub fn light(light: &Light) -> String {
    let (kind, unit) = light_kind(light);
    let place = match light.kind {
        LightKind::Point { position } => format!("at {}", list(&position.to_array())),
        LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, .. } => format!(
            "at {} towards {}, full to {} and dark from {} degrees off its axis",
            list(&position.to_array()),
            list(&direction.to_array()),
            number(inner_angle_rad.to_degrees()),
            number(outer_angle_rad.to_degrees())
        ),
        LightKind::Profiled { position, rotation, .. } => format!(
            "at {} towards {}",
            list(&position.to_array()),
            list(&(rotation * DVec3::NEG_Z).to_array())
        ),
        LightKind::Directional { direction } => format!("towards {}", list(&direction.to_array())),
        LightKind::Sun { direction, angle_rad } => format!(
            "towards {}, {} degrees wide",
            list(&direction.to_array()),
            number(angle_rad.to_degrees())
        ),
    };
    format!("{kind}, {} {unit}, {place}", list(&light.intensity))
}

/// The kind of the environment.
pub fn environment_name(environment: &Environment) -> &'static str {
    match environment {
        Environment::Black => "none",
        Environment::Constant(_) => "constant",
        Environment::Gradient { .. } => "gradient",
        Environment::Image { .. } => "image",
    }
}

/// The environment with its radiance.
pub fn environment(scene: &Scene) -> String {
    match &scene.environment {
        Environment::Black => "none".to_string(),
        Environment::Constant(c) => format!("constant, {} W/sr/m2", list(c)),
        Environment::Gradient { nadir, zenith } => {
            format!("gradient, {} W/sr/m2 below to {} above", list(nadir), list(zenith))
        }
        Environment::Image { image, strength, rotation_rad } => format!(
            "image '{}', strength {}, turned by {} degrees",
            scene.images[image.index()].name,
            number((*strength).into()),
            number(rotation_rad.to_degrees())
        ),
    }
}

/// What a panorama shows.
fn words_of_panorama(panorama: &Panorama) -> String {
    let from_to = |[from, to]: [f64; 2]| {
        format!("{} to {} degrees", number(from.to_degrees()), number(to.to_degrees()))
    };
    let fisheye =
        |kind: &str, fov_rad: f64| format!("{kind} fisheye of {} degrees", number(fov_rad.to_degrees()));
    match *panorama {
        Panorama::Equirectangular { longitude_rad, latitude_rad } => format!(
            "equirectangular panorama, longitude {}, latitude {}",
            from_to(longitude_rad),
            from_to(latitude_rad)
        ),
        Panorama::FisheyeEquidistant { fov_rad } => fisheye("equidistant", fov_rad),
        Panorama::FisheyeEquisolid { fov_rad, .. } => fisheye("equisolid", fov_rad),
    }
}

/// A camera with its projection, place and lens.
pub fn camera(camera: &Camera) -> String {
    let projection = match camera.projection {
        Projection::Perspective { vfov_rad } => {
            format!("perspective, {} degrees high", number(vfov_rad.to_degrees()))
        }
        Projection::Orthographic { half_height } => {
            format!("orthographic, {} m high", number(2.0 * half_height))
        }
        Projection::Panorama(panorama) => words_of_panorama(&panorama),
    };
    let placement = camera.world_from_camera;
    let mut text = format!(
        "{projection}, at {} towards {}",
        list(&placement.translation.to_array()),
        list(&(-placement.matrix3.z_axis).to_array())
    );
    if let Some(aspect) = camera.aspect_ratio {
        text += &format!(", {} times as wide", number(aspect));
    }
    if camera.pixel_aspect != 1.0 {
        text += &format!(", pixels {} times as wide as high", number(camera.pixel_aspect));
    }
    if let Some(lens) = camera.lens {
        let radius = lens.focus_distance * (lens.defocus_angle_rad / 2.0).tan();
        text += &format!(
            ", lens of radius {} mm in focus at {} m",
            number(radius * 1000.0),
            number(lens.focus_distance)
        );
    }
    text
}
