//! The picture that a comment of a PLY file names.

use crate::error::Warning;
use crate::load::image::{self, Use};
use crate::load::obj::find_file;
use crate::load::{LoadOptions, Loaded};
use crate::scene::{ColorSlot, Interpolation, Mapping, Model, Texture, Wrap};
use std::path::Path;

/// Gives the mesh's material the picture, if there is one and the vertices have texture coordinates; says why not.
pub(super) fn add(path: &Path, files: &[String], options: &LoadOptions, loaded: &mut Loaded) {
    let Some(name) = files.first().filter(|_| !options.geometry_only) else { return };
    for further in &files[1..] {
        loaded.warnings.push(Warning::new(
            path,
            "",
            format!("the texture '{further}' of a comment: left out"),
        ));
    }
    if let Err(why) = try_add(path, name, options, loaded) {
        loaded.warnings.push(Warning::new(
            path,
            "",
            format!("the texture '{name}' of a comment: left out, {why}"),
        ));
    }
}

fn try_add(path: &Path, name: &str, options: &LoadOptions, loaded: &mut Loaded) -> Result<(), String> {
    if loaded.scene.meshes.first().is_none_or(|mesh| mesh.uv_sets.is_empty()) {
        return Err("since the vertices have no texture coordinates".into());
    }
    let file = find_file(path, name, options)?;
    let image = image::read(&file, Use::Color, &mut loaded.warnings).map_err(|error| {
        let messages: Vec<String> = error.problems.iter().map(|p| p.message.clone()).collect();
        format!("since it {}", messages.join("; "))
    })?;
    let image = loaded.scene.add_image(image);
    let texture = loaded.scene.add_texture(Texture::Image {
        image,
        wrap_u: Wrap::default(),
        wrap_v: Wrap::default(),
        interpolation: Interpolation::default(),
        mapping: Mapping::default(),
    });
    if let Some(material) = loaded.scene.materials.first_mut() {
        material.model = Model::Lambert { albedo: ColorSlot::texture(texture) };
    }
    Ok(())
}
