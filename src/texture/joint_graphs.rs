//! Node graphs that are evaluated together: all graphs that a material reads at a hit, for several hits at a time.

use super::nodes::Program;
use super::{Compiled, CompiledTextures, GRAPH_LANES, HitData, PointReader, TexturePoint};
use crate::scene::TextureId;
use crate::scene::nodes::NodeGraph;
use std::sync::Arc;

/// Node graphs compiled to one program, in which common parts are evaluated once.
#[derive(Clone, Debug)]
pub struct JointGraphs {
    /// The textures that are these graphs.
    pub textures: Arc<[TextureId]>,
    /// No other texture of the list reads hit data.
    pub is_complete: bool,
    program: Arc<Program>,
}

impl CompiledTextures {
    /// Joins the node graphs among the textures; `None` if there are none. Graphs whose up axis differs from the first one's are left out.
    pub fn join_graphs(&self, textures: impl IntoIterator<Item = TextureId>) -> Option<JointGraphs> {
        let (mut joined, mut is_complete) = (Vec::new(), true);
        let mut graphs: Vec<&NodeGraph> = Vec::new();
        let mut alone = None;
        for texture in textures {
            let Some(Compiled::Nodes(program, graph)) = self.textures.get(texture.index()) else {
                is_complete &= !self.reads_hit(texture);
                continue;
            };
            if joined.contains(&texture) {
                continue;
            }
            let has_same_axis = graphs.first().is_none_or(|first| first.is_z_up == graph.is_z_up);
            if !has_same_axis {
                is_complete = false;
                continue;
            }
            joined.push(texture);
            graphs.push(graph);
            alone = Some(program).filter(|_| graphs.len() == 1);
        }
        let program = match alone {
            Some(program) => program.clone(),
            None if graphs.is_empty() => return None,
            None => Arc::new(Program::of_graphs(&graphs, &self.attributes)),
        };
        Some(JointGraphs { textures: joined.into(), is_complete, program })
    }
}

impl JointGraphs {
    /// A result as a vector in the scene's world space.
    pub fn as_vector(&self, result: [f32; 3]) -> [f32; 3] {
        self.program.as_vector(result)
    }

    /// Appends the results of all graphs at up to [`GRAPH_LANES`] points, those of a point together.
    pub fn evaluate(
        &self,
        textures: &CompiledTextures,
        points: &[TexturePoint],
        hits: &[Option<&HitData<'_>>],
        results: &mut Vec<[f32; 3]>,
    ) {
        let reader = |lane: usize| PointReader::new(textures, points[lane]).with_hit(hits[lane]);
        let mut in_scene = [TexturePoint::default(); GRAPH_LANES];
        for (to, point) in in_scene.iter_mut().zip(points) {
            *to = textures.scene_point(point);
        }
        self.program.at_points(
            (&in_scene[..points.len()], hits),
            &|texture, lane| reader(lane).look_up(texture),
            &|texture, sampling, uv, footprint| textures.image_of_node(texture, sampling, uv, footprint),
            results,
        );
    }
}
