//! Draws the broad phase through rapier's debug renderer.

use crate::PbigBroadPhase;
use crate::scene::to_handle;
use crate::tree::to_tree;
use rapier3d::math::DIM;
use rapier3d::pipeline::{DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::{ColliderSet, Isometry, Vector};

pbig_adapter::define_debug_render!(PbigBroadPhase, &Isometry::identity(), &Vector::repeat(1.0));
