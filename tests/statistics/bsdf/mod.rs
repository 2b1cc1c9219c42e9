//! Every lobe and layered material: samples follow the density, weights are value over density, energy is kept, light
//! takes both ways alike where promised, nothing is NaN.

mod albedo;
mod chi_square;
mod dielectric_layers;
mod furnace;
mod gain;
mod lobes;
mod numbers;
mod reciprocity;
