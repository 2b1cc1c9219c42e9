//! Node kinds of graphs with their names, settings, inputs and outputs. Semantics are those of the shader nodes of Cycles
//! (Blender 5.0), except that texture coordinates without a link default to the world-space position.

/// Type of an input or output. A float converts to three equal components, a vector to a float by its mean, and a colour to a
/// float by its luminance (Rec. 709).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SocketType {
    /// A number.
    Float,
    /// Three numbers.
    Vector,
    /// Linear Rec. 709.
    Color,
}

/// Value of an input without a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SocketDefault {
    /// A value; floats use the first component.
    Value([f32; 3]),
    /// The hit point in world space, metres.
    Position,
    /// The shading normal on the viewer's side, world space.
    Normal,
    /// The first texture coordinates.
    Uv,
}

/// An input or output of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Socket {
    /// Name in files.
    pub name: &'static str,
    /// Type.
    pub kind: SocketType,
    /// Value without a link; unused for outputs.
    pub default: SocketDefault,
}

/// Defines enums of setting values with their names in files.
macro_rules! options {
    ($($(#[$doc:meta])* $name:ident { $first:ident = $first_text:literal, $($option:ident = $text:literal,)* })*) => {$(
        $(#[$doc])*
        #[allow(missing_docs, reason = "the names say what the options are")]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub enum $name { #[default] $first, $($option,)* }

        impl Setting for $name {
            fn set(&mut self, value: &SettingValue) -> Result<(), String> {
                const NAMES: &[(&str, $name)] = &[($first_text, $name::$first), $(($text, $name::$option),)*];
                let SettingValue::Text(text) = value else { return Err("must be a string".to_string()) };
                let found = NAMES.iter().find(|(name, _)| name == text);
                let names = || NAMES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
                *self = found.ok_or_else(|| format!("must be one of {}, not '{text}'", names()))?.1;
                Ok(())
            }
        }
    )*};
}

/// A value of a setting in a scene file.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingValue {
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// Any number.
    Number(f32),
    /// A string.
    Text(String),
    /// Numbers.
    Numbers(Vec<f32>),
    /// Rows of numbers.
    Table(Vec<Vec<f32>>),
}

/// A setting of a node that can be read from a file.
pub(crate) trait Setting {
    /// Sets it from a value; the error is the expected kind of value.
    fn set(&mut self, value: &SettingValue) -> Result<(), String>;
}

impl Setting for bool {
    fn set(&mut self, value: &SettingValue) -> Result<(), String> {
        let SettingValue::Bool(value) = value else { return Err("must be true or false".to_string()) };
        *self = *value;
        Ok(())
    }
}

impl Setting for String {
    fn set(&mut self, value: &SettingValue) -> Result<(), String> {
        let SettingValue::Text(text) = value else { return Err("must be a string".to_string()) };
        self.clone_from(text);
        Ok(())
    }
}

/// A direction setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction(
    /// A vector of any length.
    pub [f32; 3],
);

impl Setting for Direction {
    fn set(&mut self, value: &SettingValue) -> Result<(), String> {
        self.0 = match value {
            SettingValue::Numbers(numbers) => <[f32; 3]>::try_from(&numbers[..]).ok(),
            _ => None,
        }
        .ok_or_else(|| "must be a list of three numbers".to_string())?;
        Ok(())
    }
}

/// An affine transform: the upper three rows of a 4x4 matrix.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix(
    /// Row by row; `None` for that of the hit object.
    pub Option<[f32; 12]>,
);

impl Setting for Matrix {
    fn set(&mut self, value: &SettingValue) -> Result<(), String> {
        let expected = || "must be a list of 12 or 16 numbers, row by row".to_string();
        let SettingValue::Numbers(numbers) = value else { return Err(expected()) };
        let rows = numbers.first_chunk::<12>().filter(|_| matches!(numbers.len(), 12 | 16));
        self.0 = Some(*rows.ok_or_else(expected)?);
        Ok(())
    }
}

impl Setting for u32 {
    fn set(&mut self, value: &SettingValue) -> Result<(), String> {
        let SettingValue::Integer(value) = value else { return Err("must be a whole number".to_string()) };
        *self = u32::try_from(*value).map_err(|_| "must be a whole number of 0 or more".to_string())?;
        Ok(())
    }
}

impl Setting for f32 {
    fn set(&mut self, value: &SettingValue) -> Result<(), String> {
        *self = match value {
            SettingValue::Integer(value) => *value as f32,
            SettingValue::Number(value) => *value,
            _ => return Err("must be a number".to_string()),
        };
        Ok(())
    }
}

options! {
    /// Operations of the math node.
    MathOperation {
        Add = "add", Subtract = "subtract", Multiply = "multiply", Divide = "divide", MultiplyAdd = "multiply_add", Power = "power",
        Logarithm = "logarithm", Sqrt = "sqrt", InverseSqrt = "inverse_sqrt", Absolute = "absolute", Exponent = "exponent",
        Minimum = "minimum", Maximum = "maximum", LessThan = "less_than", GreaterThan = "greater_than", Sign = "sign",
        Compare = "compare", SmoothMin = "smooth_min", SmoothMax = "smooth_max", Round = "round", Floor = "floor", Ceil = "ceil",
        Trunc = "trunc", Fract = "fract", Modulo = "modulo", FlooredModulo = "floored_modulo", Wrap = "wrap", Snap = "snap",
        PingPong = "pingpong", Sine = "sine", Cosine = "cosine", Tangent = "tangent", ArcSine = "arcsine", ArcCosine = "arccosine",
        ArcTangent = "arctangent", ArcTan2 = "arctan2", SinH = "sinh", CosH = "cosh", TanH = "tanh", Radians = "radians",
        Degrees = "degrees",
    }
    /// Operations of the vector math node.
    VectorOperation {
        Add = "add", Subtract = "subtract", Multiply = "multiply", Divide = "divide", MultiplyAdd = "multiply_add",
        Cross = "cross_product", Project = "project", Reflect = "reflect", Refract = "refract", FaceForward = "faceforward",
        Dot = "dot_product", Distance = "distance", Length = "length", Scale = "scale", Normalize = "normalize",
        Absolute = "absolute", Power = "power", Sign = "sign", Minimum = "minimum", Maximum = "maximum", Floor = "floor",
        Ceil = "ceil", Fraction = "fraction", Modulo = "modulo", Wrap = "wrap", Snap = "snap", Sine = "sine", Cosine = "cosine",
        Tangent = "tangent",
    }
    /// Blend modes of two colours.
    BlendMode {
        Mix = "mix", Darken = "darken", Multiply = "multiply", Burn = "burn", Lighten = "lighten", Screen = "screen",
        Dodge = "dodge", Add = "add", Overlay = "overlay", SoftLight = "soft_light", LinearLight = "linear_light",
        Difference = "difference", Exclusion = "exclusion", Subtract = "subtract", Divide = "divide", Hue = "hue",
        Saturation = "saturation", Color = "color", Value = "value",
    }
    /// Value type of a mix node.
    MixType { Float = "float", Vector = "vector", Color = "rgba", }
    /// Factor of a mix of vectors: a scalar, or one per component.
    FactorMode { Uniform = "uniform", NonUniform = "non_uniform", }
    /// Interpolation of a map range node.
    RangeInterpolation { Linear = "linear", Stepped = "stepped", SmoothStep = "smoothstep", SmootherStep = "smootherstep", }
    /// Clamping; `Range` swaps the bounds if the minimum is above the maximum.
    ClampType { MinMax = "minmax", Range = "range", }
    /// Vector type of a mapping node.
    MappingType { Point = "point", Texture = "texture", Vector = "vector", Normal = "normal", }
    /// Colour models.
    ColorModel { Rgb = "rgb", Hsv = "hsv", Hsl = "hsl", }
    /// Representations of a rotation.
    RotationType { AxisAngle = "axis_angle", X = "x_axis", Y = "y_axis", Z = "z_axis", Euler = "euler_xyz", }
    /// Fractal noise types.
    NoiseType {
        Fbm = "fbm", Multifractal = "multifractal", Ridged = "ridged_multifractal", Hybrid = "hybrid_multifractal",
        HeteroTerrain = "hetero_terrain",
    }
    /// Dimensions of a procedural texture.
    Dimensions { Three = "3d", One = "1d", Two = "2d", Four = "4d", }
    /// Feature of a Voronoi texture.
    VoronoiFeature {
        F1 = "f1", F2 = "f2", SmoothF1 = "smooth_f1", DistanceToEdge = "distance_to_edge", SphereRadius = "n_sphere_radius",
    }
    /// Distance metrics.
    DistanceMetric { Euclidean = "euclidean", Manhattan = "manhattan", Chebychev = "chebychev", Minkowski = "minkowski", }
    /// Shapes of waves.
    WaveType { Bands = "bands", Rings = "rings", }
    /// Directions of bands.
    BandsDirection { X = "x", Y = "y", Z = "z", Diagonal = "diagonal", }
    /// Axes of rings.
    RingsDirection { X = "x", Y = "y", Z = "z", Spherical = "spherical", }
    /// Profiles of waves.
    WaveProfile { Sine = "sin", Saw = "saw", Triangle = "tri", }
    /// Shapes of gradients.
    GradientType {
        Linear = "linear", Quadratic = "quadratic", Easing = "easing", Diagonal = "diagonal", Spherical = "spherical",
        QuadraticSphere = "quadratic_sphere", Radial = "radial",
    }
    /// Wrapping of images outside texture coordinates 0..1.
    Extension { Repeat = "repeat", Extend = "extend", Clip = "clip", Mirror = "mirror", }
    /// Texel interpolation; `Smart` is cubic.
    ImageInterpolation { Linear = "linear", Closest = "closest", Cubic = "cubic", Smart = "smart", }
    /// Projections of images onto surfaces.
    ImageProjection { Flat = "flat", Box = "box", Sphere = "sphere", Tube = "tube", }
    /// Projections of environment images.
    EnvironmentProjection { Equirectangular = "equirectangular", MirrorBall = "mirror_ball", }
    /// Colour space of an image; `NonColor` is data.
    ColorSpace { Srgb = "srgb", Linear = "linear", NonColor = "non-color", }
    /// Alpha of an image: unassociated (`Straight`), premultiplied (`Premul`), an independent channel (`ChannelPacked`) or ignored
    /// (`None`).
    AlphaMode { Straight = "straight", Premul = "premul", ChannelPacked = "channel_packed", None = "none", }
    /// Spaces of the normals of a normal map.
    NormalSpace { Tangent = "tangent", Object = "object", World = "world", BlenderObject = "blender_object", BlenderWorld = "blender_world", }
    /// Tangent directions: around an axis, or along u.
    TangentType { Radial = "radial", UvMap = "uv_map", }
    /// Axes.
    Axis { Z = "z", X = "x", Y = "y", }
    /// Vector type of a vector transform node.
    TransformType { Vector = "vector", Point = "point", Normal = "normal", }
    /// Coordinate spaces.
    Space { World = "world", Object = "object", Camera = "camera", }
    /// Interpolation between the stops of a colour ramp.
    RampInterpolation { Linear = "linear", Constant = "constant", }
}

/// Table rows: position, red, green, blue and alpha of a colour ramp; values of curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows(
    /// The rows.
    pub Vec<Vec<f32>>,
);

impl Setting for Rows {
    fn set(&mut self, value: &SettingValue) -> Result<(), String> {
        let SettingValue::Table(rows) = value else {
            return Err("must be a list of lists of numbers".to_string());
        };
        self.0.clone_from(rows);
        Ok(())
    }
}

macro_rules! socket {
    ($name:ident float $default:expr) => {
        Socket {
            name: stringify!($name),
            kind: SocketType::Float,
            default: SocketDefault::Value([$default; 3]),
        }
    };
    ($name:ident vector $default:expr) => {
        Socket { name: stringify!($name), kind: SocketType::Vector, default: SocketDefault::Value($default) }
    };
    ($name:ident color $default:expr) => {
        Socket { name: stringify!($name), kind: SocketType::Color, default: SocketDefault::Value($default) }
    };
    ($name:ident position) => {
        Socket { name: stringify!($name), kind: SocketType::Vector, default: SocketDefault::Position }
    };
    ($name:ident uv) => {
        Socket { name: stringify!($name), kind: SocketType::Vector, default: SocketDefault::Uv }
    };
    ($name:ident normal) => {
        Socket { name: stringify!($name), kind: SocketType::Vector, default: SocketDefault::Normal }
    };
}

macro_rules! output {
    ($name:ident float) => {
        socket!($name float 0.0)
    };
    ($name:ident $kind:ident) => {
        socket!($name $kind [0.0; 3])
    };
}

/// Defines the node kinds with their names in files, settings, inputs and outputs.
macro_rules! nodes {
    ($($(#[$doc:meta])* $kind:ident $text:literal {$($setting:ident: $type:ty = $default:expr),*}
        ($($input:ident: $in_type:ident $($in_default:expr)?),*) -> ($($output:ident: $out_type:ident),*);)*) => {
        /// Node kind with its settings.
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum NodeKind {$(
            $(#[$doc])*
            $kind { $(#[allow(missing_docs, reason = "named and valued as in Blender")]
                $setting: $type),* },
        )*}

        impl NodeKind {
            /// Names of all kinds.
            pub const NAMES: &[&str] = &[$($text),*];

            /// The kind of a name in files, with default settings.
            pub fn from_name(name: &str) -> Option<NodeKind> {
                match name {
                    $($text => Some(NodeKind::$kind { $($setting: $default),* }),)*
                    _ => None,
                }
            }

            /// Name in files.
            pub fn name(&self) -> &'static str {
                match self { $(NodeKind::$kind { .. } => $text,)* }
            }

            /// Changes a setting.
            ///
            /// # Errors
            /// The setting doesn't exist, or the value has the wrong type or range.
            pub fn set(&mut self, setting: &str, value: &SettingValue) -> Result<(), String> {
                match self {$(
                    #[allow(unused_variables, reason = "some have no settings")]
                    NodeKind::$kind { $($setting),* } => {
                        $(if setting == stringify!($setting) { return $setting.set(value).map_err(|e| format!("{setting} {e}")); })*
                        let names: &[&str] = &[$(stringify!($setting)),*];
                        Err(format!("{} has no setting '{setting}', but {}", $text, if names.is_empty() { "none".to_string() } else { names.join(", ") }))
                    }
                )*}
            }

            /// Inputs, in the order of [`Node::inputs`](super::Node::inputs).
            pub fn inputs(&self) -> &'static [Socket] {
                match self { $(NodeKind::$kind { .. } => { const LIST: &[Socket] = &[$(socket!($input $in_type $($in_default)?)),*]; LIST })* }
            }

            /// Outputs.
            pub fn outputs(&self) -> &'static [Socket] {
                match self { $(NodeKind::$kind { .. } => { const LIST: &[Socket] = &[$(output!($output $out_type)),*]; LIST })* }
            }
        }
    };
}

nodes! {
    /// Coordinates of the hit point. `object_matrix` maps world space to the space of another object.
    TextureCoordinate "texture_coordinate" { object_matrix: Matrix = Matrix::default() }
        () -> (uv: vector, generated: vector, normal: vector, object: vector, camera: vector, window: vector, reflection: vector);
    /// The hit point: position in world space (metres), normals on the viewer's side, and mesh attributes of the outputs' names.
    Geometry "geometry" {} ()
        -> (position: vector, true_normal: vector, normal: vector, tangent: vector, incoming: vector, parametric: vector, backfacing: float, pointiness: float, random_per_island: float);
    /// A vertex attribute by its name; 0 if the mesh doesn't have it.
    Attribute "attribute" { name: String = String::new() } () -> (color: color, vector: vector, factor: float, alpha: float);
    /// A UV set by its name; the default texture coordinates if the mesh doesn't have it.
    UvMap "uv_map" { name: String = String::new() } () -> (uv: vector);
    /// Vertex colours by their name.
    ColorAttribute "color_attribute" { name: String = String::new() } () -> (color: color, alpha: float);
    /// The hit object.
    ObjectInfo "object_info" {} () -> (location: vector, color: color, alpha: float, object_index: float, material_index: float, random: float);
    /// The hit point relative to the camera: direction in camera space, depth along the axis and distance, metres.
    CameraData "camera_data" {} () -> (view_vector: vector, view_z_depth: float, view_distance: float);
    /// Kind, length and depth of the ray.
    LightPath "light_path" {} ()
        -> (is_camera_ray: float, is_shadow_ray: float, is_diffuse_ray: float, is_glossy_ray: float, is_singular_ray: float, is_reflection_ray: float, is_transmission_ray: float, is_volume_scatter_ray: float, ray_length: float, ray_depth: float);
    /// The hit strand.
    HairInfo "hair_info" {} () -> (is_strand: float, intercept: float, length: float, thickness: float, tangent_normal: vector, random: float);
    /// A tangent: around an axis of the object, or along u of the first UV set.
    Tangent "tangent" { direction_type: TangentType = TangentType::Radial, axis: Axis = Axis::Z } () -> (tangent: vector);
    /// A normal map: (n + 1) / 2 in the tangent space of a UV set (the first without a name), or in object or world space.
    NormalMap "normal_map" { space: NormalSpace = NormalSpace::Tangent, uv_map: String = String::new() }
        (strength: float 1.0, color: color [0.5, 0.5, 1.0]) -> (normal: vector);
    /// A bump map: the normal of the surface displaced by `height` times `distance`, by finite differences over `filter_width` pixels.
    /// The distance is multiplied by the object's scale along the normal to the power of `object_scale`: 1 for object-space heights.
    Bump "bump" { invert: bool = false, filter_width: f32 = 0.1, object_scale: f32 = 0.0 }
        (strength: float 1.0, distance: float 0.001, height: float 1.0, normal: normal) -> (normal: vector);
    /// A direction, and its cosine with a normal.
    Normal "normal" { direction: Direction = Direction([0.0, 0.0, 1.0]) } (normal: vector [0.0, 0.0, 1.0]) -> (normal: vector, dot: float);
    /// The fraction of `samples` cosine-distributed rays around the normal that hit nothing within a distance, metres, and the colour times
    /// it. Rays start into the object with `inside`; with `only_local`, only the hit object occludes.
    AmbientOcclusion "ambient_occlusion" { samples: u32 = 16, inside: bool = false, only_local: bool = false }
        (color: color [1.0; 3], distance: float 1.0, normal: normal) -> (color: color, ao: float);
    /// A normal as if edges were rounded by a radius, metres: the mean of the normals around the point, found by `samples` rays. What differs
    /// from the surface's normal is added to `normal`.
    Bevel "bevel" { samples: u32 = 4 } (radius: float 0.05, normal: normal) -> (normal: vector);
    /// 1 along the edges of triangles; `size` is the line width in metres or pixels.
    Wireframe "wireframe" { use_pixel_size: bool = false } (size: float 0.01) -> (factor: float);
    /// Transforms a vector between world, object and camera space.
    VectorTransform "vector_transform" { vector_type: TransformType = TransformType::Vector, convert_from: Space = Space::World, convert_to: Space = Space::Object }
        (vector: vector [0.5; 3]) -> (vector: vector);
    /// An image: `file` relative to the scene file. Filtered over the path's footprint if `vector` is a UV set, scaled or not.
    ImageTexture "image_texture" { file: String = String::new(), interpolation: ImageInterpolation = ImageInterpolation::Linear, extension: Extension = Extension::Repeat, projection: ImageProjection = ImageProjection::Flat, blend: f32 = 0.0, color_space: ColorSpace = ColorSpace::Srgb, alpha_mode: AlphaMode = AlphaMode::Straight }
        (vector: uv) -> (color: color, alpha: float);
    /// An environment image by direction.
    EnvironmentTexture "environment_texture" { file: String = String::new(), interpolation: ImageInterpolation = ImageInterpolation::Linear, projection: EnvironmentProjection = EnvironmentProjection::Equirectangular, color_space: ColorSpace = ColorSpace::Srgb }
        (vector: position) -> (color: color);
    /// A number.
    Value "value" {} (value: float 0.5) -> (value: float);
    /// A colour.
    Rgb "rgb" {} (color: color [0.5, 0.5, 0.5]) -> (color: color);
    /// Arithmetic.
    Math "math" { operation: MathOperation = MathOperation::Add, use_clamp: bool = false }
        (a: float 0.5, b: float 0.5, c: float 0.5) -> (value: float);
    /// Arithmetic of vectors.
    VectorMath "vector_math" { operation: VectorOperation = VectorOperation::Add }
        (a: vector [0.0; 3], b: vector [0.0; 3], c: vector [0.0; 3], scale: float 1.0) -> (vector: vector, value: float);
    /// A mix of two values.
    Mix "mix" { data_type: MixType = MixType::Float, factor_mode: FactorMode = FactorMode::Uniform, blend_type: BlendMode = BlendMode::Mix, clamp_factor: bool = true, clamp_result: bool = false }
        (factor: float 0.5, factor_vector: vector [0.5; 3], a: color [0.0; 3], b: color [0.0; 3]) -> (result: color);
    /// Maps values of one range to another.
    MapRange "map_range" { clamp: bool = true, interpolation_type: RangeInterpolation = RangeInterpolation::Linear }
        (value: vector [1.0; 3], from_min: vector [0.0; 3], from_max: vector [1.0; 3], to_min: vector [0.0; 3], to_max: vector [1.0; 3], steps: vector [4.0; 3]) -> (result: vector);
    /// A value clamped to a range.
    Clamp "clamp" { clamp_type: ClampType = ClampType::MinMax } (value: float 1.0, min: float 0.0, max: float 1.0) -> (result: float);
    /// Translates, rotates (XYZ Euler angles, radians) and scales a vector.
    Mapping "mapping" { vector_type: MappingType = MappingType::Point }
        (vector: position, location: vector [0.0; 3], rotation: vector [0.0; 3], scale: vector [1.0; 3]) -> (vector: vector);
    /// Rotates a vector about a point.
    VectorRotate "vector_rotate" { rotation_type: RotationType = RotationType::AxisAngle, invert: bool = false }
        (vector: vector [0.0; 3], center: vector [0.0; 3], axis: vector [0.0, 0.0, 1.0], angle: float 0.0, rotation: vector [0.0; 3]) -> (vector: vector);
    /// A vector from its components.
    CombineXyz "combine_xyz" {} (x: float 0.0, y: float 0.0, z: float 0.0) -> (vector: vector);
    /// Components of a vector.
    SeparateXyz "separate_xyz" {} (vector: vector [0.0; 3]) -> (x: float, y: float, z: float);
    /// A colour from its components.
    CombineColor "combine_color" { mode: ColorModel = ColorModel::Rgb } (red: float 0.0, green: float 0.0, blue: float 0.0) -> (color: color);
    /// Components of a colour.
    SeparateColor "separate_color" { mode: ColorModel = ColorModel::Rgb } (color: color [0.8; 3]) -> (red: float, green: float, blue: float);
    /// Adjusts hue, saturation and value.
    HueSaturation "hue_saturation" {} (hue: float 0.5, saturation: float 1.0, value: float 1.0, factor: float 1.0, color: color [0.8; 3]) -> (color: color);
    /// Adjusts brightness and contrast.
    BrightnessContrast "brightness_contrast" {} (color: color [1.0; 3], brightness: float 0.0, contrast: float 0.0) -> (color: color);
    /// A power of each component.
    Gamma "gamma" {} (color: color [1.0; 3], gamma: float 1.0) -> (color: color);
    /// 1 minus each component.
    Invert "invert" {} (factor: float 1.0, color: color [0.0; 3]) -> (color: color);
    /// Luminance.
    RgbToBw "rgb_to_bw" {} (color: color [0.5; 3]) -> (value: float);
    /// A colour gradient: `stops` are rows of position, red, green, blue, alpha.
    ColorRamp "color_ramp" { stops: Rows = Rows::default(), interpolation: RampInterpolation = RampInterpolation::Linear }
        (factor: float 0.5) -> (color: color, alpha: float);
    /// Curves of red, green and blue: `table` has rows of their values, evenly spaced over `min`..`max`.
    RgbCurves "rgb_curves" { table: Rows = Rows::default(), min: f32 = 0.0, max: f32 = 1.0, extrapolate: bool = true }
        (factor: float 1.0, color: color [1.0; 3]) -> (color: color);
    /// Curves of the components of a vector, like `rgb_curves`.
    VectorCurves "vector_curves" { table: Rows = Rows::default(), min: f32 = -1.0, max: f32 = 1.0, extrapolate: bool = true }
        (factor: float 1.0, vector: vector [0.0; 3]) -> (vector: vector);
    /// A curve of a number: `table` has rows of one value.
    FloatCurve "float_curve" { table: Rows = Rows::default(), min: f32 = 0.0, max: f32 = 1.0, extrapolate: bool = true }
        (factor: float 1.0, value: float 1.0) -> (value: float);
    /// Fresnel reflectance of a dielectric by the view angle, from outside.
    Fresnel "fresnel" {} (ior: float 1.5, normal: normal) -> (factor: float);
    /// View-dependent weights for mixing layers.
    LayerWeight "layer_weight" {} (blend: float 0.5, normal: normal) -> (fresnel: float, facing: float);
    /// Fractal gradient noise.
    NoiseTexture "noise_texture" { dimensions: Dimensions = Dimensions::Three, noise_type: NoiseType = NoiseType::Fbm, normalize: bool = true }
        (vector: position, w: float 0.0, scale: float 5.0, detail: float 2.0, roughness: float 0.5, lacunarity: float 2.0, offset: float 0.0, gain: float 1.0, distortion: float 0.0) -> (factor: float, color: color);
    /// Worley's cellular texture.
    VoronoiTexture "voronoi_texture" { dimensions: Dimensions = Dimensions::Three, distance: DistanceMetric = DistanceMetric::Euclidean, feature: VoronoiFeature = VoronoiFeature::F1, normalize: bool = false }
        (vector: position, w: float 0.0, scale: float 5.0, detail: float 0.0, roughness: float 0.5, lacunarity: float 2.0, smoothness: float 1.0, exponent: float 0.5, randomness: float 1.0) -> (distance: float, color: color, position: vector, w: float, radius: float);
    /// Bands or rings.
    WaveTexture "wave_texture" { wave_type: WaveType = WaveType::Bands, bands_direction: BandsDirection = BandsDirection::X, rings_direction: RingsDirection = RingsDirection::X, wave_profile: WaveProfile = WaveProfile::Sine }
        (vector: position, scale: float 5.0, distortion: float 0.0, detail: float 2.0, detail_scale: float 1.0, detail_roughness: float 0.5, phase_offset: float 0.0) -> (color: color, factor: float);
    /// Nested sines: the magic texture.
    MagicTexture "magic_texture" { turbulence_depth: u32 = 2 } (vector: position, scale: float 5.0, distortion: float 1.0) -> (color: color, factor: float);
    /// A gradient.
    GradientTexture "gradient_texture" { gradient_type: GradientType = GradientType::Linear } (vector: position) -> (color: color, factor: float);
    /// A checkerboard of two colours.
    CheckerTexture "checker_texture" {} (vector: position, color1: color [0.8; 3], color2: color [0.2; 3], scale: float 5.0) -> (color: color, factor: float);
    /// A brick wall.
    BrickTexture "brick_texture" { offset: f32 = 0.5, offset_frequency: u32 = 2, squash: f32 = 1.0, squash_frequency: u32 = 2 }
        (vector: position, color1: color [0.8; 3], color2: color [0.2; 3], mortar: color [0.0; 3], scale: float 5.0, mortar_size: float 0.02, mortar_smooth: float 0.1, bias: float 0.0, brick_width: float 0.5, row_height: float 0.25) -> (color: color, factor: float);
    /// Colour of a black body by its temperature, kelvin.
    Blackbody "blackbody" {} (temperature: float 1500.0) -> (color: color);
    /// Colour of a wavelength, nanometres.
    Wavelength "wavelength" {} (wavelength: float 500.0) -> (color: color);
    /// Gabor noise in `2d` or `3d`; `orientation_2d` is an angle in radians, `orientation_3d` a direction.
    GaborTexture "gabor_texture" { dimensions: Dimensions = Dimensions::Two }
        (vector: position, scale: float 5.0, frequency: float 2.0, anisotropy: float 1.0, orientation_2d: float std::f32::consts::FRAC_PI_4, orientation_3d: vector [std::f32::consts::SQRT_2, std::f32::consts::SQRT_2, 0.0]) -> (value: float, phase: float, intensity: float);
    /// Independent random values.
    WhiteNoise "white_noise" { dimensions: Dimensions = Dimensions::Three } (vector: position, w: float 0.0) -> (value: float, color: color);
}
