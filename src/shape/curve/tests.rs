use super::{CurveSegment, CurveSegments};
use crate::accel::{Accel, Geometry};
use crate::math::{Hit, OriginPrimitive, Ray, Vec3, offset_ray_origin};
use crate::sampling::chi2::Random;

fn segment(a: Vec3, b: Vec3, radii: [f32; 2]) -> CurveSegment {
    CurveSegment { ends: [a, b], radii, tangents: [Vec3::ZERO; 2] }
}

/// The distance of a point from the surface, negative inside: by all spheres of a piece.
fn distance(s: &CurveSegment, p: Vec3) -> f64 {
    let at = |u: f64| {
        let [a, b] = s.ends.map(|e| e.as_dvec3());
        let [r, q] = s.radii.map(f64::from);
        p.as_dvec3().distance(a + (b - a) * u) - (r + (q - r) * u)
    };
    // It has one minimum in u.
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(a) < at(b) { high = b } else { low = a }
    }
    at(0.5 * (low + high))
}

fn cases() -> Vec<CurveSegment> {
    let (a, b) = (Vec3::new(0.3, -0.2, 0.1), Vec3::new(1.1, 0.7, -0.4));
    vec![
        segment(a, b, [0.2, 0.2]),
        segment(a, b, [0.3, 0.05]),
        segment(a, b, [0.0, 0.2]),
        segment(a, a + Vec3::X * 2.0, [0.1, 0.1]),
        segment(a, a, [0.3, 0.3]),
        segment(a, a, [0.1, 0.3]),
        segment(a, a + Vec3::Y * 0.1, [0.5, 0.2]),
        segment(a, a + Vec3::new(3.0, 4.0, 5.0), [1e-3, 2e-3]),
    ]
}

/// Rays meet a piece where it is and nothing of it before, and miss it only where nothing is; its box holds the place.
#[test]
fn rays_enter_where_the_surface_is() {
    let mut random = Random::new(5);
    for s in cases() {
        let (mut met, mut missed) = (0, 0);
        let size = s.radii[0].max(s.radii[1]);
        for _ in 0..4000 {
            let aim =
                s.ends[0].lerp(s.ends[1], random.next()) + random.direction() * (1.5 * size * random.next());
            let origin = aim + random.direction() * (6.0 * random.next() + 0.01);
            let ray = Ray::new(origin, (aim - origin).normalize());
            let nearest = (0..3000).map(|i| distance(&s, ray.at(i as f32 * 3e-3)));
            let hit = s.enter(ray.origin.to_array(), ray.direction.to_array()).filter(|hit| hit.t > 0.0);
            match hit {
                Some(hit) => {
                    met += 1;
                    let p = ray.at(hit.t as f32);
                    assert!(distance(&s, p).abs() < 3e-6, "{s:?} {ray:?}: {}", distance(&s, p));
                    let b = s.bounds();
                    assert!((p - b.min).min_element() > -3e-6 && (b.max - p).min_element() > -3e-6);
                    if distance(&s, origin) > 0.0 {
                        let before = ray.at(hit.t as f32 * random.next() * 0.999);
                        assert!(distance(&s, before) > -1e-6, "{s:?} {ray:?}");
                    }
                }
                None => {
                    missed += 1;
                    let inside = distance(&s, origin) < 1e-6;
                    assert!(inside || nearest.fold(f64::INFINITY, f64::min) > -1e-5, "{s:?} {ray:?}");
                }
            }
        }
        assert!(met > 200 && missed > 200, "{s:?}: {met} {missed}");
    }
}

/// A straight cylinder has the closed form of one.
#[test]
fn a_straight_piece_is_a_cylinder() {
    let s = segment(Vec3::new(-50.0, 0.0, 0.0), Vec3::new(50.0, 0.0, 0.0), [0.25, 0.25]);
    let mut random = Random::new(6);
    for _ in 0..20_000 {
        let y = 0.5 * (random.next() - 0.5);
        let d = Vec3::new(random.next() - 0.5, 0.0, -1.0).normalize();
        let origin = Vec3::new(0.0, y, 3.0);
        let expected = (3.0 - (0.0625 - f64::from(y).powi(2)).max(0.0).sqrt()) / f64::from(-d.z);
        let hit = s.enter(origin.to_array(), d.to_array()).expect("a hit");
        assert!((hit.t - expected).abs() < 1e-6, "{y} {d}: {} {expected}", hit.t);
        let surface = s.surface(origin, d);
        assert!(surface.ng.x.abs() < 1e-6 && (surface.ng.y - y * 4.0).abs() < 1e-5);
        assert!((f64::from(surface.p.x) - hit.t * f64::from(d.x)).abs() < 1e-5);
    }
}

/// A helix with pieces so and so short, as a geometry.
fn helix(pieces: usize, radius: f32, far: Vec3) -> Geometry {
    let mut curves = CurveSegments::default();
    for i in 0..=pieces {
        let t = i as f32 / pieces as f32 * 12.0;
        let p = far + Vec3::new(t.cos(), 0.3 * t, t.sin());
        curves.points.push([p.x, p.y, p.z, radius * (1.0 - 0.05 * t)]);
        let tangent = Vec3::new(-t.sin(), 0.3, t.cos()).normalize();
        curves.tangents.push(if i == 0 || i == pieces { [0.0; 3] } else { tangent.to_array() });
    }
    curves.segments = (0..pieces as u32).collect();
    Geometry { curves, ..Geometry::default() }
}

/// Through the axis of a chain of pieces no ray leaks, wherever it stands; all queries agree, and the tree is sound.
#[test]
fn no_ray_passes_between_pieces() {
    let mut random = Random::new(7);
    for far in [Vec3::ZERO, Vec3::new(1000.0, -2000.0, 500.0)] {
        for (pieces, radius) in [(60, 0.08), (400, 0.02), (3000, 0.004)] {
            let geometry = helix(pieces, radius, far);
            let accel = Accel::build(std::slice::from_ref(&geometry), &[]);
            accel.validate().expect("a sound tree");
            assert_eq!(accel.stats().curves, pieces as u64);
            let rays: Vec<Ray> = (0..4000)
                .map(|_| {
                    let s = geometry.curves.get((random.next() * pieces as f32) as usize % pieces);
                    // On and about the joints.
                    let aim = s.ends[0] + random.direction() * (0.3 * s.radii[0] * random.next());
                    let origin = aim + random.direction() * 5.0;
                    Ray::new(origin, aim - origin)
                })
                .collect();
            let mut hits = vec![Hit::MISS; rays.len()];
            let mut occluded = vec![false; rays.len()];
            accel.closest(&rays, &mut hits);
            accel.occluded(&rays, &mut occluded);
            for ((ray, hit), occluded) in rays.iter().zip(&hits).zip(&occluded) {
                assert!(hit.is_hit() && *occluded, "{ray:?}");
                let one = accel.closest_one(ray);
                assert_eq!(one, *hit);
                let s = geometry.curves.get(hit.prim as usize);
                let off = distance(&s, ray.at(hit.t)).abs();
                assert!(off < 3e-7 * f64::from(6.0 + far.length()), "{off}");
            }
        }
    }
}

/// Brute force finds the same hits as the tree.
#[test]
fn the_tree_finds_the_nearest_piece() {
    let geometry = helix(200, 0.1, Vec3::ZERO);
    let accel = Accel::build(std::slice::from_ref(&geometry), &[]);
    let mut random = Random::new(8);
    let (mut met, mut missed) = (0, 0);
    for _ in 0..5000 {
        let origin = random.direction() * 6.0;
        let ray = Ray::new(origin, (random.direction() * 2.0 + Vec3::Y * 1.8 - origin).normalize());
        let all = (0..200).filter_map(|i| {
            let hit = geometry.curves.get(i).enter(ray.origin.to_array(), ray.direction.to_array())?;
            (hit.t > 0.0).then_some(hit.t)
        });
        let nearest = all.fold(f64::INFINITY, f64::min);
        let hit = accel.closest_one(&ray);
        assert_eq!(hit.is_hit(), nearest < f64::INFINITY, "{ray:?}");
        if hit.is_hit() {
            met += 1;
            assert!((f64::from(hit.t) - nearest).abs() < 2e-6 * nearest, "{hit:?} {nearest}");
        } else {
            missed += 1;
        }
    }
    assert!(met > 200 && missed > 200, "{met} {missed}");
}

/// The first place from which a ray that starts on or in a chain of pieces meets it from outside, by small steps; infinite if it
/// doesn't soon.
fn met_again(geometry: &Geometry, ray: &Ray, pieces: std::ops::Range<usize>) -> f32 {
    const STEP: f32 = 2e-3;
    let inside = |t: f32| {
        let p = ray.at(t);
        let near = pieces.clone().map(|i| geometry.curves.get(i)).filter(|s| {
            let b = s.bounds();
            (b.min - p).max(p - b.max).max_element() < 2e-3
        });
        near.map(|s| distance(&s, p)).fold(1.0, f64::min)
    };
    let mut was_outside = false;
    for i in 1..400 {
        let t = i as f32 * STEP;
        let d = inside(t);
        if was_outside && d < 0.0 {
            return t;
        }
        was_outside |= d > 1e-3;
    }
    f32::INFINITY
}

/// What goes into a curve leaves it unseen, also through the joints of its pieces; what leaves it may meet it again where it bends.
#[test]
fn the_inside_of_a_curve_is_unseen() {
    let mut random = Random::new(9);
    for (far, pieces, radius) in
        [(Vec3::ZERO, 400, 0.05), (Vec3::ZERO, 90, 0.3), (Vec3::new(100.0, 300.0, -200.0), 90, 0.2)]
    {
        let geometry = helix(pieces, radius, far);
        let accel = Accel::build(std::slice::from_ref(&geometry), &[]);
        let (mut wrong, mut again, mut all) = (0, 0, 0);
        for _ in 0..1500 {
            let index = pieces / 4 + (random.next() * 0.4 * pieces as f32) as usize;
            let s = geometry.curves.get(index);
            let origin = s.ends[0] + random.direction() * 1.5 * radius;
            let ray = Ray::new(origin, (s.ends[0] + random.direction() * 0.8 * radius - origin).normalize());
            let hit = accel.closest_one(&ray);
            if !hit.is_hit() {
                continue;
            }
            let surface = geometry.curves.get(hit.prim as usize).surface(ray.origin, ray.direction);
            let direction = random.direction();
            let origin = offset_ray_origin(surface.p, surface.p_error, surface.ng, direction);
            let next = Ray { origin_primitive: OriginPrimitive::from(&hit), ..Ray::new(origin, direction) };
            let found = accel.closest_one(&next).t;
            let near = index.saturating_sub(pieces / 5)..(index + pieces / 5).min(pieces);
            let expected = met_again(&geometry, &next, near);
            all += 1;
            again += usize::from(expected < 0.7);
            let found = if found < 0.7 { found } else { f32::INFINITY };
            let expected = if expected < 0.7 { expected } else { f32::INFINITY };
            wrong += usize::from(found != expected && (found - expected).abs() > 0.02);
        }
        println!("{pieces} {radius}: {wrong} wrong, {again} met again of {all}");
        // What grazes the surface is told by rounding, or by steps.
        assert!(all > 700 && wrong * 100 < all, "{pieces} {radius}: {wrong} of {all}");
    }
}

#[test]
fn what_is_degenerate_is_left_out_or_met() {
    let odd = [
        [0.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0],
        [f32::NAN, 0.0, 0.0, 1.0],
        [1e30, 0.0, 0.0, 1.0],
        [5.0, 0.0, 0.0, 1e-30],
        [5.0, 0.0, 0.0, 1e-30],
        [6.0, 0.0, 0.0, -1.0],
        [7.0, 0.0, 0.0, 0.5],
        [7.0, 0.0, 0.0, 0.5],
        [1e17, 0.0, 0.0, 0.5],
    ];
    let curves =
        CurveSegments { points: odd.to_vec(), tangents: vec![[0.0; 3]; 10], segments: (0..9).collect() };
    let accel = Accel::build(&[Geometry { curves, ..Geometry::default() }], &[]);
    accel.validate().expect("a sound tree");
    let stats = accel.stats();
    assert_eq!((stats.curves, stats.dropped.degenerate, stats.dropped.not_finite), (3, 1, 5));
    let down = Ray::new(Vec3::new(7.0, 3.0, 0.0), -Vec3::Y);
    assert!((accel.closest_one(&down).t - 2.5).abs() < 1e-6);
    let far = Ray::new(Vec3::new(1e10, 3.0, 0.0), -Vec3::Y);
    assert!(accel.closest_one(&far).is_hit());
}
