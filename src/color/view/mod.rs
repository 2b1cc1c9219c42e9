//! From scene-referred light to what a display shows.

mod agx;
mod table;

use super::{luminance, srgb_from_linear};
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

pub use table::ViewTable;

/// How linear colours become those of a display.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum ViewTransform {
    /// The sRGB transfer function; what is above 1 is clipped.
    #[default]
    Srgb,
    /// A filmic curve that rolls highlights off: Narkowicz 2016, "ACES Filmic Tone Mapping Curve", with the 0.6
    /// exposure that its author gives for the original's brightness; then sRGB.
    Filmic,
    /// Blender's AgX.
    Agx,
    /// Blender's AgX with its look "Punchy".
    AgxPunchy,
    /// Khronos PBR Neutral (specification of 2024): colours below 0.8 stay as they are, highlights lose their colour.
    PbrNeutral,
    /// Stops of luminance from middle grey (0.18) as colours: blue below -4.5, then cyan, green, grey around 0, yellow, orange,
    /// red above 3.5; black below -10, white above 6.5.
    FalseColor,
    /// A power of 1 / 2.2; what is above 1 is clipped.
    Gamma,
    /// A table of a file.
    Table(Arc<ViewTable>),
}

impl ViewTransform {
    /// All that have names, with these and what they do.
    pub const NAMED: [(ViewTransform, &'static str, &'static str); 7] = [
        (ViewTransform::Srgb, "srgb", "As they are; what is above 1 is clipped"),
        (ViewTransform::Filmic, "filmic", "A filmic curve (Narkowicz 2016)"),
        (ViewTransform::Agx, "agx", "Blender's AgX"),
        (ViewTransform::AgxPunchy, "agx-punchy", "Blender's AgX with its look Punchy"),
        (ViewTransform::PbrNeutral, "pbr-neutral", "Khronos PBR Neutral: base colours stay"),
        (ViewTransform::FalseColor, "false-color", "Stops from middle grey as colours"),
        (ViewTransform::Gamma, "gamma", "A power of 1 / 2.2"),
    ];

    /// The one of a name.
    pub fn from_name(name: &str) -> Option<ViewTransform> {
        ViewTransform::NAMED.into_iter().find(|named| named.1 == name).map(|named| named.0)
    }

    /// Is this the name of a file with a table, rather than that of a view?
    pub fn is_file(name: &str) -> bool {
        let is_one =
            |ending: &std::ffi::OsStr| ["csp", "view"].iter().any(|known| ending.eq_ignore_ascii_case(known));
        Path::new(name).extension().is_some_and(is_one)
    }

    /// The one of the bytes of a file with a table (cinespace, `.csp`; or `.view`, of the exporter for Blender).
    ///
    /// # Errors
    /// Where they aren't such a table; of a text with the line.
    pub fn from_table(bytes: &[u8], path: &Path) -> Result<ViewTransform, String> {
        Ok(ViewTransform::Table(Arc::new(ViewTable::read(bytes, path)?)))
    }

    /// What users call it: a name, or the path of a file.
    pub fn name(&self) -> Cow<'static, str> {
        let named = ViewTransform::NAMED.into_iter().find(|named| named.0 == *self).map(|named| named.1);
        match self {
            ViewTransform::Table(table) => table.path().display().to_string().into(),
            _ => named.unwrap_or_default().into(),
        }
    }

    /// The display values in 0..1 of a linear colour.
    pub fn encode(&self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            ViewTransform::Srgb => rgb.map(srgb_from_linear),
            ViewTransform::Filmic => rgb.map(|v| srgb_from_linear(filmic(v))),
            ViewTransform::Agx => agx::display(rgb, false).map(|v| srgb_from_linear(v as f32)),
            ViewTransform::AgxPunchy => agx::display(rgb, true).map(|v| srgb_from_linear(v as f32)),
            ViewTransform::PbrNeutral => pbr_neutral(rgb).map(srgb_from_linear),
            ViewTransform::FalseColor => false_color(luminance(rgb)),
            ViewTransform::Gamma => rgb.map(|v| v.clamp(0.0, 1.0).powf(1.0 / 2.2)),
            ViewTransform::Table(table) => table.encode(rgb),
        }
    }
}

fn filmic(linear: f32) -> f32 {
    // The curve's limit for bright values is 2.51 / 2.43 > 1, and infinity / infinity no number.
    let x = if linear > 0.0 { 0.6 * linear.min(1e6) } else { 0.0 };
    x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
}

/// "Khronos PBR Neutral Tone Mapper", Khronos Group 2024, section "Tone Mapper".
fn pbr_neutral(rgb: [f32; 3]) -> [f32; 3] {
    /// Reflectance of dielectrics, which studio light adds to all colours.
    const F90: f32 = 0.04;
    const START: f32 = 0.8 - F90;
    const DESATURATION: f32 = 0.15;
    let rgb = rgb.map(|v| if v > 0.0 { v.min(1e6) } else { 0.0 });
    let least = rgb[0].min(rgb[1]).min(rgb[2]);
    let offset = if least < 2.0 * F90 { least - least * least / (4.0 * F90) } else { F90 };
    let rgb = rgb.map(|v| v - offset);
    let peak = rgb[0].max(rgb[1]).max(rgb[2]);
    if peak < START {
        return rgb;
    }
    let d = 1.0 - START;
    let pressed = 1.0 - d * d / (peak + d - START);
    let mix = 1.0 - 1.0 / (DESATURATION * (peak - pressed) + 1.0);
    rgb.map(|v| v * pressed / peak * (1.0 - mix) + pressed * mix)
}

/// Upper bounds in stops, and colours.
const BANDS: [(f32, [f32; 3]); 10] = [
    (-10.0, [0.0, 0.0, 0.0]),
    (-4.5, [0.1, 0.1, 0.7]),
    (-2.5, [0.0, 0.5, 0.8]),
    (-1.0, [0.0, 0.6, 0.3]),
    (-0.25, [0.35, 0.5, 0.35]),
    (0.25, [0.5, 0.5, 0.5]),
    (1.5, [0.75, 0.75, 0.3]),
    (3.5, [0.95, 0.6, 0.1]),
    (6.5, [0.8, 0.1, 0.1]),
    (f32::INFINITY, [1.0, 1.0, 1.0]),
];

fn false_color(luminance: f32) -> [f32; 3] {
    let stops = if luminance > 0.0 { (luminance / 0.18).log2() } else { f32::NEG_INFINITY };
    BANDS.iter().find(|(below, _)| stops < *below).map_or([1.0; 3], |(_, color)| *color)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(found: [f32; 3], expected: [f32; 3], most: f32) {
        let is_near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < most);
        assert!(is_near, "{found:?} where {expected:?} belongs");
    }

    /// Figures of Blender 5.0.1 (16-bit PNG by `Image.save_render`).
    #[test]
    fn agx_is_blenders() {
        let base = [
            ([0.18; 3], [0.4613, 0.4613, 0.4614]),
            ([1.0; 3], [0.771; 3]),
            ([0.02; 3], [0.125; 3]),
            ([16.0; 3], [0.9986; 3]),
            ([1.0, 0.0, 0.0], [0.858, 0.2241, 0.1292]),
            ([0.0, 1.0, 0.0], [0.4325, 0.7726, 0.3184]),
            ([0.5, 0.2, 0.1], [0.6833, 0.4793, 0.361]),
            ([8.0, 2.0, 0.5], [0.9919, 0.847, 0.781]),
            ([0.1, 0.3, 0.9], [0.4326, 0.5896, 0.7795]),
        ];
        base.iter().for_each(|(rgb, shown)| assert_near(ViewTransform::Agx.encode(*rgb), *shown, 0.004));
        assert_near(ViewTransform::Agx.encode([0.0, 0.0, 1.0]), [0.0791, 0.3376, 0.8215], 0.04);
        let punchy = [
            ([0.18; 3], [0.3463; 3]),
            ([1.0; 3], [0.6923; 3]),
            ([0.02; 3], [0.0395; 3]),
            ([16.0; 3], [0.977; 3]),
            ([0.5, 0.2, 0.1], [0.5677, 0.3626, 0.2455]),
            ([8.0, 2.0, 0.5], [0.9714, 0.7878, 0.7039]),
            ([0.1, 0.3, 0.9], [0.2869, 0.4788, 0.694]),
        ];
        punchy
            .iter()
            .for_each(|(rgb, shown)| assert_near(ViewTransform::AgxPunchy.encode(*rgb), *shown, 0.01));
    }

    /// What the specification promises: colours of dielectrics under white light come out as their base colour, and its
    /// formula worked out by hand for a highlight.
    #[test]
    fn pbr_neutral_keeps_base_colours() {
        assert_near(pbr_neutral([0.54, 0.34, 0.14]), [0.5, 0.3, 0.1], 1e-6);
        // Peak 3.96, pressed to 1 - 0.0576 / 3.44; 0.31 of it white.
        assert_near(pbr_neutral([4.0, 1.0, 1.0]), [0.983_256, 0.468_299, 0.468_299], 1e-4);
        assert_near(pbr_neutral([0.04; 3]), [0.01; 3], 1e-6);
    }

    #[test]
    fn bands_are_in_stops_from_middle_grey() {
        let shown = |stops: f32| ViewTransform::FalseColor.encode([0.18 * stops.exp2(); 3]);
        assert_eq!(shown(0.0), [0.5; 3]);
        assert_eq!((shown(-11.0), shown(7.0)), ([0.0; 3], [1.0; 3]));
        assert_eq!(shown(5.0), [0.8, 0.1, 0.1]);
        assert_eq!(ViewTransform::FalseColor.encode([0.0; 3]), [0.0; 3]);
    }

    #[test]
    fn all_views_stay_in_range() {
        use ViewTransform::*;
        for view in [Srgb, Filmic, Agx, AgxPunchy, PbrNeutral, FalseColor, Gamma] {
            for v in [-1.0, 0.0, 1e-9, 0.5, 1.0, 50.0, 1e30, f32::INFINITY, f32::NAN] {
                let shown = view.encode([v, 0.3, 1.0]);
                // NaN becomes 0 where numbers become bytes.
                assert!(
                    shown.iter().all(|c| c.is_nan() || (0.0..=1.0).contains(c)),
                    "{view:?} {v}: {shown:?}"
                );
            }
        }
    }
}
