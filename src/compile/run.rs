//! The way from a scene to a compiled one.

use super::blur;
use super::crowds;
use super::emitters::{self, Emitters};
use super::flat;
use super::geometry::Geometries;
use super::groups::LightGroups;
use super::inside_out;
use super::limits::{check, check_size};
use super::links::Links;
use super::material::CompiledMaterial;
use super::media;
use super::medium::Medium;
use super::moving_emitters;
use super::object_materials::{self, ObjectMaterials};
use super::plan::{self, Plan};
use super::reuse::{Geometry, Kept, Sources};
use super::scene::{CompileOptions, CompileReport, CompiledScene, Features};
use super::spectral;
use super::texture_needs;
use super::touching;
use super::uplift;
use super::vectors::Vectors;
use crate::accel::{Accel, BuildStats};
use crate::error::{Problem, Result, Warning};
use crate::light::{EnvironmentLight, LightMotions, Lights, PunctualLight};
use crate::math::DVec3;
use crate::scene::{RayKinds, Scene, ShadingModel};
use crate::texture::CompiledTextures;
use std::time::Instant;

/// Compiles a scene.
///
/// # Errors
/// An input error with all that [`Scene::validate`] finds, for an anchor that is not finite, or for a scene with more of
/// something than can be numbered or addressed.
pub fn compile(scene: &Scene, options: &CompileOptions) -> Result<(CompiledScene, CompileReport)> {
    check(scene.validate())?;
    if let Some(anchor) = options.anchor.filter(|anchor| !anchor.is_finite()) {
        check(vec![Problem::new("anchor", format!("is {anchor:?}, but must be finite"))])?;
    }
    compile_after(None, scene, options, false)
}

/// Compiles a scene without problems; as one moment of a sequence, whose earlier moment gives what it has in common with
/// this one.
pub(super) fn compile_after(
    earlier: Option<CompiledScene>,
    scene: &Scene,
    options: &CompileOptions,
    is_sequence: bool,
) -> Result<(CompiledScene, CompileReport)> {
    let (begin, mut report) = (Instant::now(), CompileReport::default());
    let anchor = options.anchor.unwrap_or_else(|| default_anchor(scene));
    let mut kept = earlier.map_or_else(Kept::default, |earlier| earlier.into_kept(scene));
    spectral::warn(scene, options.shading, &mut report.warnings);
    let mut textures = textures(kept.textures.take(), scene, (anchor, options), &mut report)?;
    let (warnings, left_out) = (&mut report.warnings, &mut report.left_out);
    let (materials, media, numbers) = materials(scene, (anchor, &mut textures), options.shading, warnings);
    let plan = plan::plan((scene, numbers), &materials, anchor, is_sequence, warnings, left_out);
    let inside_out = inside_out::find(scene, &materials, &mut report.warnings);
    let plan = Plan { keeps_uv: options.keeps_uv, inside_out, ..plan };
    check_size(scene, &plan)?;
    let Geometry { geometries, accel } =
        kept.geometry(scene, &materials, anchor, &plan, (options.tree, &options.gauge))?;
    report_accel(accel.stats(), &mut report, || flat::count(scene, &plan));
    let mut emitters = emitters::find(&geometries, &materials);
    moving_emitters::add(&mut emitters, &geometries, &materials);
    let light_spectra = spectral::of_lights(scene, &emitters, &geometries, &materials, options.shading);
    let light_groups = LightGroups::of((scene, &plan.numbers), &emitters, &geometries);
    let punctual = scene.lights.iter().map(|l| PunctualLight::new(l, anchor)).collect();
    let motions = LightMotions { area: emitters.moving.clone(), punctual: blur::lights(scene, anchor) };
    let sky = environment(scene, kept.environment.take(), anchor, &mut report.warnings);
    let lights = Lights::moving((emitters.lights.clone(), punctual), motions, sky, &textures);
    let (lights, links) = finished(scene, lights, (&emitters, &geometries, &materials), &textures)?;
    report.lights = lights.len() as u64;
    let light_kinds = object_materials::light_kinds(scene, &lights, (&emitters, &geometries, &materials));
    let caught_lights = object_materials::caught_lights(&emitters, &geometries, &materials);
    let features = features(scene, (&geometries, &accel, anchor), &materials, &textures, &media)
        .with_lights(!light_kinds.is_empty(), links.are_used());
    report.build_s = begin.elapsed().as_secs_f64();
    let compiled = CompiledScene {
        anchor,
        accel,
        geometries,
        materials,
        shading: options.shading,
        media,
        textures,
        lights,
        camera_environment: camera_environment(scene),
        light_groups,
        light_spectra,
        light_kinds,
        links,
        caught_lights,
        own_materials: scene.materials.len() as u32,
        originals: plan.numbers.originals(),
        features,
        emitters,
        vectors: Vectors::of(scene, anchor),
        sources: is_sequence.then(|| Sources::of(scene, &plan)),
    };
    report.memory = compiled.memory();
    Ok((compiled, report))
}

/// The lights with their links and the environment's sun, and without what fog hides.
fn finished(
    scene: &Scene,
    mut lights: Lights,
    surfaces: (&Emitters, &Geometries, &[CompiledMaterial]),
    textures: &CompiledTextures,
) -> Result<(Lights, Links)> {
    let links = Links::of(scene, &lights, surfaces);
    check(links.problems())?;
    if links.are_used() {
        let is_linked = |class: usize, light| links.reach(links.of_light(light), class as u32);
        lights.link(links.classes(), textures, is_linked);
    }
    scene.environment_sun.into_iter().for_each(|sun| lights.show_sun(sun));
    if scene.fog.as_ref().is_some_and(media::is_opaque_to_far_light) {
        lights.hide_far();
    }
    Ok((lights, links))
}

/// The textures; `kept` are those of an earlier moment, if they are the same.
fn textures(
    kept: Option<CompiledTextures>,
    scene: &Scene,
    (anchor, options): (DVec3, &CompileOptions),
    report: &mut CompileReport,
) -> Result<CompiledTextures> {
    let needs = texture_needs::of(scene, options);
    let textures = match kept {
        Some(textures) if textures.suit(&needs) => textures.moved(anchor.as_vec3()),
        earlier => {
            let (list, images) = (&scene.textures, &scene.images);
            let made = CompiledTextures::after(earlier, list, images, anchor.as_vec3(), needs);
            let (textures, mut said) = made?;
            report.warnings.append(&mut said.warnings);
            report.left_out.extend(said.left_out());
            report.textures = said;
            textures
        }
    };
    Ok(textures.with_profiles(&scene.profiles).with_spectra(&scene.textures, options.shading.spectral))
}

/// What cameras see of the environment, if that is another one.
fn camera_environment(scene: &Scene) -> Option<EnvironmentLight> {
    scene.camera_environment.as_ref().and_then(|seen| EnvironmentLight::new(seen, &scene.images, false))
}

/// The environment with its portals; `kept` is that of an earlier moment, if it is the same.
fn environment(
    scene: &Scene,
    kept: Option<Option<EnvironmentLight>>,
    anchor: DVec3,
    warnings: &mut Vec<Warning>,
) -> Option<EnvironmentLight> {
    let new = || EnvironmentLight::new(&scene.environment, &scene.images, true);
    let mut environment = kept.unwrap_or_else(new);
    match &mut environment {
        Some(environment) => {
            environment.set_portals(&scene.portals, anchor);
            environment.set_sampled(!scene.environment_unsampled);
        }
        None if scene.portals.is_empty() => {}
        None => {
            let message = "portals change nothing: there is no environment to come through them";
            warnings.push(Warning::general(message));
        }
    }
    environment
}

/// The materials, with the copies that objects have for themselves; the media of solids; and the numbers that objects have.
fn materials(
    scene: &Scene,
    (anchor, textures): (DVec3, &mut CompiledTextures),
    shading: ShadingModel,
    warnings: &mut Vec<Warning>,
) -> (Vec<CompiledMaterial>, Vec<Medium>, ObjectMaterials) {
    let replaced = media::without_bodies(scene, warnings);
    let replaced = scene.materials.iter().zip(&replaced).map(|(m, other)| other.as_ref().unwrap_or(m));
    let compiled = |m| match shading.spectral {
        true => CompiledMaterial::new(&uplift::with_spectra(m, textures), textures, shading),
        false => CompiledMaterial::new(m, textures, shading),
    };
    let mut materials: Vec<CompiledMaterial> = replaced.map(compiled).collect();
    let media = media::number(scene, anchor, &mut materials, shading.spectral, warnings);
    crowds::warn(scene, &materials, warnings);
    let numbers = ObjectMaterials::of(scene);
    numbers.extend(&mut materials);
    (materials, media, numbers)
}

fn features(
    scene: &Scene,
    (geometries, accel, anchor): (&Geometries, &Accel, DVec3),
    materials: &[CompiledMaterial],
    textures: &CompiledTextures,
    media: &[Medium],
) -> Features {
    let is_foggy = media.first().is_some_and(|m| m.scattering.is_some());
    let boundaries = materials.iter().any(|m| m.is_boundary && m.medium_index != 0);
    Features {
        alpha: materials.iter().any(CompiledMaterial::may_be_absent),
        normals: geometries.has_normals(),
        bent_normals: geometries.has_normals() || materials.iter().any(|m| m.normal_map.is_some()),
        footprints: textures.use_footprints(),
        media: media.len() > 1 || is_foggy,
        priorities: media.iter().skip(1).any(|m| m.priority != media[1].priority),
        scattering: boundaries || media.iter().any(|m| m.scattering.is_some()),
        boundaries,
        overlaps: boundaries && media.iter().filter(|m| m.adds_up).count() > 1,
        touching: touching::exists(scene, materials, (geometries, accel, anchor)),
        walks: media.iter().filter_map(|m| m.scattering.as_ref()).any(|s| !s.counts),
        environment_visible_to: scene.environment_visible_to,
        camera_environment: scene.camera_environment.is_some(),
        ray_kinds: materials
            .iter()
            .any(|m| !m.visible_to().contains(RayKinds::ALL.without(RayKinds::CAMERA))),
        catchers: materials.iter().any(|m| m.presence.is_some_and(|p| p.is_catcher)),
        links: false,
        holdouts: materials.iter().any(|m| m.presence.is_some_and(|p| p.is_holdout)),
        absorption: media.iter().any(|m| m.absorption.is_some()),
    }
}

fn default_anchor(scene: &Scene) -> DVec3 {
    scene.cameras.first().map_or(DVec3::ZERO, |camera| camera.world_from_camera.translation)
}

fn report_accel(stats: &BuildStats, report: &mut CompileReport, flat: impl Fn() -> u64) {
    (report.tree, report.bytes) = (stats.quality, stats.bytes);
    (report.triangles, report.quads, report.analytic) = (stats.triangles, stats.quads, stats.analytic);
    report.curves = stats.curves;
    let dropped = stats.dropped;
    let say = |list: &mut Vec<Warning>, count: u64, what: &str, with: &str| {
        let message = match count {
            0 => return,
            1 => format!("1 {what} {with} was dropped"),
            _ => format!("{count} {what}s {with} were dropped"),
        };
        list.push(Warning::general(message));
    };
    let far = "with coordinates that are not finite or beyond 1e18 m";
    say(&mut report.warnings, dropped.not_finite, "primitive", far);
    // The poles of spheres have such triangles, and nothing of them could be seen.
    let without_area = if dropped.degenerate > 0 { flat().min(dropped.degenerate) } else { 0 };
    say(&mut report.notes, without_area, "primitive", "without area");
    let lost = "too small for single precision so far from the camera or the middle of its mesh";
    say(&mut report.warnings, dropped.degenerate - without_area, "primitive", lost);
    say(&mut report.warnings, dropped.instances, "placement", "with singular transforms");
}
