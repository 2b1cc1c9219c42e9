//! Mutations of motion.

use super::dice::Dice;
use super::mutate::{Mutate, fields, structs};
use oscura::scene::{Keyframes, SceneMotion, Vertices};
use std::collections::BTreeMap;

structs! {
    SceneMotion { instances, meshes, quads, shapes }
    Vertices { positions, normals }
}

impl<T: Mutate + Clone> Mutate for Keyframes<T> {
    fn fresh(dice: &mut Dice) -> Keyframes<T> {
        Keyframes { keys: vec![T::fresh(dice), T::fresh(dice)], neighbours: None }
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let Keyframes { keys, neighbours } = self;
        fields(dice, &mut [(".keys", keys), (".neighbours", neighbours)]);
    }
}

/// Entries by the index of their object.
impl<T: Mutate> Mutate for BTreeMap<usize, T> {
    fn fresh(dice: &mut Dice) -> BTreeMap<usize, T> {
        BTreeMap::from([(0, T::fresh(dice))])
    }

    fn mutate(&mut self, dice: &mut Dice) {
        let index = dice.below(4);
        match self.get_mut(&index) {
            Some(entry) => dice.at(format!("[{index}]"), |dice| entry.mutate(dice)),
            None => {
                self.insert(index, T::fresh(dice));
                dice.note(format!("[{index}] inserted"));
            }
        }
    }
}
