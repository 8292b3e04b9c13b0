//! A broad phase for rapier3d 0.27 that replaces the default one by changing one line.
//!
//! ```
//! use rapier3d::prelude::*;
//! use rapier_pbig::PbigBroadPhase;
//!
//! let mut broad_phase = PbigBroadPhase::new(); // was: DefaultBroadPhase::new()
//!
//! let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
//! colliders.insert(ColliderBuilder::halfspace(Vector::y_axis()));
//! let ball = bodies.insert(RigidBodyBuilder::dynamic().translation(vector![0.0, 3.0, 0.0]));
//! colliders.insert_with_parent(ColliderBuilder::ball(0.5), ball, &mut bodies);
//!
//! let mut pipeline = PhysicsPipeline::new();
//! let (mut islands, mut narrow_phase) = (IslandManager::new(), NarrowPhase::new());
//! let (mut impulse_joints, mut multibody_joints) = (ImpulseJointSet::new(), MultibodyJointSet::new());
//! let mut ccd_solver = CCDSolver::new();
//! for _ in 0..120 {
//!     pipeline.step(
//!         &vector![0.0, -9.81, 0.0], &IntegrationParameters::default(), &mut islands,
//!         &mut broad_phase, &mut narrow_phase, &mut bodies, &mut colliders,
//!         &mut impulse_joints, &mut multibody_joints, &mut ccd_solver, &(), &(),
//!     );
//! }
//! assert!((bodies[ball].translation().y - 0.5).abs() < 0.01, "the ball rests on the ground");
//! ```
//!
//! It reports every pair of colliders whose AABBs overlap, except those that rapier's narrow phase would discard: colliders of one
//! body, types of bodies that do not collide, and groups that exclude each other. The order of events depends on the scene alone.
//!
//! | feature | adds |
//! | --- | --- |
//! | `parallel` (default) | several threads read the modified colliders, and search |
//! | `gpu` | the GPU of `pbig-gpu` |
//! | `serde` | `Serialize` and `Deserialize`, as rapier's `serde-serialize` |
//! | `debug-render` | [`PbigBroadPhase::debug_render`], as rapier's |
//! | `shadow` | [`PbigBroadPhase::with_shadow`]: rapier's own broad phase and brute force run beside it |

// Labels each item in the documentation with the feature that it needs; on docs.rs only, as it takes nightly Rust.
#![cfg_attr(docsrs, feature(doc_cfg))]

/// Runs the programs in the README as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod broad_phase;
mod call;
mod config;
#[cfg(feature = "debug-render")]
mod debug_render;
mod queries;
mod scene;
#[cfg(feature = "shadow")]
pub mod shadow;
#[cfg(feature = "serde")]
mod snapshot;
mod tree;

pub use broad_phase::PbigBroadPhase;
pub use config::PbigConfig;
#[cfg(feature = "debug-render")]
pub use pbig_adapter::DebugRenderParts;
pub use pbig_adapter::{Backend, Error, Handle, PairDevice, Report, Stats, Totals, Why};
#[cfg(feature = "gpu")]
pub use pbig_gpu::GpuFinder;
pub use queries::Queries;
#[doc(hidden)]
pub use scene::{collision_aabb, filter_of};
#[cfg(feature = "shadow")]
pub use shadow::Shadow;
