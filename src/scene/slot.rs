//! Material parameters: slots that hold a constant times an optional texture, and the visitor over all parameters of a material.

use super::TextureId;

/// A colour: a constant, or a texture times the constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorSlot {
    /// Constant factor, linear RGB.
    pub factor: [f32; 3],
    /// Texture whose RGB is multiplied by it.
    pub texture: Option<TextureId>,
}

impl ColorSlot {
    /// A constant.
    pub const fn constant(rgb: [f32; 3]) -> ColorSlot {
        ColorSlot { factor: rgb, texture: None }
    }

    /// A texture as it is.
    pub const fn texture(id: TextureId) -> ColorSlot {
        ColorSlot { factor: [1.0; 3], texture: Some(id) }
    }
}

impl From<[f32; 3]> for ColorSlot {
    fn from(rgb: [f32; 3]) -> ColorSlot {
        ColorSlot::constant(rgb)
    }
}

impl From<f32> for FloatSlot {
    fn from(value: f32) -> FloatSlot {
        FloatSlot::constant(value)
    }
}

/// A number: a constant, or one channel of a texture times the constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloatSlot {
    /// Constant factor.
    pub factor: f32,
    /// Texture and which of its channels (0 red .. 3 alpha).
    pub texture: Option<(TextureId, u8)>,
}

impl FloatSlot {
    /// A constant.
    pub const fn constant(value: f32) -> FloatSlot {
        FloatSlot { factor: value, texture: None }
    }

    /// A channel of a texture as it is: 0 red .. 3 alpha.
    pub const fn texture(id: TextureId, channel: u8) -> FloatSlot {
        FloatSlot { factor: 1.0, texture: Some((id, channel)) }
    }
}

/// A tangent-space normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// RGB holds the normal as (n + 1) / 2, linear.
    pub texture: TextureId,
    /// Factor on its x and y.
    pub scale: f32,
}

/// A parameter of a material that a texture may change, or that a reader fills in.
#[derive(Clone, Copy, Debug)]
pub enum Parameter<'a> {
    /// A colour.
    Color(&'a ColorSlot),
    /// A number in a channel of a texture.
    Number(&'a FloatSlot),
    /// A texture in no slot.
    Texture(&'a TextureId),
    /// A number that is the same everywhere.
    Constant(&'a f32),
}

/// A [`Parameter`] to change.
#[derive(Debug)]
pub enum ParameterMut<'a> {
    /// A colour.
    Color(&'a mut ColorSlot),
    /// A number in a channel of a texture.
    Number(&'a mut FloatSlot),
    /// A texture in no slot.
    Texture(&'a mut TextureId),
    /// A number that is the same everywhere.
    Constant(&'a mut f32),
}

impl Parameter<'_> {
    /// The texture that it refers to.
    pub fn texture(self) -> Option<TextureId> {
        match self {
            Parameter::Color(slot) => slot.texture,
            Parameter::Number(slot) => slot.texture.map(|(id, _)| id),
            Parameter::Texture(id) => Some(*id),
            Parameter::Constant(_) => None,
        }
    }
}

impl<'a> ParameterMut<'a> {
    /// The texture that it refers to.
    pub fn texture(self) -> Option<&'a mut TextureId> {
        match self {
            ParameterMut::Color(slot) => slot.texture.as_mut(),
            ParameterMut::Number(slot) => slot.texture.as_mut().map(|(id, _)| id),
            ParameterMut::Texture(id) => Some(id),
            ParameterMut::Constant(_) => None,
        }
    }
}

/// Shows its parameters one after the other, each with the name of the field that holds it. What is no parameter (words,
/// choices, colours that no texture may change) shows none.
pub trait Parameters {
    /// Visits all; `name` is that of the field that holds it.
    fn visit(&self, _name: &'static str, _visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {}

    /// The same, to change them.
    fn visit_mut(&mut self, _name: &'static str, _visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {}
}

/// Implements [`Parameters`] for types that are one.
macro_rules! parameter {
    ($($type:ty => $kind:ident;)*) => {$(
        impl Parameters for $type {
            fn visit(&self, name: &'static str, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
                visitor(name, Parameter::$kind(self));
            }

            fn visit_mut(
                &mut self,
                name: &'static str,
                visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>),
            ) {
                visitor(name, ParameterMut::$kind(self));
            }
        }
    )*};
}

parameter! {
    ColorSlot => Color;
    FloatSlot => Number;
    TextureId => Texture;
    f32 => Constant;
}

impl Parameters for bool {}
impl Parameters for i32 {}
impl Parameters for u32 {}
impl Parameters for String {}
impl Parameters for [f32; 3] {}

impl<T: Parameters> Parameters for Option<T> {
    fn visit(&self, name: &'static str, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
        self.iter().for_each(|inner| inner.visit(name, visitor));
    }

    fn visit_mut(&mut self, name: &'static str, visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {
        self.iter_mut().for_each(|inner| inner.visit_mut(name, visitor));
    }
}

impl<T: Parameters> Parameters for Vec<T> {
    fn visit(&self, name: &'static str, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
        self.iter().for_each(|inner| inner.visit(name, visitor));
    }

    fn visit_mut(&mut self, name: &'static str, visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {
        self.iter_mut().for_each(|inner| inner.visit_mut(name, visitor));
    }
}

/// A texture and a channel.
impl Parameters for (TextureId, u8) {
    fn visit(&self, name: &'static str, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
        self.0.visit(name, visitor);
    }

    fn visit_mut(&mut self, name: &'static str, visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {
        self.0.visit_mut(name, visitor);
    }
}

/// Implements [`Parameters`] for structs, field by field. A field that is missing here does not compile.
macro_rules! parameters_of_fields {
    ($($type:ident { $($field:ident),* $(,)? })*) => {$(
        impl $crate::scene::Parameters for $type {
            fn visit(
                &self,
                _name: &'static str,
                visitor: &mut dyn FnMut(&'static str, $crate::scene::Parameter<'_>),
            ) {
                let $type { $($field),* } = self;
                $($field.visit(stringify!($field), visitor);)*
            }

            fn visit_mut(
                &mut self,
                _name: &'static str,
                visitor: &mut dyn FnMut(&'static str, $crate::scene::ParameterMut<'_>),
            ) {
                let $type { $($field),* } = self;
                $($field.visit_mut(stringify!($field), visitor);)*
            }
        }
    )*};
}
pub(super) use parameters_of_fields;

parameters_of_fields! {
    NormalMap { texture, scale }
}
