//! Portals of nodes: `portal` in the `extras`, as Blender exports custom properties, is the width and height of a rectangle around the
//! node through which light of the environment comes in along -z.

use super::document::Document;
use super::nodes::Node;
use super::report::Report;
use crate::math::DVec3;
use crate::scene::Portal;
use serde_json::Value;

/// The portal of a node, if it is one.
pub(super) fn portal(doc: &Document, node: &Node, report: &mut Report) -> Option<Portal> {
    let raw = doc.json.pointer(&node.pointer())?;
    let value = raw.get("extras")?.get("portal")?;
    let at = format!("{}/extras/portal", node.pointer());
    let size = match value {
        Value::Bool(false) => return None,
        Value::Bool(true) => Some([1.0, 1.0]),
        Value::Array(list) => match list[..] {
            [ref width, ref height] => width.as_f64().zip(height.as_f64()).map(|(w, h)| [w, h]),
            _ => None,
        },
        _ => None,
    };
    let Some([width, height]) = size.filter(|size| size.iter().all(|s| *s > 0.0 && s.is_finite())) else {
        report.warn(at, "is neither true nor a width and a height above 0; ignored");
        return None;
    };
    let matrix = node.world_from_node;
    let [x, y] = [matrix.matrix3.x_axis * width, matrix.matrix3.y_axis * height];
    let (across, along) = (x.try_normalize(), y.try_normalize());
    let Some((across, along)) = across.zip(along).filter(|(a, b)| a.dot(*b).abs() < 1e-3) else {
        report.warn(at, "is flattened or sheared by the transform of its node; ignored");
        return None;
    };
    // Light comes in along -z, whatever the node mirrors.
    let inwards = -matrix.matrix3.z_axis;
    let (edge_u, edge_v): (DVec3, DVec3) =
        if across.cross(along).dot(inwards) > 0.0 { (x, y) } else { (y, x) };
    let name = raw.get("name").and_then(Value::as_str).unwrap_or("portal").to_string();
    Some(Portal { name, corner: matrix.translation - (x + y) / 2.0, edge_u, edge_v })
}
