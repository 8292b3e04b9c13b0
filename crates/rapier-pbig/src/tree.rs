//! The tree for scene queries: parry's, in the version of rapier 0.27.

use crate::scene::Bounds;
use rapier3d::math::{DIM, Real};
use rapier3d::parry::bounding_volume::Aabb as TreeAabb;
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rapier3d::prelude::Point;

pbig_adapter::define_tree!(Point);
