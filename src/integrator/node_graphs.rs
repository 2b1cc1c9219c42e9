//! Evaluates the node graphs of materials for several hits at a time.

use super::Integrator;
use super::shading_geometry::{EvaluatedHit, HitGraphs, HitPoint};
use super::workspace::Workspace;
use crate::bsdf::BsdfClass;
use crate::compile::{CompiledMaterial, texture_point};
use crate::texture::{GRAPH_LANES, HitData, JointGraphs, TexturePoint};

impl Integrator<'_> {
    /// Evaluates the graphs of the hits that `is_needed` selects by index and material.
    pub(super) fn evaluate_graphs(
        &self,
        bounce: u32,
        w: &mut Workspace,
        is_needed: impl Fn(&Workspace, usize, &CompiledMaterial) -> bool,
    ) {
        let mut graphs = std::mem::take(&mut w.graphs);
        graphs.clear(w.hits.len());
        for (i, hit) in w.hits.iter().enumerate() {
            let number = w.materials[i];
            let material = &self.scene.materials[number as usize];
            if hit.is_hit() && material.graphs.is_some() && is_needed(w, i, material) {
                graphs.hits.push((number, i as u32));
            }
        }
        graphs.hits.sort_unstable();
        let hits = std::mem::take(&mut graphs.hits);
        for same_material in hits.chunk_by(|a, b| a.0 == b.0) {
            let Some(joint) = &self.scene.materials[same_material[0].0 as usize].graphs else { continue };
            for chunk in same_material.chunks(GRAPH_LANES) {
                self.evaluate_joint(bounce, joint, chunk, w, &mut graphs);
            }
        }
        w.graphs = HitGraphs { hits, ..graphs };
    }

    /// Adds the results of the graphs at up to [`GRAPH_LANES`] hits of a material.
    fn evaluate_joint(
        &self,
        bounce: u32,
        joint: &JointGraphs,
        chunk: &[(u32, u32)],
        w: &Workspace,
        graphs: &mut HitGraphs,
    ) {
        let mut points = [TexturePoint::default(); GRAPH_LANES];
        let mut data: [Option<HitData<'_>>; GRAPH_LANES] = [None; GRAPH_LANES];
        for (lane, i) in chunk.iter().map(|&(_, i)| i as usize).enumerate() {
            let at = self.vertex_point(bounce, i, w);
            let wo = -w.rays[i].direction;
            let coordinates = self.coordinates(&at);
            let width = w.arriving.footprints.width[i];
            points[lane] = texture_point(&coordinates, &at.surface, wo, width);
            data[lane] = self.hit_data(&at, &coordinates, wo);
            graphs.indices[i] = graphs.evaluated.len() as u32;
            let first_value = (graphs.values.len() + lane * joint.textures.len()) as u32;
            let HitPoint { surface, is_back, .. } = at;
            graphs.evaluated.push(EvaluatedHit { surface, is_back, coordinates, first_value });
        }
        let hits: [Option<&HitData<'_>>; GRAPH_LANES] = std::array::from_fn(|lane| data[lane].as_ref());
        let count = chunk.len();
        joint.evaluate(&self.scene.textures, &points[..count], &hits[..count], &mut graphs.values);
    }

    /// The hit point of ray `i` at which the material is evaluated.
    pub(super) fn vertex_point(&self, bounce: u32, i: usize, w: &Workspace) -> HitPoint<'_> {
        if let Some(&EvaluatedHit { surface, is_back, .. }) = w.graphs.at(i) {
            let material = &self.scene.materials[w.materials[i] as usize];
            let time = w.time(i);
            let path = self.origin_of_hit(bounce, i, w);
            return HitPoint { surface, hit: w.hits[i], material, is_back, time, path };
        }
        let mut at = self.hit_point(bounce, i, w);
        if at.material.class == BsdfClass::Hair {
            // Hair scatters in all directions around the fibre.
            at.surface.ng = at.surface.ns;
        }
        at
    }
}
