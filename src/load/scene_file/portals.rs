//! `[[portals]]`: windows and other rectangles through which light of the environment is looked for from within a room. They are no
//! surfaces and change no light, only the noise of it: what comes through no portal is still found, with more noise. A picture
//! around the scene that is seen through a window is where they help most.
//!
//! | Key | Value |
//! |---|---|
//! | `name` | for reports |
//! | `center`, `target` or `direction`, `up`, `size` | where the middle is, the way light comes in, and width and height, as of an area light |
//! | `corner`, `u`, `v` | or a corner and the edges from there, at right angles; light comes in along u x v |
//!
//! Beside a model, `node = "NAME"` and `size` place one at an empty node, where light comes in along the node's -z: as Blender's area lights
//! that are portals. In glTF itself, `portal` in the `extras` of a node is its size, `[width, height]`, or true for 1 x 1.

use super::build::Build;
use super::fields::Fields;
use super::placement::{Placed, Placement, at_node, placed};
use crate::math::DVec3;
use crate::scene::Portal;

pub(super) fn read(build: &mut Build, root: &Fields) {
    for (i, fields) in root.tables("portals").iter().enumerate() {
        let name = fields.string("name").map_or(format!("portal {}", i + 1), |n| n.value.to_string());
        let portal = match fields.has("corner") {
            true => by_corner(fields),
            false => by_middle(build, fields),
        };
        fields.finish();
        if let Some([corner, edge_u, edge_v]) = portal {
            build.loaded.scene.portals.push(Portal { name, corner, edge_u, edge_v });
        }
    }
}

fn by_corner(fields: &Fields) -> Option<[DVec3; 3]> {
    let [corner, u, v] = ["corner", "u", "v"].map(|key| fields.require(key, fields.vector(key)));
    let (corner, u, v) = (corner?, u?, v?);
    let (across, along) = (u.value.try_normalize(), v.value.try_normalize());
    let cosine = across.zip(along).map(|(a, b)| a.dot(b).abs());
    match cosine {
        Some(cosine) if cosine < 1e-3 => Some([corner.value, u.value, v.value]),
        _ => {
            let message = "the edges 'u' and 'v' of a portal must be longer than 0 and at right angles";
            fields.problems.push_help(v.span, message, "take a rectangle that covers the window");
            None
        }
    }
}

fn by_middle(build: &mut Build, fields: &Fields) -> Option<[DVec3; 3]> {
    let size = fields.require("size", fields.numbers::<2>("size"));
    let placement = if fields.has("node") { at_node(build, fields) } else { placed(fields) };
    let Placed { now: Placement { center, direction, right, scale }, .. } = placement?;
    let size = size?;
    if size.value.iter().any(|s| *s <= 0.0) {
        fields.problems.push(size.span, "'size' of a portal must be above 0");
        return None;
    }
    let [width, height] = [size.value[0] * scale[0], size.value[1] * scale[1]];
    let (edge_u, edge_v) = (right * width, direction.cross(right) * height);
    Some([center - (edge_u + edge_v) / 2.0, edge_u, edge_v])
}
