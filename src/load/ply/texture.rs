//! The pictures that comments of a PLY file name.

use super::wedges::Run;
use crate::error::{Error, Warning};
use crate::image::Damage;
use crate::load::image::{self, Use};
use crate::load::obj::find_file;
use crate::load::{LoadOptions, Loaded};
use crate::scene::{ColorSlot, Interpolation, Mapping, Model, Texture, Wrap};
use std::path::Path;
use std::sync::Arc;

/// By material of the mesh: which of the files is on it, if any.
pub(super) fn numbers(runs: Option<&[Run]>, files: &[String]) -> Vec<Option<usize>> {
    match runs {
        None => vec![(!files.is_empty()).then_some(0)],
        Some(runs) => runs.iter().map(|run| usize::try_from(run.picture).ok()).collect(),
    }
}

/// Gives the mesh's materials their pictures, if there are any and the mesh has texture coordinates; says why not.
pub(super) fn add(
    path: &Path,
    files: &[String],
    numbers: &[Option<usize>],
    options: &LoadOptions,
    loaded: &mut Loaded,
) {
    if options.geometry_only {
        return;
    }
    for (number, name) in files.iter().enumerate() {
        let outcome = match numbers.iter().position(|n| *n == Some(number)) {
            // A mesh without triangles has no material.
            Some(material) => {
                try_add(path, name, material, options, loaded).map_err(|why| format!(", {why}"))
            }
            None => Err(String::new()),
        };
        if let Err(why) = outcome {
            loaded.warnings.push(Warning::new(path, "", left_out(name, &why)));
        }
    }
}

/// What is said of a texture that is left out.
fn left_out(name: &str, why: &str) -> String {
    format!("the texture '{name}' of a comment: left out{why}")
}

/// Why its image can't be read.
fn reason(error: Error) -> String {
    let messages: Vec<String> = error.problems.into_iter().map(|p| p.message).collect();
    format!("since it {}", messages.join("; "))
}

fn try_add(
    path: &Path,
    name: &str,
    material: usize,
    options: &LoadOptions,
    loaded: &mut Loaded,
) -> Result<(), String> {
    if loaded.scene.meshes.first().is_none_or(|mesh| mesh.uv_sets.is_empty()) {
        return Err("since the vertices have no texture coordinates".into());
    }
    let file = find_file(path, name, options)?;
    let (path, name) = (path.to_path_buf(), name.to_string());
    let on_damage = move |error| {
        Damage::LeftOut(Warning::new(&path, "", left_out(&name, &format!(", {}", reason(error)))))
    };
    let image = image::read_for_texture(&file, Use::Color, &mut loaded.warnings, Arc::new(on_damage));
    let image = image.map_err(reason)?;
    let image = loaded.scene.add_image(image);
    let texture = loaded.scene.add_texture(Texture::Image {
        image,
        wrap_u: Wrap::default(),
        wrap_v: Wrap::default(),
        interpolation: Interpolation::default(),
        mapping: Mapping::default(),
    });
    if let Some(material) = loaded.scene.materials.get_mut(material) {
        material.model = Model::Lambert { albedo: ColorSlot::texture(texture) };
    }
    Ok(())
}
