//! Materials and their textures.

use super::arrays::image;
use super::errors::usage;
use super::scene::{Scene, checked};
use oscura::scene::{
    AlphaMode, Clearcoat, ColorSlot, Emission, FloatSlot, Interpolation, Mapping, Material, Model, NormalMap,
    PbrMaterial, Sheen, Texture, TextureId, Wrap,
};
use pyo3::prelude::*;

/// Texture wrap modes.
fn wrap(word: &str) -> PyResult<Wrap> {
    match word {
        "repeat" => Ok(Wrap::Repeat),
        "mirror" => Ok(Wrap::Mirror),
        "clamp" => Ok(Wrap::Clamp),
        _ => Err(usage(format!("wrap='{word}' is not possible (one of repeat, mirror, clamp)"))),
    }
}

impl Scene {
    fn texture(&mut self, id: Option<u32>) -> PyResult<Option<TextureId>> {
        let count = self.scene_mut()?.textures.len();
        id.map(|id| checked("texture", id, count).map(TextureId)).transpose()
    }
}

#[pymethods]
impl Scene {
    /// Adds a texture from an array of H x W (x C) numbers, bytes or floats; returns its id.
    #[pyo3(signature = (pixels, *, srgb=None, wrap="repeat", name="texture"))]
    fn add_texture(
        &mut self,
        pixels: &Bound<'_, PyAny>,
        srgb: Option<bool>,
        wrap: &str,
        name: &str,
    ) -> PyResult<u32> {
        let wrap = self::wrap(wrap)?;
        let image = image(name, pixels, srgb)?;
        let scene = self.scene_mut()?;
        let image = scene.add_image(image);
        let (mapping, interpolation) = (Mapping::default(), Interpolation::default());
        let texture = Texture::Image { image, wrap_u: wrap, wrap_v: wrap, interpolation, mapping };
        Ok(scene.add_texture(texture).0)
    }

    /// Adds a glTF material; returns its id.
    #[pyo3(signature = (
        name="", *, base_color=[1.0; 3], base_color_texture=None, metallic=0.0, roughness=0.5,
        metallic_roughness_texture=None, normal_texture=None, normal_scale=1.0, ior=1.5, specular=1.0, transmission=0.0,
        thin=false, attenuation_color=[1.0; 3], attenuation_distance=f32::INFINITY, clearcoat=0.0,
        clearcoat_roughness=0.0, sheen_color=[0.0; 3], sheen_roughness=0.3, emission=None, emission_texture=None,
        alpha=1.0, alpha_mode=None, alpha_cutoff=0.5, double_sided=true, vertex_colors=false
    ))]
    #[expect(clippy::too_many_arguments, reason = "they are named in Python")]
    fn add_pbr(
        &mut self,
        name: &str,
        base_color: [f32; 3],
        base_color_texture: Option<u32>,
        metallic: f32,
        roughness: f32,
        metallic_roughness_texture: Option<u32>,
        normal_texture: Option<u32>,
        normal_scale: f32,
        ior: f32,
        specular: f32,
        transmission: f32,
        thin: bool,
        attenuation_color: [f32; 3],
        attenuation_distance: f32,
        clearcoat: f32,
        clearcoat_roughness: f32,
        sheen_color: [f32; 3],
        sheen_roughness: f32,
        emission: Option<[f32; 3]>,
        emission_texture: Option<u32>,
        alpha: f32,
        alpha_mode: Option<&str>,
        alpha_cutoff: f32,
        double_sided: bool,
        vertex_colors: bool,
    ) -> PyResult<u32> {
        let of_texture = self.texture(metallic_roughness_texture)?;
        let channel =
            |factor: f32, channel: u8| FloatSlot { factor, texture: of_texture.map(|id| (id, channel)) };
        let base_texture = self.texture(base_color_texture)?;
        let parameters = PbrMaterial {
            base_color: ColorSlot { factor: base_color, texture: base_texture },
            metallic: channel(metallic, 2),
            roughness: channel(roughness, 1),
            ior,
            specular: specular.into(),
            transmission: transmission.into(),
            has_volume: transmission > 0.0 && !thin,
            attenuation_color,
            attenuation_distance,
            clearcoat: (clearcoat > 0.0).then(|| Clearcoat {
                factor: clearcoat.into(),
                roughness: clearcoat_roughness.into(),
                normal_map: None,
            }),
            sheen: (sheen_color != [0.0; 3])
                .then(|| Sheen { color: sheen_color.into(), roughness: sheen_roughness.into() }),
            ..PbrMaterial::default()
        };
        let emission_texture = self.texture(emission_texture)?;
        let emission = emission.or(emission_texture.map(|_| [1.0; 3]));
        let radiance = |factor| ColorSlot { factor, texture: emission_texture };
        let usual = if alpha < 1.0 { "blend" } else { "opaque" };
        let alpha_mode = match alpha_mode.unwrap_or(usual) {
            "opaque" => AlphaMode::Opaque,
            "mask" => AlphaMode::Mask { cutoff: alpha_cutoff },
            "blend" => AlphaMode::Blend,
            other => {
                return Err(usage(format!(
                    "alpha_mode='{other}' is not possible (one of opaque, mask, blend)"
                )));
            }
        };
        let normal_map = self.texture(normal_texture)?;
        let material = Material {
            emission: emission.map(|factor| Emission { radiance: radiance(factor), two_sided: double_sided }),
            double_sided,
            alpha_mode,
            alpha: FloatSlot { factor: alpha, texture: base_texture.map(|id| (id, 3)) },
            normal_map: normal_map.map(|texture| NormalMap { texture, scale: normal_scale }),
            use_vertex_colors: vertex_colors,
            ..Material::gltf(name, parameters)
        };
        Ok(self.scene_mut()?.add_material(material).0)
    }

    /// Adds an ideally diffuse material; returns its id.
    #[pyo3(signature = (name="", *, color=[0.8; 3], texture=None))]
    fn add_lambert(&mut self, name: &str, color: [f32; 3], texture: Option<u32>) -> PyResult<u32> {
        let albedo = ColorSlot { factor: color, texture: self.texture(texture)? };
        self.add(Material::new(name, Model::Lambert { albedo }))
    }

    /// Adds a metal, by its colour or by its complex index of refraction; returns its id.
    #[pyo3(signature = (name="", *, color=None, eta=None, k=None, roughness=0.2))]
    fn add_metal(
        &mut self,
        name: &str,
        color: Option<[f32; 3]>,
        eta: Option<[f32; 3]>,
        k: Option<[f32; 3]>,
        roughness: f32,
    ) -> PyResult<u32> {
        let roughness = roughness.into();
        let model = match (color, eta.zip(k)) {
            (Some(color), None) if eta.is_none() && k.is_none() => {
                Model::SchlickMetal { color: color.into(), roughness }
            }
            (None, Some((eta, k))) => Model::Conductor { eta, k, metal: None, roughness },
            _ => return Err(usage("a metal needs either color or both eta and k")),
        };
        self.add(Material::new(name, model))
    }

    /// Adds glass; returns its id.
    #[pyo3(signature = (name="", *, ior=1.5, tint=[1.0; 3], roughness=0.0, thin=false))]
    fn add_glass(
        &mut self,
        name: &str,
        ior: f32,
        tint: [f32; 3],
        roughness: f32,
        thin: bool,
    ) -> PyResult<u32> {
        let tint = tint.into();
        let model = match roughness == 0.0 && !thin {
            true => Model::Dielectric { ior, tint, fresnel: Default::default() },
            false => Model::Glass { ior, tint, roughness: roughness.into(), is_thin: thin },
        };
        self.add(Material::new(name, model))
    }

    /// Adds a black emissive material; returns its id.
    #[pyo3(signature = (name="", *, radiance, two_sided=false))]
    fn add_emitter(&mut self, name: &str, radiance: [f32; 3], two_sided: bool) -> PyResult<u32> {
        self.add(Material::emitter(name, radiance, two_sided))
    }
}

impl Scene {
    fn add(&mut self, material: Material) -> PyResult<u32> {
        Ok(self.scene_mut()?.add_material(material).0)
    }
}
