//! `BroadPhase` over frames in which boxes move, leave, return and change their filters.

use crate::Fault;
use pbig_core::{Aabb, Backend, BroadPhase, Config, ProxyFilter};
use pbig_harness::boxes::moved;
use pbig_harness::follower::Follower;

/// Margins in the unit of the boxes: none, and one that most small motions stay within.
const MARGINS: [f32; 2] = [0.0, 0.05];

/// Plays the frames with each margin, and compares every frame with the oracle.
pub(crate) fn check(boxes: &[Aabb], backend: Backend, fault: Fault) -> Result<(), String> {
    for margin in MARGINS {
        let config = Config { backend, margin, ..Config::DEFAULT };
        let broad_phase = BroadPhase::new(config).map_err(|error| error.to_string())?;
        let mut world = Follower::new(broad_phase, boxes.len());
        world.spoil = Box::new(move |events| {
            fault.lose(Fault::AddedLost, &mut events.added);
            fault.lose(Fault::RemovedLost, &mut events.removed);
        });
        for (frame, play) in FRAMES.iter().enumerate() {
            play(&mut world, boxes)
                .and_then(|()| world.update())
                .map_err(|why| format!("margin {margin}, frame {frame}: {why}"))?;
        }
    }
    Ok(())
}

type Play = fn(&mut Follower, &[Aabb]) -> Result<(), String>;

/// The changes of each frame. Few boxes move in some frames and all in others, so that edits and rebuilds both run.
const FRAMES: [Play; 14] = [
    |world, boxes| world.set_all(boxes),
    |world, boxes| world.set_all(&moved(boxes, 0.02, 1)),
    |world, boxes| place(world, &moved(boxes, 0.2, 2), 40),
    |world, boxes| place(world, &moved(boxes, 1.5, 3), 50),
    |world, boxes| place(world, boxes, 60),
    |world, _| remove(world, 3),
    |_, _| Ok(()),
    |world, boxes| place(world, &moved(boxes, 2.0, 4), 6),
    |world, boxes| replace(world, &moved(boxes, 1.0, 5), 7),
    |world, _| remove(world, 70),
    |world, boxes| change_filters(world, boxes, 5),
    |world, boxes| world.set_all(&moved(boxes, 30.0, 6)),
    |world, boxes| world.set_all(boxes),
    |world, _| remove(world, 1),
];

/// Returns one id in `share`.
fn one_in(share: usize, boxes: usize) -> impl Iterator<Item = u32> {
    (0..boxes as u32).step_by(share)
}

/// Moves or inserts one box in `share`.
fn place(world: &mut Follower, boxes: &[Aabb], share: usize) -> Result<(), String> {
    one_in(share, boxes.len()).try_for_each(|id| world.set(id, boxes[id as usize], ProxyFilter::ALL))
}

/// Removes one box in `share`. Some are absent already, which `remove` must say.
fn remove(world: &mut Follower, share: usize) -> Result<(), String> {
    one_in(share, world.ids()).try_for_each(|id| world.remove(id))
}

/// Removes one box in `share` and sets another one at its id, before the same update.
fn replace(world: &mut Follower, boxes: &[Aabb], share: usize) -> Result<(), String> {
    remove(world, share)?;
    let filter = ProxyFilter { body: 1, ..ProxyFilter::ALL };
    one_in(share, boxes.len()).try_for_each(|id| world.set(id, boxes[id as usize], filter))
}

/// Sets one box in `share` with another filter.
fn change_filters(world: &mut Follower, boxes: &[Aabb], share: usize) -> Result<(), String> {
    one_in(share, boxes.len()).try_for_each(|id| {
        let filter = ProxyFilter { body: id % 3, ..ProxyFilter::ALL };
        world.set(id, boxes[id as usize], filter)
    })
}
