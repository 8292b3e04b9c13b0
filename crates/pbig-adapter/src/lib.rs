//! The part that pbig's broad phases for different versions of rapier share. It knows none of rapier's types, which differ from
//! version to version.
//!
//! An adapter implements [`Scene`] for the arguments of rapier's call, and passes them to [`Colliders`], which keeps the
//! colliders' boxes in `pbig-core` and writes events. Apps use `rapier-pbig`; this crate has no stable interface.
//!
//! ```text
//! rapier's call ─► Scene ─► Colliders ─► pbig_core::BroadPhase ─► events, in an order that depends on the scene alone
//! ```

// Labels each item in the documentation with the feature that it needs; on docs.rs only, as it takes nightly Rust.
#![cfg_attr(docsrs, feature(doc_cfg))]

mod adapter;
mod bounds;
mod colliders;
mod drawn;
mod events;
mod filter;
mod handle;
mod listed;
mod margin;
mod order;
pub mod policy;
mod registry;
mod scene;
mod scene_query;
#[cfg(feature = "shadow")]
pub mod shadow;
#[cfg(feature = "serde")]
mod snapshot;
mod stats;
mod tree;
mod why;
mod wide;

pub use bounds::{Bounds, BoxStore, CoreBoxes, Scalar};
pub use colliders::Colliders;
pub use drawn::{DebugRenderParts, DrawnBox, box_edges};
pub use events::PairEvent;
pub use filter::{BodyKind, Groups, accepted_kinds, filter_of};
pub use handle::{Handle, HandlePair};
pub use margin::Margins;
pub use order::size_class;
pub use pbig_core::{Aabb, Backend, Error, PairDevice, ProxyFilter, Report};
pub use scene::{Proxy, Scene};
pub use scene_query::SceneQuery;
#[cfg(feature = "serde")]
pub use snapshot::Snapshot;
pub use stats::{Stats, Totals};
pub use tree::Tree;
pub use why::Why;
pub use wide::{WideAabb, WideBoxes};
