//! Every field of every scene type. Structs are destructured: a missing field does not compile. Variants of `non_exhaustive`
//! enums are added by hand.

use super::dice::Dice;
use super::mutate::{Mutate, enums, fields, structs};
use oscura::image::{Encoding, Image, Pixels};
use oscura::scene::{
    AlphaMode, Anisotropy, Aperture, Backdrop, Beam, BounceLimits, Camera, CatcherOutput, Clamp, Clearcoat,
    ColorSlot, CurveBasis, Curves, DiffuseTransmission, Displacement, DisplacementKind, Emission,
    EmissionGrid, EmitterTraits, EnergyCompensation, Environment, Filter, FloatSlot, Fog, FresnelModel,
    GlassReflection, Grid, GridId, ImageId, Instance, Interpolation, Iridescence, Light, LightKind,
    LightLinks, LightProfile, Link, Mapping, Material, MaterialId, Medium, MediumTextures, Mesh, MeshId,
    MeshPart, MixComponent, Model, Motion, NoiseKind, NormalMap, ObjectInfo, ObjectSet, ObjectSets,
    ObjectTraits, PbrMaterial, Portal, ProfileId, Projection, Quad, RayKinds, Scene, Settings,
    ShadowTerminator, Shape, ShapeKind, Sheen, SkippedCaustics, Splats, SpotFalloff, SubsurfaceEntry,
    Texture, TextureId, TextureTransform, ThinLens, VertexAttribute, Wrap,
};

/// Ids mostly change to others that may exist.
macro_rules! ids {
    ($($type:ident)*) => {$(
        impl Mutate for $type {
            fn fresh(_: &mut Dice) -> $type {
                $type(0)
            }

            fn mutate(&mut self, dice: &mut Dice) {
                if dice.once_in(2) {
                    self.0 = dice.below(8) as u32;
                    return dice.note(format!("= {self:?}"));
                }
                self.0.mutate(dice);
            }
        }
    )*};
}

impl Mutate for RayKinds {
    fn fresh(dice: &mut Dice) -> RayKinds {
        RayKinds::from_bits(dice.below(64) as u32)
    }

    fn mutate(&mut self, dice: &mut Dice) {
        *self = RayKinds::fresh(dice);
        dice.note(format!("= {self:?}"));
    }
}

impl Mutate for ObjectSet {
    fn fresh(dice: &mut Dice) -> ObjectSet {
        // A few sets, so that objects and linked lights share some.
        ObjectSet::new(dice.below(3)).expect("one of 64")
    }

    fn mutate(&mut self, dice: &mut Dice) {
        *self = ObjectSet::fresh(dice);
        dice.note(format!("= {self:?}"));
    }
}

impl Mutate for ObjectSets {
    fn fresh(dice: &mut Dice) -> ObjectSets {
        let sets: Vec<ObjectSet> = (0..dice.below(3)).map(|_| ObjectSet::fresh(dice)).collect();
        sets.into_iter().fold(ObjectSets::NONE, ObjectSets::with)
    }

    fn mutate(&mut self, dice: &mut Dice) {
        *self = ObjectSets::fresh(dice);
        dice.note(format!("= {self:?}"));
    }
}

ids! { GridId ImageId MaterialId MeshId ProfileId TextureId }

structs! {
    Medium { extinction, albedo, anisotropy, emission, grid, extinction_grids, scattering_grids, emission_grid, textures }
    MediumTextures { density, color, emission, resolution }
    Grid { name, size, values, world_from_voxels }
    Fog { medium, center, radius }
    Scene {
        name, meshes, instances, shapes, quads, curves, materials, textures, images, grids, profiles, lights, environment, camera_environment, fog, environment_visible_to,
        environment_bsdf_only, backdrop, environment_group, environment_sun, portals, cameras, motion, settings,
    }
    Curves { name, basis, strands, points, radii, colors, world_from_object, material, traits, info }
    Mesh { name, positions, triangles, normals, uv_sets, tangents, colors, attributes, splats, parts }
    Splats { scales, rotations, opacities, degree, coefficients, is_linear }
    VertexAttribute { name, width, values }
    MeshPart { first_triangle, triangle_count, material }
    Instance { name, mesh, world_from_object, material, motion, traits, info, light_group }
    Portal { name, corner, edge_u, edge_v }
    Shape { name, kind, center, radius, rotation, material, traits, info }
    Quad { name, corner, edge_u, edge_v, material, traits, info }
    ObjectInfo { color, index, random }
    Material {
        name, model, emission, double_sided, alpha_mode, alpha, transparent_color, normal_map, normal, bumped_normal, use_vertex_colors, medium, displacement,
        priority, emitter_traits, index, light_group, is_light,
    }
    Displacement { texture, kind }
    Emission { radiance, two_sided }
    EmitterTraits { visible_to, is_obstacle, beam }
    MixComponent { weight, material }
    ColorSlot { factor, texture }
    FloatSlot { factor, texture }
    NormalMap { texture, scale }
    PbrMaterial {
        base_color, metallic, roughness, diffuse_roughness, ior, varying_ior, specular, specular_color, has_constant_reflectance, transmission, has_volume,
        tints_once, keeps_radiance, glass_reflection, energy_compensation, is_beckmann, attenuation_color, attenuation_distance, dispersion, clearcoat,
        sheen, anisotropy, iridescence, diffuse_transmission,
    }
    Clearcoat { factor, roughness, normal_map }
    Sheen { color, roughness }
    Anisotropy { strength, rotation_rad, texture }
    Iridescence { factor, ior, thickness_min_nm, thickness_max_nm, thickness_texture }
    DiffuseTransmission { factor, color, subsurface }
    TextureTransform { offset, rotation_rad, scale }
    Image { name, width, height, channels, encoding, pixels }
    LightProfile { vertical_deg, horizontal_deg, values }
    Light { name, kind, intensity, profile, group, visible_to, links, motion }
    ObjectTraits { visible_to, is_holdout, is_shadow_catcher, sets, links }
    LightLinks { receivers, blockers }
    Camera { name, world_from_camera, projection, aspect_ratio, pixel_aspect, lens, shift, clip, motion }
    ThinLens { defocus_angle_rad, focus_distance, aperture }
    Aperture { blades, rotation_rad, ratio }
    Settings {
        width, height, samples, depth, seed, filter, filter_radius, energy_compensation, fresnel, spectral, exposure, view, white_balance, noise, caught,
        denoise, crop, aovs, bounces, clamp, filter_glossy, skip_caustics, terminator,
    }
    BounceLimits { diffuse, glossy, transmission, volume, transparent, subsurface }
    Clamp { direct, indirect }
    SkippedCaustics { reflective, refractive }
}

enums! {
    EmissionGrid { Temperatures { grid, kelvin, scales_with_power } } { Factors Channels }
    Motion { Still {} Moves {} Deforms {} } { Keyed }
    ShapeKind { Sphere {} Disk {} FacingDisk {} Shell {} } {}
    CurveBasis { Linear {} Bezier {} BSpline {} CatmullRom {} } {}
    AlphaMode { Opaque {} Mask { cutoff } Blend {} } {}
    DisplacementKind { Heights { scale, midlevel, edge } Vectors { keeps_normals } } {}
    FresnelModel { Exact {} Schlick {} } {}
    GlassReflection { White {} Tinted {} None {} } {}
    SubsurfaceEntry { Diffuse {} Skin { ior } Refraction { ior } } {}
    EnergyCompensation { On {} Off {} } {}
    CatcherOutput { All {} Shadows {} } {}
    ShadowTerminator { Soft {} Lifted {} Off {} } {}
    Filter { Box {} Gaussian {} BlackmanHarris {} } {}
    Model {
        Black {}
        Lambert { albedo }
        OrenNayar { color, roughness }
        Phong { diffuse, specular, exponent }
        Beckmann { color, roughness }
        Velvet { color, deviation }
        Toon { color, size, smooth }
        ToonHighlight { color, size, smooth }
        SchlickMetal { color, roughness }
        Conductor { eta, k, metal, roughness }
        Dielectric { ior, tint, fresnel }
        Glass { ior, tint, roughness, is_thin }
        Boundary {}
        Hair { color, roughness, radial_roughness, ior, tilt_rad, coat }
        Mix { components }
    } { Pbr }
    Texture {
        Image { image, wrap_u, wrap_v, interpolation, mapping }
        Checker { even, odd, cell_size, mapping }
        Normal {}
        Noise { kind, frequency, octaves, low, high, seed }
    } { Solid Spectrum Facing }
    Mapping { Uv { set, transform } World {} Triplanar { size } } {}
    Wrap { Repeat {} Mirror {} Clamp {} } {}
    Interpolation { Trilinear {} Bilinear {} Nearest {} } {}
    NoiseKind { Perlin {} Turbulence {} Marble {} } {}
    Encoding { Linear {} Srgb {} } {}
    Pixels {} { U8 U16 F32 }
    LightKind {
        Point { position }
        Spot { position, direction, inner_angle_rad, outer_angle_rad, falloff }
        Profiled { position, rotation, cone }
        Directional { direction }
        Sun { direction, angle_rad }
    } {}
    Link { All {} } { Only AllBut }
    SpotFalloff { Square {} Smooth {} } {}
    Beam {
        Lambertian {}
        Grid { half_angle_rad }
        Cone { direction, inner_angle_rad, outer_angle_rad, falloff }
        Profile { profile, rotation, cone }
    } {}
    Backdrop {} { Color Picture }
    Environment { Black {} Gradient { nadir, zenith } Image { image, strength, rotation_rad } } { Constant }
    Projection { Perspective { vfov_rad } Orthographic { half_height } } {}
}
