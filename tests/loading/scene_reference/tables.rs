//! The keys of scene files, with two values each.

/// Keys that may stand together in one table, each with two values, and what is around them.
pub struct Table {
    /// Tables of the same keys share this.
    pub about: &'static str,
    before: &'static str,
    /// Between two keys.
    pub between: &'static str,
    pub after: &'static str,
    pub keys: &'static [(&'static str, &'static str, &'static str)],
}

const fn lines(about: &'static str, before: &'static str, keys: &'static [Key]) -> Table {
    Table { about, before, between: "\n", after: BALL, keys }
}

pub type Key = (&'static str, &'static str, &'static str);

/// An object that uses the material `a`.
pub const BALL: &str = "\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n";
/// Shapes with a material.
pub const SHAPE: &str = "[materials]\na = { type = \"lambert\" }\nb = { type = \"phong\" }\n[[objects]]\n";
pub const PLAIN: &str = "[materials]\na = { type = \"lambert\" }\n";
const FOG: &str = "[materials]\na = { type = \"lambert\" }\n[environment]\nfog = { ";
pub const TEXTURED: &str = "[materials]\na = { type = \"lambert\", color = \"t\" }\n[textures.t]\n";

const fn shape(about: &'static str, before: &'static str, keys: &'static [Key]) -> Table {
    Table { about, before, between: ", ", after: " }\nmaterial = \"a\"\n", keys }
}

const fn fog(keys: &'static [Key]) -> Table {
    let after = " }\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n";
    Table { about: "fog", before: FOG, between: ", ", after, keys }
}

const fn light(about: &'static str, before: &'static str, keys: &'static [Key]) -> Table {
    let after = " }\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n";
    Table { about, before, between: ", ", after, keys }
}

/// A table of keys, named after what comes before them.
macro_rules! before {
    ($shape:literal) => {
        concat!("[materials]\na = { type = \"lambert\" }\n[[objects]]\n", $shape, " = { ")
    };
    (light $shape:literal) => {
        concat!("[materials]\na = { type = \"lambert\" }\n[[lights]]\n", $shape, " = { ")
    };
    (material $kind:literal) => {
        concat!("[materials.a]\ntype = \"", $kind, "\"\n")
    };
    (texture $kind:literal) => {
        concat!(
            "[materials]\na = { type = \"lambert\", color = \"t\" }\n[textures.t]\ntype = \"",
            $kind,
            "\"\n"
        )
    };
}

const NOISE: &[Key] = &[
    ("frequency", "2", "3"),
    ("octaves", "3", "4"),
    ("low", "[0, 0, 0.1]", "0.5"),
    ("high", "[1, 0.5, 0]", "0.7"),
    ("seed", "1", "2"),
];

pub const TABLES: &[Table] = &[
    lines(
        "render",
        "[materials]\na = { type = \"lambert\" }\n[render]\n",
        &[
            ("width", "64", "65"),
            ("height", "64", "65"),
            ("samples", "3", "4"),
            ("depth", "0", "7"),
            ("bounces", "{ diffuse = 3 }", "{ diffuse = 4 }"),
            ("clamp", "{ indirect = 3 }", "{ indirect = 4 }"),
            ("filter_glossy", "1", "0.5"),
            ("terminator", "\"soft\"", "\"lifted\""),
            ("skip_caustics", "{ reflective = true }", "{ refractive = true }"),
            ("seed", "5", "6"),
            ("filter", "\"box\"", "\"gaussian\""),
            ("microfacet", "\"single\"", "\"multi\""),
            ("fresnel", "\"schlick\"", "\"exact\""),
            ("caught", "\"shadows\"", "\"all\""),
            ("spectral", "true", "false"),
            ("exposure", "-1.5", "2"),
            ("view", "\"agx\"", "\"filmic\""),
            ("white_balance", "3200", "6500"),
            ("noise", "2.5", "5"),
            ("denoise", "true", "false"),
            ("crop", "[1, 2, 3, 4]", "[1, 2, 3, 5]"),
            ("aovs", "[\"depth\"]", "[\"uv\", \"depth\"]"),
        ],
    ),
    lines(
        "skip_caustics",
        "[materials]\na = { type = \"lambert\" }\n[render.skip_caustics]\n",
        &[("reflective", "true", "false"), ("refractive", "true", "false")],
    ),
    lines(
        "bounces",
        "[materials]\na = { type = \"lambert\" }\n[render.bounces]\n",
        &[
            ("diffuse", "1", "2"),
            ("glossy", "1", "2"),
            ("transmission", "1", "2"),
            ("volume", "1", "2"),
            ("transparent", "1", "2"),
            ("subsurface", "1", "2"),
        ],
    ),
    lines(
        "clamp",
        "[materials]\na = { type = \"lambert\" }\n[render.clamp]\n",
        &[("direct", "1", "2"), ("indirect", "1", "2")],
    ),
    lines(
        "camera",
        "[materials]\na = { type = \"lambert\" }\n[camera]\n",
        &[
            ("look_from", "[0, 1, 5]", "[0, 1, 6]"),
            ("look_at", "[0, 0, 0]", "[0, 1, 0]"),
            ("view_up", "[0, 1, 0]", "[1, 1, 0]"),
            ("vfov", "30", "31"),
            ("aspect_ratio", "1.5", "2"),
            ("width", "64", "65"),
            ("height", "64", "65"),
            ("defocus_angle", "1", "2"),
            ("focus_distance", "3", "4"),
            ("blades", "5", "6"),
            ("blade_rotation", "10", "20"),
            ("aperture_ratio", "1.5", "2"),
            ("pixel_aspect", "1.5", "1.4"),
            ("shift", "[0.1, 0]", "[0.1, 0.2]"),
            ("clip", "[1, 20]", "[1, 30]"),
        ],
    ),
    lines(
        "camera",
        "[materials]\na = { type = \"lambert\" }\n[camera]\n",
        &[
            ("name", "\"front\"", "\"back\""),
            ("transform", "[{ translate = [0, 1, 5] }]", "[{ euler = [0, 30, 0] }]"),
        ],
    ),
    lines(
        "camera",
        "[materials]\na = { type = \"lambert\" }\n[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\n",
        &[("f_stop", "2.8", "4"), ("focal_length", "35", "50"), ("focus_at", "[0, 0, 1]", "[0, 0, 2]")],
    ),
    lines(
        "camera",
        "[materials]\na = { type = \"lambert\" }\n[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\ntype = \"orthographic\"\n",
        &[("view_height", "2", "3")],
    ),
    lines(
        "camera",
        "[materials]\na = { type = \"lambert\" }\n[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\n",
        &[("type", "\"panorama\"", "\"perspective\"")],
    ),
    lines(
        "camera",
        "[materials]\na = { type = \"lambert\" }\n[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\ntype = \"panorama\"\n",
        &[("longitude", "[-90, 90]", "[-90, 80]"), ("latitude", "[-45, 45]", "[0, 45]")],
    ),
    lines(
        "camera",
        concat!(
            "[materials]\na = { type = \"lambert\" }\n[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\n",
            "type = \"panorama\"\nfov = 90\n"
        ),
        &[("projection", "\"fisheye_equisolid\"", "\"fisheye_equidistant\"")],
    ),
    lines(
        "camera",
        concat!(
            "[materials]\na = { type = \"lambert\" }\n[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\n",
            "type = \"panorama\"\nprojection = \"fisheye_equisolid\"\n"
        ),
        &[("fov", "160", "170"), ("fisheye_lens", "9", "8"), ("sensor", "[36, 24]", "[36, 36]")],
    ),
    Table {
        about: "camera",
        before: "[materials]\na = { type = \"lambert\" }\n[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\n",
        between: "\n",
        after: concat!(
            "\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n",
            "motion = { translate = [1, 0, 0] }\n"
        ),
        keys: &[("shutter", "0.5", "1"), ("shutter_position", "\"start\"", "\"end\"")],
    },
    lines(
        "environment",
        "[materials]\na = { type = \"lambert\" }\n[environment]\n",
        &[
            ("background", "[1, 2, 3]", "2"),
            ("seen", "{ background = [1, 2, 3] }", "{ background = 1 }"),
            ("visible_to_camera", "false", "true"),
            ("visible_to", "[\"diffuse\", \"camera\"]", "[\"shadow\"]"),
            ("sampled", "false", "true"),
            ("group", "\"sky\"", "\"other\""),
            ("fog", "{ density = 0.1 }", "{ density = 0.2 }"),
            (
                "sun",
                "{ direction = [0, -1, 0], angle = 1, irradiance = 2 }",
                "{ direction = [0, -1, 1], angle = 1, irradiance = 2 }",
            ),
        ],
    ),
    lines(
        "environment",
        "[materials]\na = { type = \"lambert\" }\n[textures]\none = { type = \"perlin\", low = 0, high = 1 }\ntwo = { type = \"perlin\", low = 0, high = 2 }\n[environment]\n",
        &[
            ("texture", "\"one\"", "\"two\""),
            ("resolution", "32", "64"),
            ("rotation", "10", "20"),
            ("strength", "0.5", "2"),
        ],
    ),
    Table {
        about: "sun of the environment",
        before: "[materials]\na = { type = \"lambert\" }\n[environment]\nbackground = 1\nsun = { ",
        between: ", ",
        after: " }\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n",
        keys: &[
            ("direction", "[0, -1, 0]", "[1, -1, 0]"),
            ("angle", "1", "2"),
            ("irradiance", "[1, 2, 3]", "[3, 2, 1]"),
        ],
    },
    Table {
        about: "portal",
        before: "[materials]\na = { type = \"lambert\" }\n[environment]\nbackground = 1\n[[portals]]\n",
        between: "\n",
        after: BALL,
        keys: &[
            ("name", "\"window\"", "\"door\""),
            ("center", "[0, 1, 0]", "[0, 2, 0]"),
            ("direction", "[0, 0, 1]", "[1, 0, 0]"),
            ("up", "[0, 1, 0]", "[0.5, 1, 0]"),
            ("size", "[1, 2]", "[2, 2]"),
        ],
    },
    Table {
        about: "portal",
        before: "[materials]\na = { type = \"lambert\" }\n[environment]\nbackground = 1\n[[portals]]\n",
        between: "\n",
        after: BALL,
        keys: &[
            ("corner", "[0, 1, 0]", "[0, 2, 0]"),
            ("u", "[1, 0, 0]", "[-1, 0, 0]"),
            ("v", "[0, 1, 0]", "[0, 2, 0]"),
        ],
    },
    Table {
        about: "portal",
        before: concat!(
            "[materials]\na = { type = \"lambert\" }\n[environment]\nbackground = 1\n[[portals]]\n",
            "center = [0, 1, 0]\nsize = [1, 1]\n"
        ),
        between: "\n",
        after: BALL,
        keys: &[("target", "[0, 0, 1]", "[1, 0, 0]")],
    },
    Table {
        about: "portal",
        before: "[materials]\na = { type = \"lambert\" }\n[environment]\nbackground = 1\n[[portals]]\nsize = [1, 1]\n",
        between: "\n",
        after: BALL,
        keys: &[("transform", "[{ scale = 2 }]", "[{ euler = [0, 30, 0] }]")],
    },
    Table {
        about: "curves",
        before: "[materials]\na = { type = \"hair\" }\nb = { type = \"lambert\" }\n[[curves]]\n",
        between: "\n",
        after: BALL,
        keys: &[
            (
                "strands",
                "[[[0, 0, 0], [1, 0, 0], [2, 1, 0], [3, 0, 0]]]",
                "[[[0, 0, 0], [1, 0, 0], [2, 1, 0], [3, 0, 1]]]",
            ),
            ("basis", "\"bspline\"", "\"bezier\""),
            ("radius", "[0.1, 0]", "0.2"),
            ("material", "\"a\"", "\"b\""),
            ("transform", "[{ scale = 2 }]", "[{ scale = 3 }]"),
            ("visible_to", "[\"diffuse\", \"camera\"]", "[\"shadow\"]"),
            ("visible_to_camera", "false", "true"),
            ("holdout", "true", "false"),
            ("shadow_catcher", "true", "false"),
            ("color", "[1, 0, 0]", "[0, 1, 0, 0.5]"),
            ("index", "1", "2"),
            ("random", "0.1", "0.2"),
        ],
    },
    Table {
        about: "curves",
        before: "[materials]\na = { type = \"hair\" }\n[[curves]]\nmaterial = \"a\"\n",
        between: "\n",
        after: BALL,
        keys: &[("file", "\"one.curves\"", "\"two.curves\"")],
    },
    lines(
        "hair",
        before!(material "hair"),
        &[
            ("color", "[0.5, 0.3, 0.1]", "0.4"),
            ("roughness", "0.2", "0.4"),
            ("radial_roughness", "0.2", "0.4"),
            ("ior", "1.5", "1.6"),
            ("tilt", "3", "-3"),
            ("coat", "0.2", "0.4"),
        ],
    ),
    lines("hair", before!(material "hair"), &[("melanin", "0.5", "0.7"), ("melanin_redness", "0.2", "0.4")]),
    lines("hair", before!(material "hair"), &[("absorption", "[0.5, 1, 2]", "0.4")]),
    fog(&[
        ("density", "0.3", "[0.1, 0.2, 0.3]"),
        ("color", "0.3", "[0.1, 0.2, 0.3]"),
        ("anisotropy", "0.3", "-0.3"),
        ("emission", "0.3", "[0.1, 0.2, 0.3]"),
        ("center", "[0, 1, 0]", "[0, 2, 0]"),
        ("radius", "10", "20"),
    ]),
    lines(
        "environment",
        "[materials]\na = { type = \"lambert\" }\n[environment]\n",
        &[("sky", "{ nadir = [1, 0, 0], zenith = [0, 0, 1] }", "{ nadir = [1, 1, 0], zenith = [0, 0, 1] }")],
    ),
    Table {
        about: "environment",
        before: "[materials]\na = { type = \"lambert\" }\n[environment]\nsky = { sun_elevation = 30, ",
        between: ", ",
        after: concat!(
            " }",
            "\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n"
        ),
        keys: &[
            ("sun_azimuth", "10", "20"),
            ("turbidity", "2", "4"),
            ("ground_albedo", "[0.1, 0.2, 0.3]", "0.4"),
            ("sun", "true", "false"),
            ("sun_size", "1", "2"),
            ("strength", "0.5", "2"),
        ],
    },
    lines(
        "environment",
        "[materials]\na = { type = \"lambert\" }\n[environment]\n",
        &[("image", "\"one.png\"", "\"two.png\""), ("rotation", "10", "20"), ("strength", "0.5", "2")],
    ),
    lines("lambert", before!(material "lambert"), &[("color", "[0.1, 0.2, 0.3]", "0.4")]),
    Table {
        about: "displacement",
        before: concat!(before!(material "lambert"), "displacement = { "),
        between: ", ",
        after: " }\n[[objects]]\nquad = { corner = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }\nmaterial = \"a\"\n",
        keys: &[
            ("image", "\"one.png\"", "\"two.png\""),
            ("scale", "0.5", "-0.2"),
            ("midlevel", "0.1", "0.2"),
            ("edge", "0.1", "0.3"),
            ("wrap", "\"mirror\"", "\"clamp\""),
            ("repeat", "[2, 1]", "[1, 3]"),
        ],
    },
    Table {
        about: "normal",
        before: concat!(before!(material "lambert"), "normal = { "),
        between: ", ",
        after: " }\n[[objects]]\nquad = { corner = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }\nmaterial = \"a\"\n",
        keys: &[
            ("image", "\"one.png\"", "\"two.png\""),
            ("scale", "0.5", "-0.2"),
            ("wrap", "\"mirror\"", "\"clamp\""),
            ("repeat", "[2, 1]", "[1, 3]"),
        ],
    },
    Table {
        about: "bump",
        before: concat!(before!(material "pbr"), "bump = { "),
        between: ", ",
        after: " }\n[[objects]]\nquad = { corner = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }\nmaterial = \"a\"\n",
        keys: &[
            ("image", "\"one.png\"", "\"two.png\""),
            ("scale", "0.5", "-0.2"),
            ("wrap", "\"repeat\"", "\"clamp\""),
            ("repeat", "[2, 1]", "[1, 3]"),
        ],
    },
    lines(
        "oren-nayar",
        before!(material "oren-nayar"),
        &[("color", "0.3", "0.4"), ("roughness", "0.3", "0.4")],
    ),
    lines(
        "phong",
        before!(material "phong"),
        &[("diffuse", "0.3", "0.4"), ("specular", "0.3", "0.4"), ("exponent", "7", "8")],
    ),
    lines("beckmann", before!(material "beckmann"), &[("color", "0.3", "0.4"), ("roughness", "0.3", "0.4")]),
    lines("velvet", before!(material "velvet"), &[("color", "0.3", "0.4"), ("deviation", "0.3", "0.4")]),
    lines(
        "toon",
        before!(material "toon"),
        &[("color", "0.3", "0.4"), ("size", "0.3", "0.4"), ("smooth", "0.3", "0.4")],
    ),
    lines(
        "toon-highlight",
        before!(material "toon-highlight"),
        &[("color", "0.3", "0.4"), ("size", "0.3", "0.4"), ("smooth", "0.3", "0.4")],
    ),
    lines("metal", before!(material "metal"), &[("color", "0.3", "0.4"), ("fuzz", "0.3", "0.4")]),
    lines(
        "metal",
        before!(material "metal"),
        &[("name", "\"gold\"", "\"copper\""), ("roughness", "0.3", "0.4")],
    ),
    lines(
        "dielectric",
        before!(material "dielectric"),
        &[
            ("ior", "1.3", "1.4"),
            ("tint", "[1, 0.5, 1]", "0.9"),
            ("roughness", "0.3", "0.4"),
            ("thin", "true", "false"),
        ],
    ),
    lines(
        "dielectric",
        before!(material "dielectric"),
        &[("medium", "{ density = 1 }", "{ density = 1, color = 0.5 }"), ("priority", "1", "-2")],
    ),
    lines(
        "medium",
        before!(material "medium"),
        &[
            ("density", "0.3", "0.4"),
            ("color", "0.3", "0.4"),
            ("anisotropy", "0.3", "0.4"),
            ("grid", "\"one.vol\"", "\"two.vol\""),
            ("min", "[-1, -1, -1]", "[-2, -1, -1]"),
            ("max", "[1, 1, 1]", "[2, 1, 1]"),
        ],
    ),
    lines(
        "medium",
        concat!(before!(material "medium"), "grid = \"smoke.vdb\"\n"),
        &[("grid_name", "\"density\"", "\"temperature\""), ("up", "\"y\"", "\"z\"")],
    ),
    lines("medium", before!(material "medium"), &[("emission", "0.3", "0.4"), ("priority", "1", "-2")]),
    lines(
        "medium",
        concat!(before!(material "medium"), "density = \"noise.factor\"\n"),
        &[(
            "nodes",
            "{ noise = { type = \"noise_texture\" } }",
            "{ noise = { type = \"noise_texture\", scale = 2 } }",
        )],
    ),
    lines(
        "medium",
        concat!(
            before!(material "medium"),
            "density = \"noise.factor\"\nnodes = { noise = { type = \"noise_texture\" } }\n"
        ),
        &[("resolution", "4", "5")],
    ),
    lines(
        "medium",
        concat!(before!(material "medium"), "grid = \"one.vol\"\n"),
        &[("transform", "[{ translate = [0, 1, 0] }]", "[{ scale = 2 }]")],
    ),
    lines(
        "medium",
        concat!(before!(material "medium"), "grid = \"smoke.vdb\"\nemission = 3\n"),
        &[("emission_grid", "\"density\"", "\"temperature\"")],
    ),
    lines(
        "medium",
        concat!(before!(material "medium"), "grid = \"one.vol\"\nemission = 3\n"),
        &[("temperature_grid", "\"one.vol\"", "\"two.vol\"")],
    ),
    lines(
        "medium",
        concat!(
            before!(material "medium"),
            "grid = \"smoke.vdb\"\nemission = 3\ntemperature_grid = \"temperature\"\n"
        ),
        &[("temperature", "1000", "2000"), ("temperature_law", "\"stefan-boltzmann\"", "\"planck\"")],
    ),
    lines("dielectric", before!(material "dielectric"), &[("fresnel", "\"schlick\"", "\"exact\"")]),
    lines(
        "emissive",
        before!(material "emissive"),
        &[
            ("radiance", "3", "[1, 2, 3]"),
            ("two_sided", "true", "false"),
            ("light_group", "\"neon\"", "\"other\""),
        ],
    ),
    lines(
        "pbr",
        before!(material "pbr"),
        &[
            ("base_color", "0.3", "0.4"),
            ("metallic", "0.3", "0.4"),
            ("roughness", "0.3", "0.4"),
            ("opacity", "0.3", "0.4"),
            ("diffuse_roughness", "0.3", "0.4"),
            ("ior", "1.3", "1.4"),
            ("specular", "0.3", "0.4"),
            ("specular_color", "0.3", "0.4"),
            ("transmission", "0.3", "0.4"),
            ("volume", "true", ""),
            ("keeps_radiance", "true", "false"),
            ("glass_reflection", "\"tinted\"", "\"none\""),
            ("attenuation_color", "[1, 0.5, 0.5]", "0.5"),
            ("attenuation_distance", "2", "3"),
            ("dispersion", "0.1", "0.2"),
            ("clearcoat", "0.3", "0.4"),
            ("clearcoat_roughness", "0.3", "0.4"),
            ("sheen_color", "0.3", "0.4"),
            ("sheen_roughness", "0.3", "0.4"),
            ("anisotropy", "0.3", "0.4"),
            ("anisotropy_rotation", "30", "40"),
            ("iridescence", "0.3", "0.4"),
            ("iridescence_ior", "1.4", "1.5"),
            ("iridescence_thickness", "300", "350"),
            ("diffuse_transmission", "0.3", "0.4"),
            ("diffuse_transmission_color", "0.3", "0.4"),
            ("emission", "2", "3"),
            ("two_sided", "true", "false"),
            ("light_group", "\"neon\"", "\"other\""),
        ],
    ),
    lines(
        "pbr",
        concat!(before!(material "pbr"), "transmission = 1\nvolume = true\n"),
        &[("medium", "{ density = 1 }", "{ density = 2 }"), ("priority", "1", "-2")],
    ),
    lines(
        "pbr",
        before!(material "pbr"),
        &[("subsurface", "{ color = [0.9, 0.5, 0.3] }", "{ color = 0.5, radius = 0.1 }")],
    ),
    Table {
        about: "subsurface",
        before: concat!(before!(material "pbr"), "subsurface = { "),
        between: ", ",
        after: concat!(
            " }\n",
            "\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n"
        ),
        keys: &[
            ("color", "0.3", "[0.1, 0.2, 0.3]"),
            ("radius", "0.3", "[0.1, 0.2, 0.3]"),
            ("scale", "0.3", "0.4"),
            ("anisotropy", "0.3", "0.4"),
        ],
    },
    lines("solid", before!(texture "solid"), &[("color", "0.3", "[0.1, 0.2, 0.3]")]),
    lines(
        "image",
        before!(texture "image"),
        &[
            ("file", "\"one.png\"", "\"two.png\""),
            ("wrap", "\"clamp\"", "\"mirror\""),
            ("interpolation", "\"nearest\"", "\"bilinear\""),
            ("encoding", "\"srgb\"", "\"linear\""),
        ],
    ),
    lines(
        "image",
        concat!(before!(texture "image"), "file = \"one.png\"\nmapping = \"triplanar\"\n"),
        &[("size", "2", "3")],
    ),
    lines(
        "image",
        concat!(before!(texture "image"), "file = \"one.png\"\n"),
        &[("mapping", "\"triplanar\"", "\"uv\"")],
    ),
    lines(
        "checker",
        before!(texture "checker"),
        &[
            ("even", "0.1", "0.2"),
            ("odd", "[0.8, 0.1, 0.1]", "0.7"),
            ("size", "0.5", "0.25"),
            ("mapping", "\"uv\"", "\"world\""),
        ],
    ),
    lines(
        "mix",
        before!(texture "mix"),
        &[("a", "0.1", "0.2"), ("b", "[0.8, 0.1, 0.1]", "0.7"), ("factor", "0.5", "[0.1, 0.2, 0.3]")],
    ),
    lines("facing", before!(texture "facing"), &[("colors", "[0.1, 0.2]", "[0.1, [0.3, 0.2, 0.1], 1]")]),
    lines("perlin", before!(texture "perlin"), NOISE),
    lines("turbulence", before!(texture "turbulence"), NOISE),
    lines("marble", before!(texture "marble"), NOISE),
    shape("sphere", before!("sphere"), &[("center", "[0, 1, 0]", "[0, 2, 0]"), ("radius", "2", "3")]),
    shape(
        "disk",
        before!("disk"),
        &[("center", "[0, 1, 0]", "[0, 2, 0]"), ("radius", "2", "3"), ("normal", "[0, 1, 0]", "[0, 1, 1]")],
    ),
    shape(
        "quad",
        before!("quad"),
        &[
            ("corner", "[0, 0, 0]", "[0, 0, 1]"),
            ("u", "[1, 0, 0]", "[2, 0, 0]"),
            ("v", "[0, 1, 0]", "[0, 2, 0]"),
        ],
    ),
    shape("box", before!("box"), &[("min", "[0, 0, 0]", "[0, 0, 0.5]"), ("max", "[1, 1, 1]", "[1, 1, 2]")]),
    shape(
        "pyramid",
        before!("pyramid"),
        &[("base", "[0, 0, 0]", "[0, 1, 0]"), ("size", "[1, 2]", "[2, 2]"), ("height", "1", "2")],
    ),
    light(
        "area",
        before!(light "area"),
        &[
            ("center", "[0, 3, 0]", "[0, 4, 0]"),
            ("target", "[0, 0, 1]", "[0, 0, 2]"),
            ("up", "[1, 0, 0]", "[0, 1, 1]"),
            ("size", "[1, 2]", "[2, 2]"),
            ("shape", "\"ellipse\"", "\"rectangle\""),
            ("spread", "60", "180"),
            ("image", "\"one.png\"", "\"two.png\""),
            ("power", "10", "20"),
        ],
    ),
    light(
        "area",
        before!(light "area"),
        &[
            ("center", "[0, 3, 0]", "[0, 4, 0]"),
            ("direction", "[0, -1, 0.5]", "[0, -1, 1]"),
            ("size", "[1, 2]", "[2, 2]"),
            ("radiance", "10", "20"),
        ],
    ),
    light(
        "point",
        before!(light "point"),
        &[
            ("position", "[0, 3, 0]", "[0, 4, 0]"),
            ("radius", "0.1", "0"),
            ("soft_falloff", "false", "true"),
            ("power", "10", "20"),
        ],
    ),
    light(
        "point",
        before!(light "point"),
        &[("position", "[0, 3, 0]", "[0, 4, 0]"), ("intensity", "10", "20")],
    ),
    light(
        "point",
        before!(light "point"),
        &[
            ("position", "[0, 3, 0]", "[0, 4, 0]"),
            ("ies", "\"one.ies\"", "\"two.ies\""),
            ("target", "[0, 0, 1]", "[0, 0, 2]"),
            ("turn", "30", "40"),
            ("strength", "2", "3"),
            ("radius", "0.1", "0"),
            ("soft_falloff", "true", "false"),
        ],
    ),
    light(
        "point",
        before!(light "point"),
        &[
            ("position", "[0, 3, 0]", "[0, 4, 0]"),
            ("ies", "\"one.ies\"", "\"two.ies\""),
            ("direction", "[0, -1, 1]", "[0, -1, 2]"),
            ("clockwise", "false", "true"),
        ],
    ),
    light(
        "spot",
        before!(light "spot"),
        &[
            ("position", "[0, 3, 0]", "[0, 4, 0]"),
            ("direction", "[0, -1, 0.5]", "[0, -1, 1]"),
            ("ies", "\"one.ies\"", "\"two.ies\""),
            ("turn", "30", "40"),
            ("power", "10", "20"),
        ],
    ),
    light(
        "spot",
        before!(light "spot"),
        &[
            ("position", "[0, 3, 0]", "[0, 4, 0]"),
            ("direction", "[0, -1, 0.5]", "[0, -1, 1]"),
            ("ies", "\"one.ies\"", "\"two.ies\""),
            ("clockwise", "false", "true"),
            ("strength", "2", "3"),
        ],
    ),
    light(
        "spot",
        before!(light "spot"),
        &[
            ("position", "[0, 3, 0]", "[0, 4, 0]"),
            ("target", "[0, 0, 1]", "[0, 0, 2]"),
            ("angle", "30", "40"),
            ("blend", "0.5", "0.25"),
            ("radius", "0.1", "0"),
            ("soft_falloff", "true", "false"),
            ("power", "10", "20"),
        ],
    ),
    light(
        "spot",
        before!(light "spot"),
        &[
            ("position", "[0, 3, 0]", "[0, 4, 0]"),
            ("direction", "[0, -1, 0.5]", "[0, -1, 1]"),
            ("intensity", "10", "20"),
        ],
    ),
    light(
        "sun",
        before!(light "sun"),
        &[("direction", "[0, -1, 0.5]", "[0, -1, 1]"), ("angle", "1", "0"), ("irradiance", "3", "4")],
    ),
];

impl Table {
    /// A scene with the first value of each key, except that one key may have another value (empty: none).
    pub fn text(&self, changed: Option<(&str, &str)>) -> String {
        let value =
            |&(key, first, _): &Key| changed.filter(|(name, _)| *name == key).map_or(first, |(_, v)| v);
        let set = self.keys.iter().map(|key| (key.0, value(key))).filter(|(_, value)| !value.is_empty());
        let set: Vec<String> = set.map(|(key, value)| format!("{key} = {value}")).collect();
        format!("{}{}{}", self.before, set.join(self.between), self.after)
    }
}
