//! The pictures of the gallery, in order.

/// A picture.
pub struct Entry {
    /// Its scene, below `scenes/`.
    pub scene: &'static str,
    /// Its caption on the contact sheet.
    pub label: &'static str,
    /// What it shows.
    pub shows: &'static str,
    /// Render time of the thesis's renderer on one core, if given in the thesis, in seconds.
    pub thesis_s: Option<f64>,
}

impl Entry {
    /// The name of its files, without extension.
    pub fn name(&self) -> &'static str {
        let file = self.scene.rsplit('/').next().unwrap_or(self.scene);
        file.trim_end_matches(".toml")
    }
}

const fn entry(scene: &'static str, label: &'static str, shows: &'static str) -> Entry {
    Entry { scene, label, shows, thesis_s: None }
}

const HOUR: f64 = 3600.0;

/// All of them.
pub const ENTRIES: &[Entry] = &[
    entry("thesis/normals.toml", "normals", "a sphere with its normals as colours"),
    entry("thesis/edge-aliased.toml", "1 sample", "the sphere's edge without antialiasing"),
    entry("thesis/edge-antialiased.toml", "256 samples", "the sphere's edge with antialiasing"),
    entry("thesis/defocus-out.toml", "out of focus", "the subject 5 m before the plane in focus"),
    entry("thesis/defocus-in.toml", "in focus", "the subject in focus"),
    entry("thesis/triangles-in-a-cube.toml", "triangles", "triangles in a cube: soft shadows, tinted walls"),
    entry("thesis/quads-in-a-cube.toml", "quads", "quads in a cube: soft shadows, tinted walls"),
    entry("thesis/parallelepiped.toml", "parallelepipeds", "sheared and turned boxes"),
    entry("thesis/pyramid.toml", "pyramid", "a square pyramid of four colours, all of them by two mirrors"),
    entry("thesis/lambert.toml", "colour bleeding", "a white ball takes the floor's colours at its foot"),
    entry("thesis/metals.toml", "metals", "fuzzy metal, Lambertian, shiny metal"),
    entry("thesis/glass.toml", "hollow, solid glass", "the solid ball turns the world upside down"),
    entry(
        "thesis/glass-light-behind.toml",
        "light behind camera",
        "reflections in glass, light gathered behind it",
    ),
    entry("thesis/emissive-quad.toml", "shining quad", "a soft shadow that widens with distance"),
    entry("thesis/fuzzy-metal-lights.toml", "fuzzy metal, lights", "soft reflections of a ball and a quad"),
    entry("thesis/mirror-ball.toml", "mirror ball", "the ring of light under a mirror ball"),
    entry("thesis/far-emitter.toml", "far light", "nearly sharp shadows on ground and wall"),
    entry("thesis/world-map.toml", "world map", "a picture around a ball"),
    entry("thesis/checker-pyramid.toml", "checker", "a checker in space on a pyramid"),
    entry("thesis/perlin.toml", "noise", "plain noise, turbulence, marble"),
    Entry {
        thesis_s: Some(HOUR),
        ..entry("thesis/cornell-box.toml", "Cornell box", "1000 x 1000 pixels, 500 samples, depth 100")
    },
    entry("thesis/random-spheres.toml", "random spheres", "checker floor, water, metal, an open lens"),
    Entry {
        thesis_s: Some(8.0 * HOUR),
        ..entry("thesis/final-scene.toml", "everything", "every component of the thesis in one picture")
    },
    entry("million-triangles.toml", "4 x a million", "a mesh of a million triangles, placed four times"),
    entry("plastics.toml", "Phong above GGX", "Phong's plastics at the back, microfacets in front"),
    entry("triplanar.toml", "tri-planar", "a picture on a mesh without texture coordinates"),
    entry("many-lights.toml", "300 lamps", "many small lights"),
    entry("materials.toml", "materials", "the materials of scene files"),
];

/// Media, motion, spectral rendering and skies, which have a separate contact sheet.
pub const PHYSICS: &[Entry] = &[
    entry("lamp-in-fog.toml", "lamps in fog", "light that single and multiple scattering carry"),
    entry("smoke.toml", "smoke", "a grid of densities under a low sun"),
    entry("cloud.toml", "cloud", "a grid of OpenVDB, hundreds of bounces"),
    entry("fire.toml", "fire", "a grid of temperatures that shines as a black body"),
    entry("wax.toml", "wax, jade, marble", "walks within solids, lit from behind"),
    entry("flying-balls.toml", "flying balls", "motion blur of balls, a wheel and a lamp"),
    entry("prism.toml", "prism", "dispersion by wavelength"),
    entry("cornell-spectra.toml", "by wavelength", "the Cornell box by its measured spectra"),
    entry("cornell-quads.toml", "by R, G and B", "the same box in red, green and blue"),
    entry("hills.toml", "sky over hills", "a million triangles by displacement"),
    entry("window.toml", "window", "a room lit through portals"),
];

/// The picture of `hero.jpg`, at the top of the guide's page on history.
pub const HERO: &str = "final-scene";

/// The scene timed with one thread and with all.
pub const THREADS: &str = "thesis/metals.toml";
