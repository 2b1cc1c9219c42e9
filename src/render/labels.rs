//! What files call things of the scene: groups of lights, and objects and materials in mattes.

use super::options::RenderOptions;
use crate::compile::ObjectId;
use crate::film::{Aov, MatteIds, matte_id};
use crate::output::Matte;
use crate::scene::Scene;

/// Names and ids that a picture asks for; others are left out.
#[derive(Clone, Debug, Default)]
pub struct Labels {
    /// The scene's groups of lights.
    pub light_groups: Vec<String>,
    /// The ids that mattes show.
    pub ids: MatteIds,
    /// What the header says about each matte.
    pub mattes: Vec<Matte>,
}

impl Labels {
    /// Those of a scene that a picture with these options asks for.
    pub fn of(scene: &Scene, options: &RenderOptions) -> Labels {
        let mut labels = Labels::default();
        if options.light_groups {
            labels.light_groups = scene.light_groups();
        }
        for (aov, kind) in options.aovs.mattes() {
            let names = match aov {
                Aov::CryptoObject => object_names(scene, &mut labels.ids.objects, object_name),
                Aov::CryptoAsset => object_names(scene, &mut labels.ids.assets, asset_name),
                _ => {
                    labels.ids.materials = scene.materials.iter().map(|m| matte_id(&m.name)).collect();
                    scene.materials.iter().map(|m| m.name.clone()).collect()
                }
            };
            labels.mattes.push(Matte::new(kind, names));
        }
        labels
    }
}

/// The names of all objects, as one part of the path there says; and their ids.
fn object_names(scene: &Scene, ids: &mut Vec<u32>, part: fn(&str) -> &str) -> Vec<String> {
    let paths = ObjectId::all(scene).map(|object| object.name(scene).unwrap_or_default());
    let names: Vec<String> = paths.map(|path| part(path).to_string()).collect();
    *ids = names.iter().map(|name| matte_id(name)).collect();
    names
}

/// An object without those above it. What a sequence of copies is called by number keeps the name that they have in common.
fn object_name(path: &str) -> &str {
    let parts = || path.rsplit('/');
    let is_number = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    parts().find(|part| !is_number(part)).unwrap_or(path)
}

/// What stands above all of an object's parents.
fn asset_name(path: &str) -> &str {
    path.split('/').next().unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_have_objects_and_assets() {
        assert_eq!((object_name("car/wheel/tyre"), asset_name("car/wheel/tyre")), ("tyre", "car"));
        assert_eq!((object_name("field/tree/12"), asset_name("field/tree/12")), ("tree", "field"));
        assert_eq!((object_name("7"), asset_name("lamp")), ("7", "lamp"));
    }
}
