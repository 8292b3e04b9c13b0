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
//! What it reports is what rapier's own broad phase reports, less the pairs that rapier's narrow
//! phase would throw away again: colliders of one body, kinds of bodies that do not collide, and
//! groups that exclude each other. Events come in an order that depends on the scene alone.
//!
//! | feature | adds |
//! | --- | --- |
//! | `gpu` | the GPU backend |
//! | `serde` | `Serialize` and `Deserialize`, as rapier's `serde-serialize` |
//! | `debug-render` | [`PbigBroadPhase::debug_render`], as rapier's |
//! | `shadow` | [`PbigBroadPhase::with_shadow`]: rapier's own broad phase and brute force beside it |

/// The programs in the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

mod broad_phase;
mod call;
#[cfg(feature = "debug-render")]
mod debug_render;
mod events;
mod look;
mod news;
mod proxy;
mod queries;
mod roll;
mod scene_tree;
#[cfg(feature = "shadow")]
pub mod shadow;
#[cfg(feature = "serde")]
mod snapshot;
mod stats;
mod why;

pub use broad_phase::PbigBroadPhase;
#[cfg(feature = "debug-render")]
pub use debug_render::DebugRenderParts;
/// The finder, for the types of its settings and filters.
pub use pbig_core;
#[cfg(feature = "gpu")]
pub use pbig_core::GpuFinder;
pub use pbig_core::{Backend, Config, Report, Strategy};
pub use proxy::{collision_aabb, filter_of};
pub use stats::{Stats, Totals};
pub use why::Why;
