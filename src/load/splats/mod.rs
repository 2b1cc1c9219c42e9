//! Gaussian splats of files: what all formats share. Splats that are damaged or invisible are left out or repaired, with counts.

pub mod spz;

use super::mesh_tools::{self, NAMELESS};
use super::{Loaded, Up, UpHint};
use crate::error::{Error, Problem, Result, Warning};
use crate::math::{DAffine3, DVec3, Quat, Vec3, poly};
use crate::scene::{
    ColorSlot, Emission, Instance, Material, MaterialId, Mesh, MeshId, MeshPart, Model, Splats,
};
use half::f16;
use std::path::Path;
use std::sync::Arc;

/// Minimum ratio of the shortest to the longest axis of a splat: flatter ones exceed single precision.
const MIN_AXIS_RATIO: f32 = 1e-4;

/// A splat as a file has it, in linear scale and opacity.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileSplat<'a> {
    pub center: DVec3,
    /// Standard deviations along its axes.
    pub scales: [f32; 3],
    /// Quaternion x, y, z, w of any length.
    pub rotation: [f32; 4],
    /// 0 to 1.
    pub opacity: f32,
    /// RGB coefficients of spherical harmonics; as many as the degree asks for.
    pub coefficients: &'a [[f32; 3]],
}

/// Splats that are gathered.
#[derive(Default)]
pub(super) struct SplatList {
    /// Relative to the origin.
    centers: Vec<[f32; 3]>,
    splats: Splats,
    /// Where the file has the origin.
    origin: DVec3,
    not_finite: usize,
    invisible: usize,
    flat: usize,
    unturned: usize,
}

impl SplatList {
    /// An empty list with capacity for `count`.
    ///
    /// # Errors
    /// If there is not enough memory.
    pub fn new(count: usize, degree: u8, origin: DVec3) -> std::result::Result<SplatList, Problem> {
        let mut list = SplatList { origin, ..SplatList::default() };
        list.splats.degree = degree;
        let coefficients = count.saturating_mul(Splats::coefficients_of(degree));
        let reserved = list.centers.try_reserve_exact(count).is_ok()
            && list.splats.scales.try_reserve_exact(count).is_ok()
            && list.splats.rotations.try_reserve_exact(count).is_ok()
            && list.splats.opacities.try_reserve_exact(count).is_ok()
            && list.splats.coefficients.try_reserve_exact(coefficients).is_ok();
        match reserved {
            true => Ok(list),
            false => Err(Problem::new("", format!("there is no memory for {count} splats"))),
        }
    }

    /// Adds a splat, if anything of it can be seen.
    pub fn push(&mut self, splat: &FileSplat<'_>) {
        let FileSplat { center, scales, rotation, opacity, coefficients } = splat;
        let center = (*center - self.origin).as_vec3();
        let are_finite = scales.iter().chain(rotation).chain([opacity]).all(|x| x.is_finite());
        let has_color = coefficients.as_flattened().iter().all(|c| c.is_finite());
        let longest = Vec3::from_array(*scales).abs().max_element();
        if !(center.is_finite() && are_finite && has_color) {
            self.not_finite += 1;
            return;
        }
        if *opacity < Splats::MIN_OPACITY || longest <= f32::MIN_POSITIVE {
            self.invisible += 1;
            return;
        }
        let least = longest * MIN_AXIS_RATIO;
        self.flat += usize::from(scales.iter().any(|scale| scale.abs() < least));
        let turned = Quat::from_array(*rotation);
        let length = turned.length();
        // An overflow of the squares counts as none.
        let is_turned = length > 0.0 && length.is_finite();
        self.unturned += usize::from(!is_turned);
        let rotation = if is_turned { turned / length } else { Quat::IDENTITY };
        self.centers.push(center.to_array());
        self.splats.scales.push(scales.map(|scale| scale.abs().max(least)));
        self.splats.rotations.push(rotation.to_array());
        self.splats.opacities.push(opacity.min(1.0));
        let limit = f16::MAX.to_f32();
        let half = |c: &[f32; 3]| c.map(|x| f16::from_f32(x.clamp(-limit, limit)));
        self.splats.coefficients.extend(coefficients.iter().map(half));
    }

    /// The colours are linear.
    pub fn set_linear(&mut self, is_linear: bool) {
        self.splats.is_linear = is_linear;
    }

    /// Messages about what was left out or repaired, and about invisible splats.
    pub fn messages(&self) -> (Vec<(&'static str, String)>, Option<String>) {
        let mut messages = Vec::new();
        let mut add = |count: usize, code: &'static str, what: &str| {
            if count > 0 {
                messages.push((code, format!("{count} splats {what}")));
            }
        };
        add(self.not_finite, "splats-not-finite", "with numbers that are not finite were left out");
        add(self.unturned, "splats-not-rotated", "with a zero quaternion are not rotated");
        let faint = (self.invisible > 0)
            .then(|| format!("{} splats without size or of an opacity below 1/255", self.invisible));
        (messages, faint)
    }

    /// The centers.
    pub fn centers(&self) -> &[[f32; 3]] {
        &self.centers
    }

    /// Are there no visible splats?
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// The mesh of all, with a material.
    pub fn into_mesh(self, name: &str, material: MaterialId) -> Mesh {
        let part = MeshPart { first_triangle: 0, triangle_count: 0, material };
        Mesh {
            name: name.to_string(),
            positions: self.centers,
            splats: Some(Arc::new(self.splats)),
            parts: vec![part],
            ..Mesh::default()
        }
    }
}

/// The material of splats: they emit their colours and scatter nothing.
pub(super) fn material() -> Material {
    let radiance = ColorSlot::constant([1.0; 3]);
    Material {
        emission: Some(Emission { radiance, two_sided: true }),
        use_vertex_colors: true,
        ..Material::new("splats", Model::Black)
    }
}

/// The scene of a file that holds splats alone, whose `up` axis its format has by custom.
pub(super) fn finish(path: &Path, list: SplatList, up: (Up, &'static str)) -> Result<Loaded> {
    let mut loaded = Loaded::default();
    let (messages, faint) = list.messages();
    loaded.warnings.extend(messages.into_iter().map(|what| Warning::new(path, "", what)));
    loaded.left_out.extend(faint);
    if list.is_empty() {
        return Err(Error::input(path, ("splats-invisible", "holds no splats that can be seen")));
    }
    u32::try_from(list.centers.len())
        .map_err(|_| Error::input(path, "has more than 4,294,967,295 splats"))?;
    let origin = list.origin;
    loaded.scene.materials.push(material());
    loaded.scene.meshes.push(list.into_mesh("splats", MaterialId(0)));
    let instance = Instance { name: NAMELESS.to_string(), ..Instance::new(MeshId(0), DAffine3::IDENTITY) };
    loaded.scene.instances.push(instance);
    mesh_tools::place_at_origin(path, origin, &mut loaded);
    loaded.up_hint = UpHint { writer: Some(up), is_mostly_y: true };
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(loaded)
}

/// The opacity of a logit.
pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// e to the power x, the same bits on all CPUs: infinite or 0 beyond what single precision holds.
pub(super) fn exp(x: f32) -> f32 {
    match x {
        x if x > 88.0 => f32::INFINITY,
        x if x < -87.0 => 0.0,
        x => poly::exp(x),
    }
}
