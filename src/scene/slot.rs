//! Material parameters: slots that hold a constant times an optional texture, and the visitor over all parameters of a material.

use super::TextureId;

/// A colour: a constant, or a texture times the constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorSlot {
    /// Constant factor, linear RGB.
    pub factor: [f32; 3],
    /// Texture whose RGB is multiplied by the factor.
    pub texture: Option<TextureId>,
}

impl ColorSlot {
    /// A constant.
    pub const fn constant(rgb: [f32; 3]) -> ColorSlot {
        ColorSlot { factor: rgb, texture: None }
    }

    /// An unscaled texture.
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
    /// Texture and channel (0 red to 3 alpha).
    pub texture: Option<(TextureId, u8)>,
}

impl FloatSlot {
    /// A constant.
    pub const fn constant(value: f32) -> FloatSlot {
        FloatSlot { factor: value, texture: None }
    }

    /// An unscaled channel (0 red to 3 alpha) of a texture.
    pub const fn texture(id: TextureId, channel: u8) -> FloatSlot {
        FloatSlot { factor: 1.0, texture: Some((id, channel)) }
    }
}

/// A tangent-space normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Normal as (n + 1) / 2 in linear RGB.
    pub texture: TextureId,
    /// Factor on the normal's x and y.
    pub scale: f32,
}

/// A reference to a texturable or numeric material parameter.
#[derive(Clone, Copy, Debug)]
pub enum Parameter<'a> {
    /// A colour.
    Color(&'a ColorSlot),
    /// A number with an optional texture channel.
    Number(&'a FloatSlot),
    /// A texture outside a slot.
    Texture(&'a TextureId),
    /// A number that can't be textured.
    Constant(&'a f32),
}

/// A mutable [`Parameter`].
#[derive(Debug)]
pub enum ParameterMut<'a> {
    /// A colour.
    Color(&'a mut ColorSlot),
    /// A number with an optional texture channel.
    Number(&'a mut FloatSlot),
    /// A texture outside a slot.
    Texture(&'a mut TextureId),
    /// A number that can't be textured.
    Constant(&'a mut f32),
}

impl Parameter<'_> {
    /// Texture of the parameter.
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
    /// Texture of the parameter.
    pub fn texture(self) -> Option<&'a mut TextureId> {
        match self {
            ParameterMut::Color(slot) => slot.texture.as_mut(),
            ParameterMut::Number(slot) => slot.texture.as_mut().map(|(id, _)| id),
            ParameterMut::Texture(id) => Some(id),
            ParameterMut::Constant(_) => None,
        }
    }
}

/// Visitor over material parameters with the names of their fields. Other types (strings, enums, untextured colours) visit none.
pub trait Parameters {
    /// Visits all parameters; `name` is the field of `self` in its parent.
    fn visit(&self, _name: &'static str, _visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {}

    /// Visits all parameters mutably.
    fn visit_mut(&mut self, _name: &'static str, _visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {}
}

/// Implements [`Parameters`] for types that are a single parameter.
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

/// Implements [`Parameters`] for structs, field by field. All fields must be listed.
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
