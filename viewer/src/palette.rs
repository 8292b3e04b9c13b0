//! The colour of each object.

use clap::ValueEnum;
use pbig_scenes::drawn::Colour;
use pbig_scenes::world::World;
use rapier3d::prelude::*;

/// The property that an object's colour shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Colouring {
    /// By their shape.
    #[default]
    Shape,
    /// By the number of objects that they touch.
    Contacts,
    /// Sleeping ones apart from awake ones.
    Sleeping,
}

/// A colour: red, green and blue from 0 to 1.
pub type Rgb = [f32; 3];

/// Objects of fixed bodies.
const FIXED: Rgb = [0.42, 0.44, 0.48];
/// Awake objects.
const AWAKE: Rgb = [0.95, 0.55, 0.18];
/// Sleeping objects.
const SLEEPING: Rgb = [0.22, 0.40, 0.72];
/// From no contact to the most: dark blue, teal, yellow, red.
const CONTACT_SCALE: [Rgb; 4] =
    [[0.16, 0.24, 0.50], [0.12, 0.60, 0.60], [0.95, 0.80, 0.25], [0.86, 0.20, 0.16]];
/// The number of contacts at the end of the scale.
const MOST_CONTACTS: f32 = 8.0;

impl Colouring {
    /// Every colouring, in the order of the key.
    pub const ALL: [Self; 3] = [Self::Shape, Self::Contacts, Self::Sleeping];

    /// Returns the one after this one; after the last comes the first.
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }

    /// Returns the legend.
    pub const fn legend(self) -> &'static str {
        match self {
            Self::Shape => "colour: shape",
            Self::Contacts => "colour: contacts, none (blue) to 8 or more (red)",
            Self::Sleeping => "colour: awake (orange), sleeping (blue)",
        }
    }
}

/// The state on which colours depend, gathered once a frame.
pub struct Palette<'a> {
    colouring: Colouring,
    world: &'a World,
    /// Objects touched, by the index of a collider; empty if the colouring does not need it.
    contacts: Vec<u32>,
}

impl<'a> Palette<'a> {
    /// Gathers what this colouring needs.
    pub fn new(colouring: Colouring, world: &'a World) -> Self {
        let contacts = if colouring == Colouring::Contacts { count_contacts(world) } else { Vec::new() };
        Self { colouring, world, contacts }
    }

    /// Returns the colour of a part of a collider, by its colour class.
    pub fn colour(&self, handle: ColliderHandle, collider: &Collider, class: Colour) -> Rgb {
        let body = collider.parent().and_then(|body| self.world.bodies.get(body));
        let Some(body) = body.filter(|body| !body.is_fixed()) else { return FIXED };
        match self.colouring {
            Colouring::Shape => by_shape(class, handle.into_raw_parts().0),
            Colouring::Contacts => self.by_contacts(handle),
            Colouring::Sleeping if body.is_sleeping() => SLEEPING,
            Colouring::Sleeping => AWAKE,
        }
    }

    fn by_contacts(&self, handle: ColliderHandle) -> Rgb {
        let count = self.contacts.get(handle.into_raw_parts().0 as usize).copied().unwrap_or(0);
        gradient(&CONTACT_SCALE, count as f32 / MOST_CONTACTS)
    }
}

/// Counts the objects that each collider touches, by its index.
fn count_contacts(world: &World) -> Vec<u32> {
    let mut counts = Vec::new();
    for pair in world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact) {
        for handle in [pair.collider1, pair.collider2] {
            let index = handle.into_raw_parts().0 as usize;
            if counts.len() <= index {
                counts.resize(index + 1, 0);
            }
            counts[index] += 1;
        }
    }
    counts
}

/// Returns a colour for each kind of shape, a little lighter or darker by the collider's index, so that neighbours differ.
fn by_shape(class: Colour, index: u32) -> Rgb {
    let base = match class {
        Colour::Fixed => FIXED,
        Colour::Ball => [0.92, 0.36, 0.22],
        Colour::Cuboid => [0.20, 0.52, 0.82],
        Colour::Slab => [0.96, 0.74, 0.22],
        Colour::Capsule => [0.24, 0.68, 0.46],
        Colour::Other => [0.62, 0.40, 0.76],
    };
    let light = 0.86 + 0.07 * (index % 5) as f32;
    base.map(|part| (part * light).min(1.0))
}

/// Returns the colour at a place of a scale, from 0 to 1.
fn gradient(scale: &[Rgb], at: f32) -> Rgb {
    let at = at.clamp(0.0, 1.0) * (scale.len() - 1) as f32;
    let low = (at as usize).min(scale.len() - 2);
    let share = at - low as f32;
    std::array::from_fn(|i| scale[low][i] + share * (scale[low + 1][i] - scale[low][i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::Choice;
    use crate::simulation::{Setting, Simulation};
    use pbig_scenes::scenes::Scene;

    fn colours(scene: &str, steps: usize, colouring: Colouring) -> Vec<Rgb> {
        let setting = Setting { scene: Scene::named(scene).unwrap(), bodies: 300, seed: 1 };
        let mut simulation = Simulation::new(setting, Choice::Cpu);
        (0..steps).for_each(|_| simulation.step());
        let palette = Palette::new(colouring, &simulation.world);
        let bodies = simulation.world.colliders.iter().filter(|(_, collider)| collider.parent().is_some());
        bodies.map(|(handle, collider)| palette.colour(handle, collider, Colour::Ball)).collect()
    }

    fn share(colours: &[Rgb], is: impl Fn(&Rgb) -> bool) -> f64 {
        colours.iter().filter(|colour| is(colour)).count() as f64 / colours.len() as f64
    }

    #[test]
    fn contacts_are_none_in_the_air_and_many_in_a_pile() {
        let air = colours("column", 1, Colouring::Contacts);
        assert!(share(&air, |&c| c == CONTACT_SCALE[0]) > 0.9, "few touch at the start");
        let pile = colours("column", 200, Colouring::Contacts);
        assert!(share(&pile, |&c| c == CONTACT_SCALE[0]) < 0.5, "most touch something");
    }

    #[test]
    fn sleeping_objects_have_their_own_colour() {
        assert_eq!(share(&colours("pile", 1, Colouring::Sleeping), |&c| c == AWAKE), 1.0);
        assert!(share(&colours("pile", 600, Colouring::Sleeping), |&c| c == SLEEPING) > 0.5);
    }

    #[test]
    fn a_gradient_meets_its_colours() {
        assert_eq!(gradient(&CONTACT_SCALE, 0.0), CONTACT_SCALE[0]);
        let end = gradient(&CONTACT_SCALE, 9.0);
        assert!((0..3).all(|i| (end[i] - CONTACT_SCALE[3][i]).abs() < 1e-6), "{end:?}");
        let middle = gradient(&[[0.0; 3], [1.0, 0.5, 0.0]], 0.5);
        assert_eq!(middle, [0.5, 0.25, 0.0]);
    }
}
