use super::*;

/// What another program (Mitsuba 3.7's `sunsky`, from the same coefficients in double precision) gives for a sun in the
/// direction of the azimuth 0: turbidity, albedo, elevation, the angle to the zenith, the azimuth, radiance.
#[rustfmt::skip]
const SKIES: &[[f64; 8]] = &[
    [1.0, 0.0, 10.0, 0.0, 0.0, 0.7366, 1.5935, 2.8955],
    [1.0, 0.0, 10.0, 60.0, 0.0, 3.4118, 5.5761, 7.7758],
    [1.0, 0.0, 10.0, 80.0, 120.0, 6.0428, 8.5497, 9.1982],
    [3.0, 0.2, 45.0, 0.0, 0.0, 2.4143, 4.1849, 8.4824],
    [3.0, 0.2, 45.0, 60.0, 0.0, 16.6471, 20.4766, 25.7536],
    [2.5, 0.3, 45.0, 80.0, 120.0, 8.8691, 14.5642, 22.6139],
    [6.3, 0.8, 70.0, 0.0, 0.0, 18.8134, 20.9997, 26.4632],
    [6.3, 0.8, 70.0, 30.0, 200.0, 6.4053, 9.7559, 16.9940],
    [10.0, 0.1, 2.0, 60.0, 0.0, 4.6427, 3.0769, 2.0113],
    [10.0, 0.1, 2.0, 80.0, 120.0, 1.4403, 1.3485, 1.0799],
];

/// Irradiance across the sun's light in W/m2, integrated over the disk and the observer in Python from the
/// published spectral coefficients: turbidity, elevation.
const SUNS: &[(f64, f64, [f64; 3])] = &[
    (1.0, 90.0, [158.58489, 131.65459, 103.15235]),
    (2.0, 60.0, [155.30755, 127.37388, 97.25716]),
    (3.0, 10.0, [101.23522, 60.40515, 21.96447]),
    (5.0, 30.0, [127.08154, 96.81322, 64.55828]),
    (10.0, 3.0, [0.02515, 0.00432, 0.00013]),
];

fn sky(turbidity: f64, elevation: f64, albedo: f64) -> PhysicalSky {
    let sun_elevation_rad = elevation.to_radians();
    PhysicalSky { turbidity, sun_elevation_rad, ground_albedo: [albedo; 3], ..PhysicalSky::default() }
}

#[test]
fn the_sky_has_the_published_radiance() {
    for &[turbidity, albedo, elevation, zenith, azimuth, red, green, blue] in SKIES {
        let expected = [red, green, blue];
        let sky = sky(turbidity, elevation, albedo);
        let (sin, y) = f64::to_radians(zenith).sin_cos();
        let (x, z) = f64::to_radians(azimuth).sin_cos();
        let found = sky.radiance(DVec3::new(sin * x, y, -sin * z));
        for c in 0..3 {
            let error = (found[c] / expected[c] - 1.0).abs();
            assert!(error < 2e-4, "{sky:?} {zenith} {azimuth}: {found:?} {expected:?}");
        }
    }
}

#[test]
fn the_sun_has_the_published_irradiance() {
    for &(turbidity, elevation, expected) in SUNS {
        let found = sky(turbidity, elevation, 0.2).sun_irradiance();
        for c in 0..3 {
            let error = (found[c] - expected[c]).abs();
            assert!(error < 1e-4 * expected[c] + 1e-5, "{turbidity} {elevation}: {found:?} {expected:?}");
        }
    }
}

/// Daylight by measurement: 100 to 130 klx on level ground under a high sun, the sky a tenth to a fifth of it.
#[test]
fn sun_and_sky_are_as_bright_as_by_day() {
    let dome = Dome::new(&sky(2.5, 70.0, 0.2));
    let luminance = |c: [f64; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    let from_sky = 0.683 * luminance(irradiance(&dome.channels, dome.to_sun));
    let from_sun = 0.683 * luminance(dome.sun) * dome.to_sun.y;
    assert!((95.0..130.0).contains(&(from_sky + from_sun)), "{from_sky} {from_sun} klx");
    assert!((0.1..0.25).contains(&(from_sky / from_sun)), "{from_sky} {from_sun} klx");
}

#[test]
fn the_picture_is_the_sky_where_its_texels_say() {
    let sky = PhysicalSky { sun_azimuth_rad: 1.0, ..sky(2.0, 35.0, 0.4) };
    let picture = Dome::new(&sky).picture();
    for (column, row) in [(0, 0), (100, 200), (700, 255), (1023, 130)] {
        let azimuth = ((f64::from(column) + 0.5) / 1024.0 - 0.5) * 2.0 * PI;
        let (sin, y) = ((f64::from(row) + 0.5) / 512.0 * PI).sin_cos();
        let expected = sky.radiance(DVec3::new(sin * azimuth.cos(), y, sin * azimuth.sin()));
        let found = picture.rgba(column, row);
        (0..3).for_each(|c| assert!((f64::from(found[c]) / expected[c] - 1.0).abs() < 1e-5));
    }
    let ground = picture.rgba(3, 256);
    assert!((0..1024).all(|x| (256..512).all(|y| picture.rgba(x, y) == ground)));
}

#[test]
fn values_out_of_range_are_refused() {
    let changes: [fn(&mut PhysicalSky); 6] = [
        |s| s.turbidity = 0.9,
        |s| s.turbidity = f64::NAN,
        |s| s.sun_elevation_rad = -0.1,
        |s| s.ground_albedo[1] = 1.5,
        |s| s.sun_angle_rad = 0.0,
        |s| s.strength = -1.0,
    ];
    for change in changes {
        let mut sky = PhysicalSky::default();
        change(&mut sky);
        assert!(sky.add_to(&mut Scene::default()).is_err(), "{sky:?}");
    }
}
