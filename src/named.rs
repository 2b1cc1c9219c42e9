//! Enums whose variants have names in files and on the command line.

/// Defines an enum by a table of `Variant = "name"`.
macro_rules! named_enum {
    ($(#[$attribute:meta])* $enum:ident { $($(#[$about:meta])* $variant:ident = $name:literal,)+ }) => {
        $(#[$attribute])*
        pub enum $enum {
            $($(#[$about])* $variant,)+
        }

        impl $enum {
            /// All variants.
            pub const ALL: [$enum; [$($name),+].len()] = [$($enum::$variant),+];

            /// All variants, by name.
            pub const NAMED: [(&'static str, $enum); $enum::ALL.len()] = [$(($name, $enum::$variant)),+];

            /// The variant with a name.
            pub fn from_name(name: &str) -> Option<$enum> {
                $enum::NAMED.into_iter().find(|(other, _)| *other == name).map(|(_, variant)| variant)
            }

            /// The name for users.
            pub const fn name(self) -> &'static str {
                match self {
                    $($enum::$variant => $name,)+
                }
            }
        }
    };
}
