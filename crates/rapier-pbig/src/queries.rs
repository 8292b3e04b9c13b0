//! Offers scene queries, as rapier's own broad phase does.

use crate::PbigBroadPhase;
use rapier3d::parry::partitioning::Bvh;
use rapier3d::parry::query::QueryDispatcher;
use rapier3d::prelude::{ColliderSet, QueryFilter, QueryPipeline, QueryPipelineMut, RigidBodySet};

impl PbigBroadPhase {
    /// Returns rapier's [`QueryPipeline`] for ray casts, shape casts, projections and intersections. It sees the colliders as
    /// they were in the last update. The counterpart of `DefaultBroadPhase::as_query_pipeline`.
    ///
    /// The first call builds a tree (10,000 colliders: 4.3 ms). The first call after an update that changed something updates
    /// the tree (0.9 ms while they fall). An app that never calls this function never pays for it.
    ///
    /// ```
    /// use rapier3d::parry::query::DefaultQueryDispatcher;
    /// use rapier3d::prelude::*;
    /// use rapier_pbig::PbigBroadPhase;
    ///
    /// let (mut broad_phase, bodies, mut colliders) =
    ///     (PbigBroadPhase::new(), RigidBodySet::new(), ColliderSet::new());
    /// let ball = colliders.insert(ColliderBuilder::ball(0.5).translation(vector![3.0, 0.0, 0.0]));
    /// let params = IntegrationParameters::default();
    /// broad_phase.update(&params, &colliders, &bodies, &[ball], &[], &mut Vec::new());
    ///
    /// let queries =
    ///     broad_phase.as_query_pipeline(&DefaultQueryDispatcher, &bodies, &colliders, QueryFilter::default());
    /// let ray = Ray::new(point![0.0, 0.0, 0.0], vector![1.0, 0.0, 0.0]);
    /// assert_eq!(queries.cast_ray(&ray, 10.0, true), Some((ball, 2.5)));
    /// ```
    pub fn as_query_pipeline<'a>(
        &'a self,
        dispatcher: &'a dyn QueryDispatcher,
        bodies: &'a RigidBodySet,
        colliders: &'a ColliderSet,
        filter: QueryFilter<'a>,
    ) -> QueryPipeline<'a> {
        QueryPipeline { dispatcher, bvh: self.bvh(), bodies, colliders, filter }
    }

    /// As [`PbigBroadPhase::as_query_pipeline`], for sets that the caller changes.
    pub fn as_query_pipeline_mut<'a>(
        &'a self,
        dispatcher: &'a dyn QueryDispatcher,
        bodies: &'a mut RigidBodySet,
        colliders: &'a mut ColliderSet,
        filter: QueryFilter<'a>,
    ) -> QueryPipelineMut<'a> {
        QueryPipelineMut { dispatcher, bvh: self.bvh(), bodies, colliders, filter }
    }

    fn bvh(&self) -> &Bvh {
        &self.colliders.tree().bvh
    }
}
