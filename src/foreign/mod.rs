//! Libraries in other languages that are loaded while the program runs, if somebody asks for them. Building needs none.

pub mod oidn;
