//! Vectorised shading of textured hits, which vertex colours disable: both code paths give the same picture, and the same AOVs.

use crate::support::sheet::{Variant, scene};
use crate::support::{options, picture};
use oscura::film::{Aov, Film, Values};
use oscura::scene::Interpolation;

#[test]
fn vectorised_and_scalar_shading_agree() {
    let kinds = [Interpolation::Trilinear, Interpolation::Bilinear];
    let options = options(24, 16, 1).aovs([Aov::Depth, Aov::Normal, Aov::Albedo]);
    let planes =
        |film: &Film| film.planes().map(|plane| plane.values).map(Values::into_floats).collect::<Vec<_>>();
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
        let (a, b) = (planes(&a), planes(&b));
        assert_eq!(a.len(), 4 + 1 + 3 + 3);
        let pairs = a.iter().flatten().zip(b.iter().flatten());
        let worst = pairs.map(|(x, y)| (x - y).abs() / (0.1 + x.abs())).fold(0.0, f32::max);
        let brightest = a[0].iter().copied().fold(0.0, f32::max);
        assert!(brightest > 0.2, "{variant:?}: there is something to see");
        // One of a pixel's samples may take another path by rounding.
        assert!(worst < 2e-3, "{variant:?}: {worst}");
    }
}
