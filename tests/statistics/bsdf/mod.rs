//! Every lobe and layered material: samples follow the pdf, weights are value over pdf, energy is conserved, reciprocity where
//! promised, nothing is NaN.

mod albedo;
mod chi_square;
mod dielectric_layers;
mod energy_gain;
mod finite_values;
mod furnace;
mod lobes;
mod reciprocity;
