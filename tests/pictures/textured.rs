//! Textured vertices are made in vectorised loops, except where vertices have colours: both ways give the same picture,
//! and the same AOVs.

use crate::support::sheet::{Variant, scene};
use crate::support::{options, picture};
use oscura::film::AovSet;
use oscura::render::RenderOptions;
use oscura::scene::Interpolation;

#[test]
fn both_ways_of_making_vertices_agree() {
    let kinds = [Interpolation::Trilinear, Interpolation::Bilinear];
    let all = AovSet { depth: true, normal: true, albedo: true };
    let options = RenderOptions { aovs: all, ..options(24, 16, 1) };
    for bits in 0..32u32 {
        let is = |bit: u32| bits >> bit & 1 == 1;
        let variant = Variant {
            colored: false,
            smooth: is(0),
            tangents: is(1),
            mirrored: is(2),
            from_behind: is(3),
            interpolation: kinds[usize::from(is(4))],
        };
        let a = picture(&scene(&variant), &options);
        let b = picture(&scene(&Variant { colored: true, ..variant }), &options);
        let (mut worst, mut brightest) = (0.0f32, 0.0f32);
        let mut compare = |x: f32, y: f32| worst = worst.max((x - y).abs() / (0.1 + x.abs()));
        for (x, y) in (0..24 * 24).map(|i| (i % 24, i / 24)) {
            let (p, q) = (a.mean_rgba(x, y), b.mean_rgba(x, y));
            (0..4).for_each(|c| compare(p[c], q[c]));
            for (p, q) in [(a.normal(x, y), b.normal(x, y)), (a.albedo(x, y), b.albedo(x, y))] {
                let (p, q) = (p.unwrap_or_default(), q.unwrap_or_default());
                (0..3).for_each(|c| compare(p[c], q[c]));
            }
            compare(a.depth(x, y).unwrap_or(0.0), b.depth(x, y).unwrap_or(0.0));
            brightest = brightest.max(a.mean_rgba(x, y)[0]);
        }
        assert!(brightest > 0.2, "{variant:?}: there is something to see");
        // One of the samples of a pixel may take another way on account of rounding.
        assert!(worst < 2e-3, "{variant:?}: {worst}");
    }
}
