//! Which object of the scene a primitive belongs to.

use crate::scene::Scene;

/// An object of a scene by number: instances, then quads, then shapes, then curves, in the order of their lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectId(pub u32);

/// Numbers the objects of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Numbering {
    instances: usize,
    quads: usize,
    shapes: usize,
}

impl Numbering {
    /// That of a scene.
    pub fn of(scene: &Scene) -> Numbering {
        Numbering { instances: scene.instances.len(), quads: scene.quads.len(), shapes: scene.shapes.len() }
    }

    /// The number of an instance.
    pub fn instance(&self, index: usize) -> ObjectId {
        ObjectId(index as u32)
    }

    /// The number of a quad.
    pub fn quad(&self, index: usize) -> ObjectId {
        ObjectId((self.instances + index) as u32)
    }

    /// The number of a shape.
    pub fn shape(&self, index: usize) -> ObjectId {
        ObjectId((self.instances + self.quads + index) as u32)
    }

    /// The number of curves.
    pub fn curves(&self, index: usize) -> ObjectId {
        ObjectId((self.instances + self.quads + self.shapes + index) as u32)
    }
}

impl ObjectId {
    /// All objects of a scene.
    pub fn all(scene: &Scene) -> impl Iterator<Item = ObjectId> + use<> {
        let count = scene.instances.len() + scene.quads.len() + scene.shapes.len() + scene.curves.len();
        (0..count as u32).map(ObjectId)
    }

    /// The object's name in the scene that it was compiled from; `None` if it is from another.
    pub fn name(self, scene: &Scene) -> Option<&str> {
        let index = self.0 as usize;
        if let Some(instance) = scene.instances.get(index) {
            return Some(&instance.name);
        }
        let index = index - scene.instances.len();
        if let Some(quad) = scene.quads.get(index) {
            return Some(&quad.name);
        }
        let index = index - scene.quads.len();
        if let Some(shape) = scene.shapes.get(index) {
            return Some(&shape.name);
        }
        scene.curves.get(index - scene.shapes.len()).map(|curves| curves.name.as_str())
    }
}

/// The objects of consecutive primitives: the first primitive of each run, by primitive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Owners(Vec<(u32, ObjectId)>);

impl Owners {
    /// Of no primitives.
    pub const EMPTY: Owners = Owners(Vec::new());

    /// The primitives from `first` on belong to an object; `first` grows from call to call.
    pub fn begin(&mut self, first: usize, object: ObjectId) {
        let first = first as u32;
        match self.0.last_mut() {
            // The run before was empty.
            Some(last) if last.0 == first => last.1 = object,
            _ => self.0.push((first, object)),
        }
    }

    /// The object that a primitive belongs to.
    pub fn of(&self, prim: u32) -> ObjectId {
        let run = self.0.partition_point(|&(first, _)| first <= prim);
        run.checked_sub(1).map_or(ObjectId(u32::MAX), |run| self.0[run].1)
    }

    /// The first primitive behind one that belongs to another object.
    pub fn end_of_run(&self, prim: u32) -> u32 {
        let next = self.0.partition_point(|&(first, _)| first <= prim);
        self.0.get(next).map_or(u32::MAX, |&(first, _)| first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_found_by_any_of_their_primitives() {
        let mut owners = Owners::default();
        for (first, object) in [(0, 5), (10, 6), (10, 7), (12, 2)] {
            owners.begin(first, ObjectId(object));
        }
        let found = [0, 9, 10, 11, 12, 1_000_000].map(|prim| owners.of(prim).0);
        assert_eq!(found, [5, 5, 7, 7, 2, 2]);
        assert_eq!([0, 9, 10, 12].map(|prim| owners.end_of_run(prim)), [10, 10, 12, u32::MAX]);
        assert_eq!(Owners::default().of(3), ObjectId(u32::MAX));
    }
}
