//! The shader nodes: their names in files and their inputs.

use super::super::nodes::Value;

/// Defines the shader nodes: name in files and inputs.
macro_rules! shaders {
    ($($(#[$doc:meta])* $shader:ident $name:literal ($($input:ident),*);)*) => {
        /// A shader node.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Shader { $($(#[$doc])* $shader,)* }

        impl Shader {
            /// The shader of a name.
            fn from_name(name: &str) -> Option<Shader> {
                match name {
                    $($name => Some(Shader::$shader),)*
                    _ => None,
                }
            }

            /// The name in files.
            pub fn name(self) -> &'static str {
                match self { $(Shader::$shader => $name,)* }
            }

            /// Names of its inputs.
            pub fn inputs(self) -> &'static [&'static str] {
                match self { $(Shader::$shader => &[$(stringify!($input)),*],)* }
            }
        }
    };
}

shaders! {
    /// Disney's and Autodesk's material.
    Principled "principled_bsdf" (
        base_color, metallic, roughness, ior, alpha, normal, diffuse_roughness, subsurface_weight, subsurface_radius,
        subsurface_scale, subsurface_anisotropy, subsurface_skin_ior, subsurface_body, specular_ior_level, specular_tint,
        anisotropic, anisotropic_rotation, transmission_weight, coat_weight, coat_roughness, coat_ior, coat_tint, sheen_weight, sheen_roughness, sheen_tint,
        emission_color, emission_strength, thin_film_thickness, thin_film_ior, multiscatter
    );
    /// Lambert, or Oren-Nayar where it is rough.
    Diffuse "diffuse_bsdf" (color, roughness, normal);
    /// Microfacets that reflect the same share at all angles.
    Glossy "glossy_bsdf" (color, roughness, anisotropy, rotation, multiscatter, normal);
    /// A metal of a reflectance at normal and at grazing incidence.
    Metallic "metallic_bsdf" (base_color, edge_tint, roughness, anisotropy, rotation, multiscatter, normal);
    /// A dielectric interface.
    Glass "glass_bsdf" (color, roughness, ior, multiscatter, normal);
    /// A dielectric interface without reflection.
    Refraction "refraction_bsdf" (color, roughness, ior, multiscatter, normal);
    /// Diffuse transmission.
    Translucent "translucent_bsdf" (color, normal);
    /// Light passes straight on.
    Transparent "transparent_bsdf" (color);
    /// Fibres.
    Sheen "sheen_bsdf" (color, roughness, normal);
    /// The velvet of Ashikhmin.
    Velvet "velvet_bsdf" (color, roughness, normal);
    /// Light in steps, around the normal.
    Toon "toon_bsdf" (color, size, smooth, normal);
    /// Light in steps, around the mirror direction.
    ToonHighlight "toon_highlight_bsdf" (color, size, smooth, normal);
    /// A body that scatters light within.
    Subsurface "subsurface_scattering" (color, scale, radius, anisotropy, skin_ior, body, normal);
    /// Emitted light.
    Emission "emission" (color, strength);
    /// Two shaders mixed.
    Mix "mix_shader" (factor, a, b);
    /// Two shaders added.
    Add "add_shader" (a, b);
}

impl Shader {
    /// The shader that a node's table describes; `None` for other nodes.
    pub fn of(value: Value) -> Option<Shader> {
        let name = value.get_ref().as_table()?.get("type")?.get_ref().as_str()?;
        Shader::from_name(name)
    }
}
