//! pbig for rapier 0.36.1: finds the pairs of colliders in place of rapier's own broad phase.
//!
//! Rapier 0.36 has no interface for a broad phase of another crate. A small patch adds one; docs/GETTING_STARTED.md of pbig has
//! the command that applies it. Then one line changes, and the type of the broad phase stays:
//!
//! ```
//! # use rapier as rapier3d;
//! use rapier3d::prelude::*;
//!
//! let mut broad_phase = rapier_pbig::broad_phase(); // was: BroadPhaseBvh::new()
//!
//! let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
//! colliders.insert(ColliderBuilder::cuboid(10.0, 0.5, 10.0).translation(Vector::new(0.0, -0.5, 0.0)));
//! let ball = bodies.insert(RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 3.0, 0.0)));
//! colliders.insert_with_parent(ColliderBuilder::ball(0.5), ball, &mut bodies);
//!
//! let mut pipeline = PhysicsPipeline::new();
//! let (mut islands, mut narrow_phase) = (IslandManager::new(), NarrowPhase::new());
//! let (mut impulse_joints, mut multibody_joints) = (ImpulseJointSet::new(), MultibodyJointSet::new());
//! let (mut soft_bodies, mut ccd_solver) = (SoftBodySet::new(), CCDSolver::new());
//! for _ in 0..120 {
//!     pipeline.step(
//!         Vector::new(0.0, -9.81, 0.0), &IntegrationParameters::default(), &mut islands,
//!         &mut broad_phase, &mut narrow_phase, &mut bodies, &mut colliders,
//!         &mut impulse_joints, &mut multibody_joints, &mut soft_bodies, &mut ccd_solver, &(), &(),
//!     );
//! }
//! assert!((bodies[ball].translation().y - 0.5).abs() < 0.02, "the ball rests on the ground");
//! ```
//!
//! A broad phase that exists already, such as that of `bevy_rapier3d`, is changed by [`install`].
//!
//! It reports the pairs of colliders whose stored AABBs, larger by rapier's margin, overlap, and that rapier's filters admit. The
//! order of events depends on the scene alone, not on the number of threads.
//!
//! The crates `rapier2d-pbig`, `rapier2d-f64-pbig`, `rapier3d-pbig` and `rapier3d-f64-pbig` are this source for the four crates of
//! rapier. In f64 the pairs are those of boxes in f64, at any distance from the origin.
//!
//! | feature | adds |
//! | --- | --- |
//! | `parallel` (default) | several threads search |
//! | `gpu` | the GPU of `pbig-gpu` |
//! | `debug-render` | [`PbigFinder::debug_render`], as rapier's |
//! | `serde` | rapier's `serde-serialize`: worlds can be saved |
//! | `shadow` | [`PbigFinder::with_shadow`]: rapier's own broad phase and brute force run beside it |

mod config;
#[cfg(feature = "debug-render")]
mod debug_render;
mod finder;
mod scene;
#[cfg(feature = "shadow")]
pub mod shadow;
mod tree;

pub use config::PbigConfig;
pub use finder::PbigFinder;
#[cfg(feature = "debug-render")]
pub use pbig_adapter::DebugRenderParts;
pub use pbig_adapter::{Backend, Error, Handle, PairDevice, Report, Stats, Totals, Why};
#[cfg(feature = "gpu")]
pub use pbig_gpu::GpuFinder;
#[cfg(feature = "shadow")]
pub use shadow::{Shadow, differences};

use rapier::geometry::{PairFinder, SceneQuery}; // missing? rapier is unpatched: pbig/docs/GETTING_STARTED.md#errors
use rapier::prelude::BroadPhaseBvh;
use std::any::Any;

/// The margin of rapier's own broad phase, in units of `length_unit`.
const MARGIN: f32 = 0.04;

/// The largest margin with `adaptive_change_detection_margin`, in units of `length_unit`.
const MAX_ADAPTIVE_MARGIN: f32 = 0.25;

/// Returns an empty broad phase in which pbig finds the pairs, in place of `BroadPhaseBvh::new()`.
pub fn broad_phase() -> BroadPhaseBvh {
    let mut broad_phase = BroadPhaseBvh::new();
    install(&mut broad_phase);
    broad_phase
}

/// Lets pbig find the pairs from the next step on. It resumes where the broad phase stopped: no contact is lost. Does nothing
/// where pbig is installed already.
///
/// A broad phase that was saved and restored has to be given pbig again by this function. Without it, rapier's tree finds the
/// pairs, and nothing says so: assert [`is_installed`]. To give a running world pbig, call this function; a new broad phase does not know the pairs of the old one.
pub fn install(broad_phase: &mut BroadPhaseBvh) {
    if finder(broad_phase).is_none() {
        install_finder(broad_phase, PbigFinder::default());
    }
}

/// As [`install`], with settings. It also replaces a pbig that is installed already; no contact is lost.
///
/// # Errors
/// [`Error::Margin`].
pub fn install_with(broad_phase: &mut BroadPhaseBvh, config: PbigConfig) -> Result<(), Error> {
    install_finder(broad_phase, PbigFinder::with_config(config)?);
    Ok(())
}

/// As [`install_with`], with a finder of your own settings, perhaps a shadowed one.
pub fn install_finder(broad_phase: &mut BroadPhaseBvh, finder: impl PairFinder) {
    broad_phase.set_pair_finder(Some(Box::new(finder)));
}

/// Lets rapier's tree find the pairs again. It resumes where pbig stopped.
pub fn uninstall(broad_phase: &mut BroadPhaseBvh) {
    broad_phase.set_pair_finder(None);
}

/// Returns true if pbig finds the pairs. A broad phase that was saved and restored has to be given pbig again: see [`install`].
///
/// ```
/// # use rapier as rapier3d;
/// let mut broad_phase = rapier3d::prelude::BroadPhaseBvh::new();
/// assert!(!rapier_pbig::is_installed(&broad_phase));
/// rapier_pbig::install(&mut broad_phase);
/// assert!(rapier_pbig::is_installed(&broad_phase));
/// ```
pub fn is_installed(broad_phase: &BroadPhaseBvh) -> bool {
    finder(broad_phase).is_some()
}

/// Returns pbig's finder, for statistics and questions, if it is installed.
///
/// ```
/// let broad_phase = rapier_pbig::broad_phase();
/// let finder = rapier_pbig::finder(&broad_phase).expect("it is installed");
/// assert_eq!(finder.stats().totals.updates, 0);
/// ```
pub fn finder(broad_phase: &BroadPhaseBvh) -> Option<&PbigFinder> {
    let finder = broad_phase.pair_finder()? as &dyn Any;
    #[cfg(feature = "shadow")]
    if let Some(shadowed) = finder.downcast_ref::<shadow::Shadowed<PbigFinder>>() {
        return Some(&shadowed.inner);
    }
    finder.downcast_ref()
}
