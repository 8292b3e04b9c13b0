//! pbig finds every pair of overlapping axis-aligned boxes, and never misses one.
//!
//! The ways in, from simple to fast:
//!
//! | you have | use |
//! | --- | --- |
//! | a list of boxes, once | [`find_pairs`] |
//! | a new list every time | [`Finder`], which keeps its buffers |
//! | two sets of boxes, and only pairs across | [`Finder::find_between`] |
//! | a mesh, and no pairs of neighbours | [`Finder::find_without_shared`] |
//! | more pairs than a list should hold | [`Finder::for_each_pair`] |
//! | boxes that move a little, come and go | [`BroadPhase`], which tells what changed |
//! | rays, moving boxes or points that meet boxes | [`BoxIndex`] |
//!
//! ```
//! use pbig_core::{find_pairs, Aabb, Pair};
//!
//! let boxes = [
//!     Aabb::new([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
//!     Aabb::new([1.0, 0.5, 0.5], [2.0, 1.5, 1.5]), // touches the first
//!     Aabb::new([5.0, 5.0, 5.0], [6.0, 6.0, 6.0]),
//! ];
//! assert_eq!(find_pairs(&boxes)?, [Pair::new(0, 1)]);
//! # Ok::<(), pbig_core::Error>(())
//! ```
//!
//! # Should I use this?
//!
//! For rapier worlds use the crate `rapier-pbig`, which feeds colliders to this one. Use this crate
//! for boxes of your own: from ten to a hundred million, of any mix of sizes, anywhere in f32. It
//! knows no shapes.
//!
//! Another processor, such as the GPU of the crate `pbig-gpu`, finds pairs behind the trait [`PairDevice`].
//!
//! # What is guaranteed
//!
//! * Two valid boxes pair when `a.min <= b.max && b.min <= a.max` on all three axes, in f32, exactly, as
//!   [`oracle`] defines it. The pairs are the same for every backend and thread count, and so is their order unless
//!   [`Order::Unspecified`] is asked for. The threads are the calling one and those of its rayon pool.
//! * A call is complete or an [`Error`]; there are no partial results.
//! * A box with a NaN, or with `min > max`, is invalid: it pairs with nothing and harms no other box.
//!   ([`Aabb::overlaps`] compares corners only, and is true for some inverted boxes.)
//!
//! # Sources
//!
//! Lo, Lee, Chung, Chung: "Optimizing Pairwise Box Intersection Checking on GPUs for Large-Scale
//! Simulations", ACM TOMACS 23(3), 2013 (*PBIG*). Avril, Gouranton, Arnaldi: "Fast Collision
//! Culling in Large-Scale Environments Using GPU Mapping Function", EGPGV 2012 (*Avril*).

// Labels each item in the documentation with the feature that it needs; on docs.rs only, as it takes nightly Rust.
#![cfg_attr(docsrs, feature(doc_cfg))]

/// Runs the programs in the README as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod aabb;
mod algorithm;
mod boxes;
mod broad_phase;
mod bvh;
mod config;
mod error;
mod filter;
mod finder;
#[cfg(test)]
mod fixtures;
mod id_set;
mod memory;
pub mod oracle;
#[cfg(all(target_family = "wasm", target_os = "unknown"))]
mod page_clock;
mod pair;
mod pair_device;
mod pair_list;
mod pairs;
mod parallel;
mod policy;
mod report;
mod search;
mod simd;

pub use aabb::Aabb;
pub use algorithm::{Algorithm, NeighbourScan, OccupiedCell, Plan};
pub use boxes::{Boxes, Keys, NO_KEY};
pub use broad_phase::{BroadPhase, Events};
pub use bvh::BoxIndex;
pub use config::{Backend, Config, Engine, Limits, Order};
pub use error::Error;
pub use filter::{ProxyFilter, TestMode};
pub use finder::{Finder, find_pairs};
pub use pair::{CrossPair, Pair};
pub use pair_device::{DeviceFailure, DeviceFound, PairDevice, SearchRequest};
pub use pair_list::PairList;
pub use policy::NoDevice;
pub use report::{Checks, DeviceReport, Report, StageTimes, WORK_LIMIT};
pub use simd::simd;

/// Items for the other crates of pbig. They may change in any release.
#[doc(hidden)]
pub mod internal {
    #[cfg(all(target_family = "wasm", target_os = "unknown"))]
    pub use crate::page_clock::set_clock;
    pub use crate::parallel::{SharedSlice, map, run, threads_for};
    pub use crate::report::Clock;
    pub use crate::search::grid::bounds::{
        SizeClass, SizeClasses, size_class_of, size_classes, spread_evenly,
    };
}
