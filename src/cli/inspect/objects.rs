//! The objects of a scene as a tree: the names of instances are paths of nodes.

use super::facts::instance_materials;
use oscura::scene::{MaterialId, Scene};
use std::collections::HashMap;

/// Lines of the tree that are shown.
const MOST_LINES: usize = 400;

#[derive(Default)]
struct Node<'a> {
    name: &'a str,
    /// What is placed here.
    content: Vec<String>,
    children: Vec<usize>,
}

/// The tree of all objects, indented by two blanks a level.
pub fn tree(scene: &Scene) -> Vec<String> {
    let mut nodes: Vec<Node> = vec![Node::default()];
    let mut known: HashMap<(usize, &str), usize> = HashMap::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.index()];
        let materials: Vec<String> =
            instance_materials(scene, instance).into_iter().map(|m| material_name(scene, m)).collect();
        let content =
            format!("mesh '{}', {} triangles, {}", mesh.name, mesh.triangles.len(), materials.join(", "));
        insert(&mut nodes, &mut known, &instance.name, content);
    }
    for s in &scene.shapes {
        let content =
            format!("{} of radius {}, {}", s.kind.tag().name(), s.radius, material_name(scene, s.material));
        insert(&mut nodes, &mut known, &s.name, content);
    }
    for q in &scene.quads {
        let (u, v) = (q.edge_u.length(), q.edge_v.length());
        let content = format!("quad of {u:.4} x {v:.4} m, {}", material_name(scene, q.material));
        insert(&mut nodes, &mut known, &q.name, content);
    }
    for c in &scene.curves {
        let (strands, points) = (c.strands.len(), c.points.len());
        let material = material_name(scene, c.material);
        let content = format!("{strands} {} curves of {points} points, {material}", c.basis.name());
        insert(&mut nodes, &mut known, &c.name, content);
    }
    let mut lines = Vec::new();
    let mut stack: Vec<(usize, usize)> = nodes[0].children.iter().rev().map(|&c| (c, 0)).collect();
    while let Some((at, depth)) = stack.pop() {
        let node = &nodes[at];
        let name = if node.name.is_empty() { "(unnamed)" } else { node.name };
        lines.push(format!("{}{name}{}", "  ".repeat(depth), described(&node.content)));
        stack.extend(node.children.iter().rev().map(|&c| (c, depth + 1)));
    }
    if lines.len() > MOST_LINES {
        let more = lines.len() - MOST_LINES;
        lines.truncate(MOST_LINES);
        lines.push(format!("... and {more} more"));
    }
    lines
}

fn insert<'a>(
    nodes: &mut Vec<Node<'a>>,
    known: &mut HashMap<(usize, &'a str), usize>,
    path: &'a str,
    content: String,
) {
    let mut at = 0;
    for name in path.split('/') {
        let next = nodes.len();
        let child = *known.entry((at, name)).or_insert(next);
        if child == next {
            nodes.push(Node { name, ..Node::default() });
            nodes[at].children.push(child);
        }
        at = child;
    }
    nodes[at].content.push(content);
}

/// What a node places, in one line; the same things are counted.
fn described(content: &[String]) -> String {
    let Some(first) = content.first() else { return String::new() };
    if content.iter().all(|c| c == first) && content.len() > 1 {
        return format!(": {} times {first}", content.len());
    }
    let shown: Vec<&str> = content.iter().take(3).map(String::as_str).collect();
    let more = if content.len() > 3 { format!(" and {} more", content.len() - 3) } else { String::new() };
    format!(": {}{more}", shown.join("; "))
}

fn material_name(scene: &Scene, id: MaterialId) -> String {
    format!("'{}'", scene.materials[id.index()].name)
}
