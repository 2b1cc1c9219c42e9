//! Arguments that are one of some names of the library's.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// One of `all`, by its name; `about` says what it is, where that is not empty.
pub(super) fn named<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
    about: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let value = move |&one: &T| match about(one) {
        "" => PossibleValue::new(name(one)),
        about => PossibleValue::new(name(one)).help(about),
    };
    let parser = PossibleValuesParser::new(all.iter().map(value));
    parser.try_map(move |text| all.iter().copied().find(|&one| name(one) == text).ok_or("is no such name"))
}
