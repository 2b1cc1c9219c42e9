//! The macro that generates the enums over all BSDFs, with static dispatch, from one table.

/// Generates `Bsdf`, `BsdfClass` and `BsdfProgram` from a table. Each row names a [`super::Lobe`] and its [`super::MaterialProgram`]
/// with their modules; rows under `transmissive` also implement [`super::Transmissive`]. `Black` is predefined.
macro_rules! bsdfs {
    (
        opaque {$(
            $(#[$opaque_doc:meta])*
            $opaque_file:ident::$opaque:ident($opaque_program_file:ident::$opaque_program:ident),
        )*}
        transmissive {$(
            $(#[$doc:meta])*
            $file:ident::$transmissive:ident($program_file:ident::$program:ident),
        )*}
    ) => {
        $(pub use $opaque_file::$opaque;)*
        $(pub use $opaque_program_file::$opaque_program;)*
        $(pub use $file::$transmissive;)*
        $(pub use $program_file::$program;)*

        /// A BSDF at a hit.
        #[derive(Clone, Copy, Debug)]
        pub enum Bsdf {
            /// Absorbs everything.
            Black,
            $($(#[$opaque_doc])* $opaque($opaque),)*
            $($(#[$doc])* $transmissive($transmissive),)*
        }

        /// The type of a material's BSDF, independent of textures.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum BsdfClass {
            /// [`Bsdf::Black`].
            Black,
            $($(#[$opaque_doc])* $opaque,)*
            $($(#[$doc])* $transmissive,)*
        }

        /// The compiled BSDF of a material: its parameters as constants or textures with factors.
        #[derive(Clone, Copy, Debug)]
        #[allow(clippy::large_enum_variant, reason = "one per material")]
        pub enum BsdfProgram {
            /// [`Bsdf::Black`].
            Black,
            $($(#[$opaque_doc])* $opaque($opaque_program),)*
            $($(#[$doc])* $transmissive($program),)*
        }

        $(impl From<$opaque_program> for BsdfProgram {
            fn from(program: $opaque_program) -> BsdfProgram {
                BsdfProgram::$opaque(program)
            }
        })*
        $(impl From<$program> for BsdfProgram {
            fn from(program: $program) -> BsdfProgram {
                BsdfProgram::$transmissive(program)
            }
        })*

        impl BsdfProgram {
            /// The type of the BSDF.
            pub fn class(&self) -> BsdfClass {
                match self {
                    BsdfProgram::Black => BsdfClass::Black,
                    $(BsdfProgram::$opaque(_) => BsdfClass::$opaque,)*
                    $(BsdfProgram::$transmissive(_) => BsdfClass::$transmissive,)*
                }
            }

            /// Evaluates the parameters at a hit. Colours and numbers are clamped to 0..1.
            #[inline]
            pub fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Bsdf {
                match self {
                    BsdfProgram::Black => Bsdf::Black,
                    $(BsdfProgram::$opaque(program) => Bsdf::$opaque(program.evaluate(slots, frame)),)*
                    $(BsdfProgram::$transmissive(program) => {
                        Bsdf::$transmissive(program.evaluate(slots, frame))
                    })*
                }
            }

            pub fn may_transmit_unscattered(&self) -> bool {
                match self {
                    BsdfProgram::Black => false,
                    $(BsdfProgram::$opaque(program) => program.may_transmit_unscattered(),)*
                    $(BsdfProgram::$transmissive(program) => program.may_transmit_unscattered(),)*
                }
            }

            pub fn is_smooth_glass(&self) -> bool {
                match self {
                    BsdfProgram::Black => false,
                    $(BsdfProgram::$opaque(program) => program.is_smooth_glass(),)*
                    $(BsdfProgram::$transmissive(program) => program.is_smooth_glass(),)*
                }
            }

            pub fn depends_on_wavelength(&self) -> bool {
                match self {
                    BsdfProgram::Black => false,
                    $(BsdfProgram::$opaque(program) => program.depends_on_wavelength(),)*
                    $(BsdfProgram::$transmissive(program) => program.depends_on_wavelength(),)*
                }
            }
        }

        impl BsdfClass {
            /// Whether the BSDF may refract; see [`Transmissive::REFRACTS`].
            pub fn refracts(self) -> bool {
                match self {
                    BsdfClass::Black => false,
                    $(BsdfClass::$opaque => false,)*
                    $(BsdfClass::$transmissive => <$transmissive as Transmissive>::REFRACTS,)*
                }
            }
        }

        impl Bsdf {
            /// Samples a direction by random numbers in 0..1: `u[2]` selects the lobe, `u[0]` and `u[1]` the direction.
            #[inline]
            pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
                let wo = without_negative_zero(wo);
                match self {
                    Bsdf::Black => BsdfSample::ABSORBED,
                    $(Bsdf::$opaque(lobe) => lobe.sample(wo, u),)*
                    $(Bsdf::$transmissive(lobe) => lobe.sample(wo, u),)*
                }
            }

            /// Value and pdf of a pair of directions; specular lobes count as zero.
            #[inline]
            pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
                let (wo, wi) = (without_negative_zero(wo), without_negative_zero(wi));
                match self {
                    Bsdf::Black => BsdfEval::ZERO,
                    $(Bsdf::$opaque(lobe) => lobe.eval(wo, wi),)*
                    $(Bsdf::$transmissive(lobe) => lobe.eval(wo, wi),)*
                }
            }

            /// Whether all samples are specular, so that light sampling contributes nothing.
            #[inline]
            pub fn is_specular(&self) -> bool {
                match self {
                    Bsdf::Black => true,
                    $(Bsdf::$opaque(lobe) => lobe.is_specular(),)*
                    $(Bsdf::$transmissive(lobe) => lobe.is_specular(),)*
                }
            }

            #[inline]
            pub fn is_diffuse_base(&self) -> bool {
                match self {
                    Bsdf::Black => false,
                    $(Bsdf::$opaque(lobe) => lobe.is_diffuse_base(),)*
                    $(Bsdf::$transmissive(lobe) => lobe.is_diffuse_base(),)*
                }
            }

            /// Whether there may be non-specular transmission; see [`Transmissive::HAS_SCATTERED_TRANSMISSION`].
            #[inline(always)]
            pub fn has_scattered_transmission(&self) -> bool {
                match self {
                    Bsdf::Black => false,
                    $(Bsdf::$opaque(_) => false,)*
                    $(Bsdf::$transmissive(_) => <$transmissive as Transmissive>::HAS_SCATTERED_TRANSMISSION,)*
                }
            }

            /// See [`Transmissive::SIDES_MAY_SWAP`].
            #[inline]
            pub fn sides_may_swap(&self) -> bool {
                match self {
                    Bsdf::Black => false,
                    $(Bsdf::$opaque(_) => false,)*
                    $(Bsdf::$transmissive(_) => <$transmissive as Transmissive>::SIDES_MAY_SWAP,)*
                }
            }

            /// Multiplies the base colour (by vertex colours).
            #[inline]
            pub fn tinted(self, color: Rgb) -> Bsdf {
                match self {
                    Bsdf::Black => Bsdf::Black,
                    $(Bsdf::$opaque(lobe) => Bsdf::$opaque(lobe.tinted(color)),)*
                    $(Bsdf::$transmissive(lobe) => Bsdf::$transmissive(lobe.tinted(color)),)*
                }
            }

            /// Replaces the index of refraction of glass: see [`Transmissive::with_ior`].
            #[inline]
            pub fn with_ior(self, ior: f32) -> Bsdf {
                match self {
                    Bsdf::Black => Bsdf::Black,
                    $(Bsdf::$opaque(lobe) => Bsdf::$opaque(lobe),)*
                    $(Bsdf::$transmissive(lobe) => Bsdf::$transmissive(lobe.with_ior(ior)),)*
                }
            }

            pub fn transmission_tint(&self) -> Rgb {
                match self {
                    Bsdf::Black => Rgb::ONE,
                    $(Bsdf::$opaque(_) => Rgb::ONE,)*
                    $(Bsdf::$transmissive(lobe) => lobe.transmission_tint(),)*
                }
            }

            pub fn straight(&self, wo: Vec3) -> Rgb {
                match self {
                    Bsdf::Black => Rgb::ZERO,
                    $(Bsdf::$opaque(_) => Rgb::ZERO,)*
                    $(Bsdf::$transmissive(lobe) => lobe.straight(without_negative_zero(wo)),)*
                }
            }

            pub fn appearance(&self) -> Appearance {
                match self {
                    Bsdf::Black => Appearance::BLACK,
                    $(Bsdf::$opaque(lobe) => lobe.appearance(),)*
                    $(Bsdf::$transmissive(lobe) => lobe.appearance(),)*
                }
            }

            pub fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
                let (wo, wi) = (without_negative_zero(wo), without_negative_zero(wi));
                match self {
                    Bsdf::Black => Rgb::ZERO,
                    $(Bsdf::$opaque(lobe) => lobe.diffuse_part(wo, wi),)*
                    $(Bsdf::$transmissive(lobe) => lobe.diffuse_part(wo, wi),)*
                }
            }

            #[inline]
            pub fn albedo(&self) -> Rgb {
                match self {
                    Bsdf::Black => Rgb::ZERO,
                    $(Bsdf::$opaque(lobe) => lobe.albedo(),)*
                    $(Bsdf::$transmissive(lobe) => lobe.albedo(),)*
                }
            }
        }
    };
}
pub(super) use bsdfs;
