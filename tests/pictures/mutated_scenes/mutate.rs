//! Mutations of numbers, lists and other basic types.

use super::dice::Dice;
use oscura::color::spectral::{Curve, Metal};
use oscura::math::{DAffine3, DMat3, DQuat, DVec3, Vec2};
use oscura::output::ViewTransform;
use oscura::scene::f16;
use std::sync::Arc;

/// Something that can be mutated.
pub trait Mutate {
    /// A valid value.
    fn fresh(dice: &mut Dice) -> Self
    where
        Self: Sized;

    /// Mutates something in it.
    fn mutate(&mut self, dice: &mut Dice);
}

/// Numbers use a list of extremes.
macro_rules! numbers {
    ($($type:ty: $fresh:expr, $values:expr;)*) => {$(
        impl Mutate for $type {
            fn fresh(_: &mut Dice) -> $type {
                $fresh
            }

            fn mutate(&mut self, dice: &mut Dice) {
                let values: fn($type, &mut Dice) -> Vec<$type> = $values;
                let values = values(*self, dice);
                *self = dice.pick(&values);
                if stringify!($type).starts_with('f') {
                    dice.weigh(f64::from(*self as f32));
                }
                dice.note(format!("= {self:?}"));
            }
        }
    )*};
}

numbers! {
    f32: 0.5, |now, dice| vec![
        f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1.0, -1.0, 2.0, 0.999_999_94, 1.000_000_1, 1e38, -1e38,
        f32::MAX, f32::MIN, 1e-45, -1e-45, f32::MIN_POSITIVE, 1e18, 1e10, -1e5, 1e-10, 1e-20, -now, 2.0 * now,
        now * 1e-3, now * 1e4, dice.tame(), dice.tame(), dice.tame(),
    ];
    f64: 0.5, |now, dice| vec![
        f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 1.0, -1.0, 1e308, -1e308, f64::MAX, 1e154, -1e200, 1e38,
        1e39, 1e18, -1e19, 1e-45, 1e-308, 5e-324, -5e-324, 1e10, -1e6, 1e-10, std::f64::consts::PI,
        std::f64::consts::FRAC_PI_2, -now, 2.0 * now, now * 1e-3, now * 1e4, dice.tame().into(), dice.tame().into(),
        dice.tame().into(),
    ];
    i32: 1, |now, _| vec![0, 1, -1, 1000, i32::MIN, i32::MAX, now.wrapping_add(1), now.wrapping_neg()];
    u32: 1, |now, _| vec![
        0, 1, 2, 3, 4, 5, 7, 64, 1000, 65_535, 65_536, 1 << 24, i32::MAX as u32, 1 << 31, u32::MAX - 1, u32::MAX,
        now.wrapping_add(1), now.wrapping_sub(1), now / 2, now.wrapping_mul(2),
    ];
    u16: 30_000, |_, _| vec![0, 1, 32_767, 65_535];
    u8: 1, |_, _| vec![0, 1, 2, 3, 4, 7, 128, 255];
}

impl Mutate for f16 {
    fn fresh(_: &mut Dice) -> f16 {
        f16::ONE
    }

    fn mutate(&mut self, dice: &mut Dice) {
        *self =
            dice.pick(&[f16::ZERO, f16::NAN, f16::INFINITY, f16::MAX, f16::MIN, f16::NEG_ONE, f16::EPSILON]);
        dice.note(format!("= {self:?}"));
    }
}

impl Mutate for bool {
    fn fresh(_: &mut Dice) -> bool {
        false
    }

    fn mutate(&mut self, dice: &mut Dice) {
        *self = !*self;
        dice.note(format!("= {self}"));
    }
}

impl Mutate for Metal {
    fn fresh(_: &mut Dice) -> Metal {
        Metal::named("gold").expect("it is known")
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let named = ["silver", "copper", "titanium-nitride"].map(Metal::named);
        *self = dice.pick(&named).expect("they are known");
        dice.note(format!("= {self:?}"));
    }
}

impl Mutate for ViewTransform {
    fn fresh(_: &mut Dice) -> ViewTransform {
        ViewTransform::Agx
    }

    fn mutate(&mut self, dice: &mut Dice) {
        *self = dice.pick(&ViewTransform::NAMED.map(|named| named.0));
        dice.note(format!("= {self:?}"));
    }
}

impl Mutate for Curve {
    fn fresh(_: &mut Dice) -> Curve {
        Curve::reflectance(&[(400.0, 0.2), (700.0, 0.8)])
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let luminance = dice.pick(&[0.0, 1e-30, 1.0, 1e9]);
        *self = match dice.below(3) {
            0 => Curve::light(&[(500.0, 0.0), (501.0, 1.0), (502.0, 0.0)], luminance),
            1 => Curve::black_body(dice.pick(&[100.0, 2700.0, 1e5]), luminance),
            _ => Curve::reflectance(&[(1.0, 0.0)]),
        };
        dice.note(format!("= a curve of luminance {luminance}"));
    }
}

impl Mutate for String {
    fn fresh(_: &mut Dice) -> String {
        "fresh".into()
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let list = ["", "\0", "a\nb\r\t", "\u{feff}ü\u{1f600}\u{202e}", "'\"{}%s"];
        *self = dice.pick(&list).to_string();
        if dice.once_in(8) {
            *self = "x".repeat(10_000);
        }
        dice.note(format!("= {:.40?}", self));
    }
}

/// Lists longer than this do not grow.
const LONGEST: usize = 3000;

impl<T: Mutate + Clone> Mutate for Vec<T> {
    fn fresh(dice: &mut Dice) -> Vec<T> {
        vec![T::fresh(dice)]
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let length = self.len();
        let action = if length == 0 { 1 } else { dice.below(12) };
        match action {
            0 => {
                self.clear();
                dice.note("cleared");
            }
            1 if length < LONGEST => {
                self.push(T::fresh(dice));
                dice.note("one pushed");
            }
            2 => {
                self.truncate(dice.below(length));
                dice.note(format!("cut to {}", self.len()));
            }
            3 if length < LONGEST => {
                let copy = self[dice.below(length)].clone();
                self.push(copy);
                dice.note("one pushed again");
            }
            4 => {
                let (a, b) = (dice.below(length), dice.below(length));
                self.swap(a, b);
                dice.note(format!("{a} and {b} swapped"));
            }
            _ => {
                let index = dice.below(length);
                dice.at(format!("[{index}]"), |dice| self[index].mutate(dice));
            }
        }
    }
}

impl<T: Mutate, const N: usize> Mutate for [T; N] {
    fn fresh(dice: &mut Dice) -> [T; N] {
        std::array::from_fn(|_| T::fresh(dice))
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let all = dice.once_in(4);
        let one = dice.below(N);
        for (i, entry) in self.iter_mut().enumerate().filter(|(i, _)| all || *i == one) {
            dice.at(format!("[{i}]"), |dice| entry.mutate(dice));
        }
    }
}

impl<T: Mutate> Mutate for Option<T> {
    fn fresh(_: &mut Dice) -> Option<T> {
        None
    }

    fn mutate(&mut self, dice: &mut Dice) {
        match self {
            Some(_) if dice.once_in(5) => {
                *self = None;
                dice.note("= None");
            }
            Some(inner) => inner.mutate(dice),
            None => {
                *self = Some(T::fresh(dice));
                dice.note("= Some");
                if let (Some(inner), true) = (self, dice.once_in(2)) {
                    inner.mutate(dice);
                }
            }
        }
    }
}

impl<T: Mutate> Mutate for Box<T> {
    fn fresh(dice: &mut Dice) -> Box<T> {
        Box::new(T::fresh(dice))
    }

    fn mutate(&mut self, dice: &mut Dice) {
        (**self).mutate(dice);
    }
}

impl<T: Mutate + Clone> Mutate for Arc<T> {
    fn fresh(dice: &mut Dice) -> Arc<T> {
        Arc::new(T::fresh(dice))
    }

    fn mutate(&mut self, dice: &mut Dice) {
        Arc::make_mut(self).mutate(dice);
    }
}

impl<T: Mutate + Clone> Mutate for Arc<[T]> {
    fn fresh(dice: &mut Dice) -> Arc<[T]> {
        Vec::fresh(dice).into()
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let mut list = self.to_vec();
        list.mutate(dice);
        *self = list.into();
    }
}

impl<A: Mutate, B: Mutate> Mutate for (A, B) {
    fn fresh(dice: &mut Dice) -> (A, B) {
        (A::fresh(dice), B::fresh(dice))
    }

    fn mutate(&mut self, dice: &mut Dice) {
        fields(dice, &mut [(".0", &mut self.0), (".1", &mut self.1)]);
    }
}

/// Types that convert to arrays change as these.
macro_rules! as_arrays {
    ($($type:ty: $fresh:expr, $to:ident, $from:ident;)*) => {$(
        impl Mutate for $type {
            fn fresh(_: &mut Dice) -> $type {
                $fresh
            }

            fn mutate(&mut self, dice: &mut Dice) {
                let mut array = self.$to();
                array.mutate(dice);
                *self = <$type>::$from(array);
            }
        }
    )*};
}

as_arrays! {
    Vec2: Vec2::ONE, to_array, from;
    DVec3: DVec3::ONE, to_array, from;
    DQuat: DQuat::IDENTITY, to_array, from_array;
}

impl Mutate for DAffine3 {
    fn fresh(_: &mut Dice) -> DAffine3 {
        DAffine3::IDENTITY
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let scale = dice.pick(&[0.0, -1.0, 1e-20, 1e20, 1e-200, 1e200, 1e-3, 1e3]);
        match dice.below(6) {
            0 => self.matrix3.x_axis *= scale,
            1 => self.matrix3 *= scale,
            2 => self.matrix3.y_axis = self.matrix3.x_axis + self.matrix3.y_axis * scale,
            3 => self.matrix3 = DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z),
            4 => return dice.at(".translation", |dice| self.translation.mutate(dice)),
            _ => {
                let mut columns = self.to_cols_array();
                dice.at(".to_cols_array", |dice| columns.mutate(dice));
                *self = DAffine3::from_cols_array(&columns);
            }
        }
        self.to_cols_array().into_iter().for_each(|x| dice.weigh(x));
        dice.note(format!("= {:?}", self.to_cols_array()));
    }
}

/// Mutates one field of a struct.
pub fn fields(dice: &mut Dice, list: &mut [(&'static str, &mut dyn Mutate)]) {
    let (name, field) = &mut list[dice.below(list.len())];
    dice.at(*name, |dice| field.mutate(dice));
}

/// Implements [`Mutate`] for structs, field by field: a field that is missing here does not compile.
macro_rules! structs {
    ($($type:ident { $($field:ident),* $(,)? })*) => {$(
        impl Mutate for $type {
            fn fresh(dice: &mut Dice) -> $type {
                $type { $($field: Mutate::fresh(dice)),* }
            }

            fn mutate(&mut self, dice: &mut Dice) {
                let $type { $($field),* } = self;
                fields(dice, &mut [$((concat!(".", stringify!($field)), $field)),*]);
            }
        }
    )*};
}
pub(super) use structs;

/// Implements [`Mutate`] for enums, variant by variant: those with named fields, then those that hold one value.
macro_rules! enums {
    ($($type:ident { $($variant:ident { $($field:ident),* })* } { $($tuple:ident)* })*) => {$(
        impl Mutate for $type {
            fn fresh(dice: &mut Dice) -> $type {
                let all: &[fn(&mut Dice) -> $type] = &[
                    $(|_dice| $type::$variant { $($field: Mutate::fresh(_dice)),* },)*
                    $(|dice| $type::$tuple(Mutate::fresh(dice)),)*
                ];
                dice.pick(all)(dice)
            }

            fn mutate(&mut self, dice: &mut Dice) {
                if dice.once_in(4) {
                    *self = $type::fresh(dice);
                    let debug = format!("{self:?}");
                    dice.note(format!("= {debug:.60}"));
                    return;
                }
                #[allow(unreachable_patterns, reason = "some enums may grow")]
                match self {
                    $($type::$variant { $($field),* } => {
                        let list: &mut [(&'static str, &mut dyn Mutate)] =
                            &mut [$((concat!(".", stringify!($variant), ".", stringify!($field)), $field)),*];
                        if !list.is_empty() {
                            fields(dice, list);
                        }
                    })*
                    $($type::$tuple(inner) => {
                        dice.at(concat!(".", stringify!($tuple)), |dice| inner.mutate(dice));
                    })*
                    other => panic!("{other:?} is missing in the table of enums"),
                }
            }
        }
    )*};
}
pub(super) use enums;
