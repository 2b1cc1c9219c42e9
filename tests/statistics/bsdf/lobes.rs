//! The BSDFs under test.

use oscura::bsdf::{
    Beckmann, Bsdf, BsdfProgram, Coat, Conductor, Factors, Lambert, Layered, LocalFrame, Microsurface,
    OrenNayar, Phong, SchlickMetal, ShadingModel, Toon, Velvet,
};
use oscura::color::Rgb;
use oscura::math::{Vec2, Vec3};
use oscura::scene::{
    Anisotropy, Clearcoat, ColorSlot, DiffuseTransmission, EnergyCompensation, FloatSlot, GlassReflection,
    Iridescence, Model, PbrMaterial, Sheen, SubsurfaceEntry,
};
use std::cell::Cell;

/// The cases that a test covers. The quick version of a slow test covers every n-th: with the same samples and bounds for each.
pub struct Cases {
    step: usize,
    met: Cell<usize>,
}

impl Cases {
    /// All of them, for ignored tests.
    pub fn all() -> Cases {
        Cases::each(1)
    }

    /// Every `step`-th. A prime that is not the length of any loop over the cases reaches every value of every loop.
    pub fn each(step: usize) -> Cases {
        Cases { step, met: Cell::new(0) }
    }

    /// Is the next case covered? Call once for each case.
    pub fn takes(&self) -> bool {
        self.met.replace(self.met.get() + 1).is_multiple_of(self.step)
    }
}

/// Euclidean length, a measure of the distance between colours.
pub fn length(color: Rgb) -> f32 {
    Vec3::from_array(color.to_array()).length()
}

/// A unit vector by its cosine with z and its azimuth.
pub fn direction(cosine: f32, azimuth: f32) -> Vec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    Vec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine).normalize()
}

/// A metal.
pub fn conductor(alpha: f32, energy_compensation: EnergyCompensation) -> Bsdf {
    Bsdf::SchlickMetal(SchlickMetal { f0: Rgb::new(0.9, 0.7, 0.4), alpha, energy_compensation })
}

/// Gold with anisotropic roughness.
pub fn gold(alpha: [f32; 2], energy_compensation: EnergyCompensation) -> Bsdf {
    Bsdf::Conductor(Conductor {
        eta: Rgb::new(0.143, 0.375, 1.442),
        k: Rgb::new(3.983, 2.386, 1.603),
        surface: Microsurface::new(alpha, [0.6, 0.8]),
        energy_compensation,
    })
}

/// A constant slot.
pub fn number(value: f32) -> FloatSlot {
    FloatSlot::constant(value)
}

/// A white, rough dielectric, modified.
pub fn pbr(change: impl FnOnce(&mut PbrMaterial)) -> PbrMaterial {
    let mut p = PbrMaterial { metallic: number(0.0), ..PbrMaterial::default() };
    change(&mut p);
    p
}

/// The BSDF of a glTF material, with rotated tangents.
pub fn resolved(p: PbrMaterial) -> Bsdf {
    resolved_with(p, ShadingModel::default())
}

/// The same with other models.
pub fn resolved_with(p: PbrMaterial, shading: ShadingModel) -> Bsdf {
    let frame =
        LocalFrame { tangent: Vec2::new(0.8, 0.6), bitangent: Vec2::new(-0.6, 0.8), ..LocalFrame::DEFAULT };
    BsdfProgram::of(&Model::Pbr(Box::new(p)), shading).evaluate(&Factors, &frame)
}

/// A coloured glTF material of the four basic parameters.
pub fn basic(roughness: f32, metallic: f32, transmission: f32, has_volume: bool) -> Bsdf {
    resolved(pbr(|p| {
        p.base_color.factor = [0.8, 0.5, 0.2];
        (p.roughness, p.metallic, p.transmission) =
            (number(roughness), number(metallic), number(transmission));
        p.has_volume = has_volume;
    }))
}

/// Glass.
pub fn glass(
    ior: f32,
    roughness: f32,
    is_thin: bool,
    tint: [f32; 3],
    energy_compensation: EnergyCompensation,
) -> Bsdf {
    let model = Model::Glass { ior, tint: ColorSlot::constant(tint), roughness: number(roughness), is_thin };
    let shading = ShadingModel { energy_compensation, ..ShadingModel::default() };
    BsdfProgram::of(&model, shading).evaluate(&Factors, &LocalFrame::DEFAULT)
}

/// Glass with a reflection tint.
pub fn colored(reflection: GlassReflection, roughness: f32, has_volume: bool) -> PbrMaterial {
    pbr(|p| {
        p.base_color.factor = [0.9, 0.5, 0.1];
        (p.roughness, p.transmission, p.has_volume) = (number(roughness), number(1.0), has_volume);
        p.glass_reflection = reflection;
    })
}

/// A clearcoat.
pub fn coat(factor: f32, roughness: f32) -> Option<Clearcoat> {
    Some(Clearcoat { factor: number(factor), roughness: number(roughness), normal_map: None })
}

/// A sheen layer.
pub fn sheen(color: [f32; 3], roughness: f32) -> Option<Sheen> {
    Some(Sheen { color: ColorSlot::constant(color), roughness: number(roughness) })
}

/// A thin film of full strength.
pub fn film(ior: f32, thickness_nm: f32) -> Option<Iridescence> {
    Some(Iridescence {
        factor: number(1.0),
        ior,
        thickness_min_nm: 0.0,
        thickness_max_nm: thickness_nm,
        thickness_texture: None,
    })
}

/// Anisotropic roughness.
pub fn anisotropy(strength: f32) -> Option<Anisotropy> {
    Some(Anisotropy { strength, rotation_rad: 0.4, texture: None })
}

/// Diffuse transmission.
pub fn through(factor: f32, color: [f32; 3]) -> Option<DiffuseTransmission> {
    let color = ColorSlot::constant(color);
    Some(DiffuseTransmission { factor: number(factor), color, subsurface: None })
}

/// A subsurface solid with a surface roughness of 0.4.
fn body(entry: SubsurfaceEntry) -> PbrMaterial {
    pbr(|p| {
        let through = through(1.0, [1.0; 3]).map(|t| DiffuseTransmission { subsurface: Some(entry), ..t });
        (p.roughness, p.diffuse_transmission, p.has_volume) = (number(0.4), through, true);
    })
}

/// The same coat with its own normal.
fn tilted(bsdf: Bsdf, normal: Vec3) -> Bsdf {
    match bsdf {
        Bsdf::Layered(l) => {
            Bsdf::Layered(Layered { coat: Coat { normal: normal.normalize(), ..l.coat }, ..l })
        }
        other => other,
    }
}

/// Every non-delta lobe and layer.
pub fn finite() -> Vec<(String, Bsdf)> {
    let mut all: Vec<(String, Bsdf)> = Vec::new();
    let mut add = |name: &str, bsdf: Bsdf| all.push((name.to_string(), bsdf));
    add("lambert", Bsdf::Lambert(Lambert { albedo: Rgb::splat(0.5) }));
    for roughness in [0.3, 1.0] {
        let color = Rgb::new(0.9, 0.5, 0.1);
        add(&format!("oren-nayar {roughness}"), Bsdf::OrenNayar(OrenNayar { color, roughness }));
    }
    for exponent in [0.0, 5.0, 60.0] {
        let phong = Phong::new(Rgb::new(0.3, 0.2, 0.1), Rgb::splat(0.5), exponent);
        add(&format!("phong {exponent}"), Bsdf::Phong(phong));
    }
    for alpha in [0.05, 0.4, 1.0] {
        let color = Rgb::new(0.9, 0.5, 0.1);
        add(&format!("beckmann {alpha}"), Bsdf::Beckmann(Beckmann { color, alpha }));
    }
    for deviation in [0.2, 0.7] {
        let color = Rgb::new(0.8, 0.5, 0.1);
        add(&format!("velvet {deviation}"), Bsdf::Velvet(Velvet { color, deviation }));
    }
    for (angles, is_glossy) in
        [([0.4, 0.3], false), ([0.9, 0.5], false), ([0.2, 0.1], true), ([0.6, 0.0], true)]
    {
        add(
            &format!("toon {angles:?} {is_glossy}"),
            Bsdf::Toon(Toon::new(Rgb::splat(0.6), angles, is_glossy)),
        );
    }
    for alpha in [0.05, 0.15, 0.4, 1.0] {
        add(&format!("conductor {alpha}"), conductor(alpha, EnergyCompensation::On));
        add(&format!("pbr {alpha}"), basic(alpha.sqrt(), 0.3, 0.0, false));
    }
    add("gold", gold([0.1, 0.5], EnergyCompensation::On));
    add("plastic", basic(0.5, 0.0, 0.0, false));
    add("coated diffuse", basic(0.0, 0.0, 0.0, false));
    for (ior, roughness) in
        [(1.5, 0.3), (1.5, 0.7), (1.1, 0.8), (1.2, 0.8), (1.01, 0.8), (2.4, 0.5), (1.33, 1.0)]
    {
        add(
            &format!("glass {ior} {roughness}"),
            glass(ior, roughness, false, [1.0; 3], EnergyCompensation::On),
        );
    }
    add("tinted glass", glass(1.5, 0.5, false, [0.9, 0.3, 0.1], EnergyCompensation::Off));
    add("coloured glass", glass(1.5, 0.8, false, [0.9, 0.3, 0.0], EnergyCompensation::On));
    add("bubble", glass(1.5, 0.6, false, [1.0; 3], EnergyCompensation::On).with_ior(0.6));
    add("thin glass", glass(1.5, 0.5, true, [0.9, 0.3, 0.1], EnergyCompensation::On));
    for (name, reflection, volume) in [
        ("glass of tinted reflection", GlassReflection::Tinted, true),
        ("thin glass of tinted reflection", GlassReflection::Tinted, false),
        ("refraction alone", GlassReflection::None, true),
    ] {
        add(name, resolved(colored(reflection, 0.6, volume)));
    }
    for (name, roughness) in [("glass of Beckmann's facets", 0.6), ("rough glass of Beckmann's facets", 0.9)]
    {
        add(
            name,
            resolved(PbrMaterial { is_beckmann: true, ..colored(GlassReflection::White, roughness, true) }),
        );
    }
    add("half transmissive", basic(0.6, 0.0, 0.5, true));
    add("mixed", basic(0.6, 0.4, 0.5, false));
    add("brown hair", hair([0.3, 0.15, 0.05], [0.3, 0.3], 0.035, 0.0));
    add("white hair", hair([1.0; 3], [0.6, 0.9], 0.2, 0.0));
    add("coated fur", hair([0.8, 0.7, 0.5], [0.4, 0.5], -0.1, 0.6));
    for (name, material) in layers() {
        add(name, resolved(material));
    }
    let coated = resolved(pbr(|p| p.clearcoat = coat(1.0, 0.4)));
    add("tilted coat", tilted(coated, Vec3::new(0.3, -0.2, 0.8)));
    all
}

/// Hair around a tilted fibre.
pub fn hair(color: [f32; 3], roughness: [f32; 2], tilt_rad: f32, coat: f32) -> Bsdf {
    let frame = LocalFrame { tangent: Vec2::new(0.8, 0.6), ..LocalFrame::DEFAULT };
    let model = Model::Hair {
        color: ColorSlot::constant(color),
        roughness: number(roughness[0]),
        radial_roughness: number(roughness[1]),
        ior: 1.55,
        tilt_rad,
        coat: number(coat),
    };
    BsdfProgram::of(&model, ShadingModel::default()).evaluate(&Factors, &frame)
}

/// Layered materials, most of them without delta lobes.
pub fn layers() -> Vec<(&'static str, PbrMaterial)> {
    vec![
        ("coat on diffuse", pbr(|p| (p.clearcoat, p.specular) = (coat(1.0, 0.3), number(0.0)))),
        (
            "smooth coat on metal",
            pbr(|p| (p.clearcoat, p.metallic, p.roughness) = (coat(0.7, 0.0), number(1.0), number(0.5))),
        ),
        ("rough diffuse", pbr(|p| (p.diffuse_roughness, p.roughness) = (number(0.7), number(0.4)))),
        ("sheen", pbr(|p| p.sheen = sheen([0.9, 0.4, 0.2], 0.5))),
        ("rough sheen", pbr(|p| p.sheen = sheen([1.0; 3], 1.0))),
        ("narrow sheen", pbr(|p| p.sheen = sheen([1.0; 3], 0.15))),
        (
            "anisotropic metal",
            pbr(|p| (p.anisotropy, p.metallic, p.roughness) = (anisotropy(0.7), number(1.0), number(0.4))),
        ),
        ("anisotropic plastic", pbr(|p| (p.anisotropy, p.roughness) = (anisotropy(1.0), number(0.5)))),
        (
            "film on metal",
            pbr(|p| (p.iridescence, p.metallic, p.roughness) = (film(1.4, 350.0), number(1.0), number(0.4))),
        ),
        (
            "film on glass",
            pbr(|p| {
                (p.iridescence, p.transmission, p.roughness, p.has_volume) =
                    (film(1.8, 400.0), number(1.0), number(0.4), true)
            }),
        ),
        (
            "anisotropic glass of high index",
            pbr(|p| {
                (p.anisotropy, p.transmission, p.roughness) = (anisotropy(1.0), number(1.0), number(0.9));
                (p.ior, p.has_volume) = (4.0, true);
            }),
        ),
        ("leaf", pbr(|p| p.diffuse_transmission = through(0.6, [0.2, 0.8, 0.1]))),
        ("refracting body", body(SubsurfaceEntry::Refraction { ior: 1.5 })),
        ("skin", body(SubsurfaceEntry::Skin { ior: 1.4 })),
        (
            "anisotropic glass",
            pbr(|p| {
                (p.anisotropy, p.transmission, p.roughness, p.has_volume) =
                    (anisotropy(0.6), number(1.0), number(0.5), true)
            }),
        ),
        (
            "dull glass",
            pbr(|p| {
                (p.specular, p.transmission, p.roughness, p.has_volume) =
                    (number(0.3), number(1.0), number(0.5), true)
            }),
        ),
        (
            "glass of a colour's reflectance",
            pbr(|p| {
                (p.specular, p.transmission, p.roughness, p.has_volume) =
                    (number(1.0), number(1.0), number(0.6), true);
                p.specular_color.factor = [3.0, 1.0, 0.0];
                p.anisotropy = anisotropy(0.4);
            }),
        ),
        (
            "film on glass of tinted reflection",
            PbrMaterial { iridescence: film(1.8, 400.0), ..colored(GlassReflection::Tinted, 0.5, true) },
        ),
        (
            "everything",
            pbr(|p| {
                (p.clearcoat, p.sheen, p.anisotropy) =
                    (coat(0.8, 0.3), sheen([0.5, 0.6, 0.7], 0.6), anisotropy(0.5));
                (p.iridescence, p.diffuse_transmission) = (film(1.3, 500.0), through(0.5, [1.0, 0.9, 0.8]));
                (p.transmission, p.metallic, p.roughness, p.has_volume) =
                    (number(0.5), number(0.3), number(0.6), true);
            }),
        ),
    ]
}

#[test]
fn layers_need_their_class() {
    use oscura::bsdf::BsdfClass;
    for (name, material) in layers() {
        let model = Model::Pbr(Box::new(material.clone()));
        let class = BsdfProgram::of(&model, ShadingModel::default()).class();
        let expected = match name {
            "anisotropic glass" | "anisotropic glass of high index" => BsdfClass::RoughDielectric,
            _ => BsdfClass::Layered,
        };
        assert_eq!(class, expected, "{name}");
        let is_layered = matches!(resolved(material), Bsdf::Layered(_));
        assert_eq!(is_layered, expected == BsdfClass::Layered, "{name}");
    }
}

/// Smooth glass is classified as such, and thin glass as transparent to shadow rays, with any reflection tint.
#[test]
fn tinted_smooth_glass_is_classified_as_smooth() {
    for reflection in [GlassReflection::White, GlassReflection::Tinted, GlassReflection::None] {
        for (roughness, has_volume) in [(0.0, true), (0.0, false), (0.4, true), (0.4, false)] {
            let model = Model::Pbr(Box::new(colored(reflection, roughness, has_volume)));
            let program = BsdfProgram::of(&model, ShadingModel::default());
            let what = format!("{reflection:?} {roughness} {has_volume}");
            assert_eq!(program.is_smooth_glass(), roughness == 0.0, "{what}");
            assert_eq!(program.may_transmit_unscattered(), roughness == 0.0 && !has_volume, "{what}");
            let bsdf = program.evaluate(&Factors, &LocalFrame::DEFAULT);
            assert_eq!(bsdf.is_specular(), roughness == 0.0, "{what}");
            let reflected = bsdf.appearance().glossy.to_array();
            let factor = match reflection {
                GlassReflection::White => [1.0; 3],
                GlassReflection::Tinted => [0.9, 0.5, 0.1],
                GlassReflection::None => [0.0; 3],
            };
            for c in 0..3 {
                assert!((reflected[c] - 0.04 * factor[c]).abs() < 1e-6, "{what}: {reflected:?}");
            }
        }
    }
}
