//! All pairs of boxes: by brute force, a grid, a tree, streamed segment trees, or a device.
//!
//! ```text
//! request ─► all_pairs ─► brute | grid | join (a tree with itself) | streamed | device ─► hits: a list for each thread
//! ```
//!
//! A grid and a join have a budget. One that spends it is dropped, and the next way begins anew.

mod all_pairs;
mod brute;
mod budget;
mod device_slot;
pub(crate) mod grid;
mod hits;
mod join;
mod streamed;

pub(crate) use all_pairs::{AllPairs, Request, Store};
pub(crate) use budget::Budget;
pub(crate) use device_slot::DeviceSlot;
pub(crate) use hits::{ById, Receiver};
