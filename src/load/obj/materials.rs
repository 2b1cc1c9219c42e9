//! MTL materials to the renderer's own.
//!
//! | MTL | Becomes |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour (linear); its image is sRGB-decoded |
//! | `Ke` | emission, from both sides |
//! | `Pr`, `Pm` | roughness, metalness of the glTF model |
//! | `Ns` (without `Pr`) | GGX alpha sqrt(2 / (Ns + 2)) (Walter et al. 2007, eq. 50), roughness its square root |
//! | `Ks` black or absent, no `Pr`, `Pm` | no specular reflection: Lambertian |
//! | `Ks` otherwise, without `Pm` | dielectric reflection of index `Ni` (1.5); the glTF model |
//! | `d` or 1 - `Tr` below 1, or `illum` 4, 6, 7, 9 with `Ni` above 1 | smooth glass of index `Ni` for those `illum`; else alpha |
//! | other maps | ignored, with a warning |

use super::text::texture_file;
use crate::error::Warning;
use crate::load::Loaded;
use crate::load::image::{self, Use};
use crate::scene::{
    AlphaMode, ColorSlot, Emission, FloatSlot, FresnelModel, ImageId, Interpolation, Mapping, Material,
    Model, PbrMaterial, Texture, TextureId, Wrap,
};
use std::path::Path;

/// The material of an MTL entry; its image is read from beside the file.
pub(super) fn convert(source: &tobj::Material, file: &Path, loaded: &mut Loaded) -> Material {
    let parameter = |key: &str| source.unknown_param.get(key).and_then(|v| v.trim().parse::<f32>().ok());
    let mut color = ColorSlot::constant(colour(source.diffuse.unwrap_or([0.8; 3])));
    if let Some(statement) = &source.diffuse_texture {
        color.texture = texture(statement, file, loaded);
        // Many exporters write a black Kd beside a map.
        if color.texture.is_some() && color.factor == [0.0; 3] {
            color.factor = [1.0; 3];
        }
    }
    warn_of_maps(source, file, loaded);
    let ior = source.optical_density.filter(|n| (1.0..=10.0).contains(n));
    let glass = matches!(source.illumination_model, Some(4 | 6 | 7 | 9)) && ior.is_some_and(|n| n > 1.0);
    let (roughness, metallic) = (parameter("Pr"), parameter("Pm"));
    let specular = source.specular.is_some_and(|ks| ks.iter().any(|x| *x > 0.0));
    let model = if glass {
        let tint = ColorSlot::constant([1.0; 3]);
        Model::Dielectric { ior: ior.unwrap_or(1.5), tint, fresnel: FresnelModel::Exact }
    } else if specular || roughness.is_some() || metallic.is_some() {
        let from_exponent = |ns: f32| (2.0 / (ns.max(0.0) + 2.0)).sqrt().sqrt();
        let roughness = roughness.or(source.shininess.map(from_exponent)).unwrap_or(1.0);
        Model::Pbr(Box::new(PbrMaterial {
            base_color: color,
            metallic: FloatSlot::constant(unit(metallic.unwrap_or(0.0))),
            roughness: FloatSlot::constant(unit(roughness)),
            ior: ior.unwrap_or(1.5),
            ..PbrMaterial::default()
        }))
    } else {
        Model::Lambert { albedo: color }
    };
    let mut material = Material::new(&source.name, model);
    let emission: Option<Vec<f32>> =
        source.unknown_param.get("Ke").map(|v| v.split_whitespace().filter_map(|x| x.parse().ok()).collect());
    let emission = source.emissive.map(|e| e.to_vec()).or(emission);
    if let Some([r, g, b]) = emission.as_deref() {
        let radiance = colour_unbounded([*r, *g, *b]);
        if radiance != [0.0; 3] {
            let radiance = ColorSlot::constant(radiance);
            material.emission = Some(Emission { radiance, two_sided: true });
        }
    }
    let opacity = source.dissolve.or(parameter("Tr").map(|t| 1.0 - t)).map_or(1.0, unit);
    if !glass && opacity < 1.0 {
        material.alpha_mode = AlphaMode::Blend;
        material.alpha = FloatSlot::constant(opacity);
    }
    material
}

fn unit(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

fn colour(rgb: [f32; 3]) -> [f32; 3] {
    rgb.map(unit)
}

fn colour_unbounded(rgb: [f32; 3]) -> [f32; 3] {
    rgb.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 })
}

/// The texture of an image; a missing one is a warning and leaves the constant colour.
fn texture(statement: &str, file: &Path, loaded: &mut Loaded) -> Option<TextureId> {
    let name = texture_file(statement).replace('\\', "/");
    let path = file.parent().unwrap_or(file).join(&name);
    let scene = &mut loaded.scene;
    let known = path.display().to_string();
    let image = match scene.images.iter().position(|i| i.name == known) {
        Some(i) => ImageId(i as u32),
        None => match image::read(&path, Use::Color, &mut loaded.warnings) {
            Ok(image) => {
                scene.images.push(image);
                ImageId(scene.images.len() as u32 - 1)
            }
            Err(e) => {
                loaded.warnings.push(Warning::new(file, "", format!("texture left out: {e}")));
                return None;
            }
        },
    };
    scene.textures.push(Texture::Image {
        image,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        interpolation: Interpolation::Trilinear,
        mapping: Mapping::default(),
    });
    Some(TextureId(scene.textures.len() as u32 - 1))
}

fn warn_of_maps(source: &tobj::Material, file: &Path, loaded: &mut Loaded) {
    let maps = [
        ("map_Ks", &source.specular_texture),
        ("map_Bump", &source.normal_texture),
        ("map_Ns", &source.shininess_texture),
        ("map_d", &source.dissolve_texture),
    ];
    let mut names: Vec<&str> = maps.into_iter().filter(|(_, m)| m.is_some()).map(|(n, _)| n).collect();
    names.extend(source.unknown_param.keys().map(String::as_str).filter(|k| k.starts_with("map_")));
    names.sort_unstable();
    if !names.is_empty() {
        let message = format!("material '{}': {} not supported, ignored", source.name, names.join(", "));
        loaded.warnings.push(Warning::new(file, "", message));
    }
}
