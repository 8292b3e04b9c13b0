//! Code that is the same in each adapter but for rapier's types, which are those of the place where a macro is called.

/// Defines `PbigConfig`, the settings of an adapter, with the margin of its rapier's own broad phase.
#[doc(hidden)]
#[macro_export]
macro_rules! define_config {
    ($(#[$about:meta])* pub struct PbigConfig { $(#[$about_margin:meta])* margin: $margin:expr }) => {
        $(#[$about])*
        /// A later version may have more settings: end with `..PbigConfig::DEFAULT`.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct PbigConfig {
            /// The distance by which a stored AABB is larger than its collider's, in units of rapier's `length_unit`. A larger
            /// margin means that fewer colliders count as moved, and that more pairs are reported that do not touch yet. A fixed
            /// collider has none until it moves, beyond what rounding needs.
            $(#[$about_margin])*
            pub margin: f32,
            /// The processor that searches for pairs.
            pub backend: pbig_core::Backend,
            /// Maximum number of pairs. An update that would have more sends no events, and `last_error` returns the error; the
            /// next update sees the same changes again. The default is the largest number that the core can keep: rapier has
            /// no limit.
            pub max_pairs: u64,
        }

        impl PbigConfig {
            /// The default settings.
            pub const DEFAULT: Self = Self {
                margin: $margin,
                backend: pbig_core::Backend::Auto,
                max_pairs: pbig_core::Limits::UNLIMITED.max_pairs,
            };
        }

        impl Default for PbigConfig {
            fn default() -> Self {
                Self::DEFAULT
            }
        }

        impl From<PbigConfig> for pbig_core::Config {
            fn from(PbigConfig { margin, backend, max_pairs }: PbigConfig) -> Self {
                let limits = pbig_core::Limits { max_pairs, ..pbig_core::Limits::UNLIMITED };
                Self { margin, backend, limits, ..Self::DEFAULT }
            }
        }
    };
}

/// Implements the methods that need no more than [`crate::Colliders`], for a type with a field `colliders` and a function
/// `around` that makes one of a core. In scope: `PbigConfig`, [`define_scene!`](crate::define_scene)'s `to_pair`, rapier's `ColliderPair`.
#[doc(hidden)]
#[macro_export]
macro_rules! define_methods {
    ($Type:ident) => {
        impl Default for $Type {
            fn default() -> Self {
                Self::with_config(PbigConfig::DEFAULT).expect("the default margin is a length")
            }
        }

        impl $Type {
            /// Creates a finder without colliders.
            ///
            /// # Errors
            /// [`crate::Error::Margin`].
            pub fn with_config(config: PbigConfig) -> Result<Self, $crate::Error> {
                pbig_core::BroadPhase::new(config.into()).map(Self::around)
            }

            /// As [`Self::with_config`], on a given device, for [`pbig_core::Backend::Device`]. [`pbig_core::Backend::Auto`] does not use it:
            /// updates are the CPU's.
            ///
            /// # Errors
            /// [`crate::Error::Margin`].
            pub fn with_device(
                config: PbigConfig,
                device: Box<dyn $crate::PairDevice>,
            ) -> Result<Self, $crate::Error> {
                pbig_core::BroadPhase::with_device(config.into(), device).map(Self::around)
            }

            /// Uses this device in later updates, in place of the one in use. After a restore from a snapshot there is none.
            pub fn set_device(&mut self, device: Box<dyn $crate::PairDevice>) {
                self.colliders.set_device(device);
            }

            /// Returns the name of the device in use.
            pub fn device_name(&self) -> Option<&str> {
                self.colliders.core().device_name()
            }

            /// Returns the counts of the last update.
            pub fn stats(&self) -> $crate::Stats<'_> {
                self.colliders.stats()
            }

            /// Returns the error of the last update, or `None` if it succeeded. If pairs could not be found, no events were sent,
            /// and the next update sees the same changes again. If a box could not be stored, the next update reads all colliders.
            pub fn last_error(&self) -> Option<&$crate::Error> {
                self.colliders.last_error()
            }

            /// Returns the number of pairs that rapier knows of. Adopted pairs count after the next update.
            pub fn pair_count(&self) -> usize {
                self.colliders.pair_count()
            }

            /// Returns the pairs that rapier knows of, sorted by the two indices; the collider with the smaller shape comes first
            /// in each, then the lower index. Adopted pairs are included after the next update.
            pub fn pairs(&self) -> impl Iterator<Item = ColliderPair> {
                self.colliders.pairs().map(to_pair)
            }
        }
    };
}

/// Implements [`crate::Scene`] for `Call`, the arguments of rapier's call, which has a function `for_each_of`. Defines the conversions
/// between rapier's handles, pairs and events and those of this crate. `$largest` returns the largest number of a vector. `Call` has
/// fields `colliders`, `modified` and `removed`. In scope: functions `kind_of` and `groups_of`, and the imports of an adapter's `scene.rs`.
#[doc(hidden)]
#[macro_export]
macro_rules! define_scene {
    ($largest:ident) => {
        /// An AABB in rapier's numbers.
        pub(crate) type Bounds = <Real as $crate::Scalar>::Aabb;

        impl $crate::Scene for Call<'_> {
            type Aabb = Bounds;

            fn collider_count(&self) -> usize {
                self.colliders.len()
            }

            fn listed_count(&self) -> usize {
                self.modified.len()
            }

            fn for_each_listed(
                &self,
                range: std::ops::Range<usize>,
                take: impl FnMut($crate::Handle, $crate::Proxy<Bounds>),
            ) {
                self.for_each_of(&self.modified[range], take);
            }

            fn for_each_collider(&self, take: impl FnMut($crate::Handle, $crate::Proxy<Bounds>)) {
                let all: Vec<ColliderHandle> = self.colliders.iter().map(|(handle, _)| handle).collect();
                self.for_each_of(&all, take);
            }

            fn removed(&self) -> impl Iterator<Item = ($crate::Handle, bool)> {
                self.removed.iter().map(|&removed| (handle(removed), self.colliders.contains(removed)))
            }

            fn size(&self, handle: $crate::Handle) -> u8 {
                let shape = self.colliders.get(to_handle(handle)).map(Collider::shape);
                let extent = |shape: &dyn Shape| shape.compute_local_aabb().half_extents().$largest();
                shape.map_or(0, |shape| $crate::size_class($crate::Scalar::to_f32(extent(shape))))
            }
        }

        pub(crate) fn parent_of<'a>(bodies: &'a RigidBodySet, collider: &Collider) -> Option<&'a RigidBody> {
            collider.parent().and_then(|handle| bodies.get(handle))
        }

        #[inline(always)]
        fn filter_with(body: Option<&RigidBody>, collider: &Collider) -> $crate::ProxyFilter {
            let parent = collider.parent().map(|handle| handle.into_raw_parts().into());
            let types = collider.active_collision_types().bits();
            $crate::filter_of(parent, kind_of(body), types, groups_of(collider.collision_groups()))
        }

        pub(crate) fn handle(handle: ColliderHandle) -> $crate::Handle {
            handle.into_raw_parts().into()
        }

        pub(crate) fn to_handle(handle: $crate::Handle) -> ColliderHandle {
            ColliderHandle::from_raw_parts(handle.index, handle.generation)
        }

        pub(crate) fn to_pair($crate::HandlePair(a, b): $crate::HandlePair) -> ColliderPair {
            ColliderPair::new(to_handle(a), to_handle(b))
        }

        pub(crate) fn to_event(event: $crate::PairEvent) -> BroadPhasePairEvent {
            match event {
                $crate::PairEvent::Add(pair) => BroadPhasePairEvent::AddPair(to_pair(pair)),
                $crate::PairEvent::Delete(pair) => BroadPhasePairEvent::DeletePair(to_pair(pair)),
            }
        }
    };
}

/// Defines `ParryTree` with parry's type of corners. Where few leaves change, the optional function moves them and returns true.
/// In scope: the imports of an adapter's `tree.rs`, with parry's AABB as `TreeAabb`.
#[doc(hidden)]
#[macro_export]
macro_rules! define_tree {
    ($Corner:ident $(, $move_few:ident)?) => {
        #[derive(Clone, Default)]
        pub(crate) struct ParryTree {
            pub(crate) bvh: Bvh,
            workspace: BvhWorkspace,
        }

        impl std::fmt::Debug for ParryTree {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.bvh.fmt(f)
            }
        }

        impl $crate::Tree for ParryTree {
            type Aabb = Bounds;

            fn build(leaves: impl Iterator<Item = (u32, Bounds)> + Clone) -> Self {
                let leaves = leaves.map(|(id, aabb)| (id as usize, to_tree(&aabb)));
                Self { bvh: Bvh::from_iter(BvhBuildStrategy::Binned, leaves), workspace: BvhWorkspace::default() }
            }

            /// Removals leave nodes behind that parry 0.22's optimiser may take for leaves. Refitting drops these nodes.
            fn remove(&mut self, gone: &[u32]) {
                gone.iter().for_each(|&id| self.bvh.remove(id));
                self.bvh.refit(&mut self.workspace);
            }

            fn update(&mut self, leaves: impl Iterator<Item = (u32, Bounds)>) {
                let leaves: Vec<_> = leaves.map(|(id, aabb)| (id, to_tree(&aabb))).collect();
                $(if $move_few(&mut self.bvh, &leaves) {
                    return;
                })?
                for (id, aabb) in leaves {
                    _ = self.bvh.insert_or_update_partially(aabb, id, 0.0);
                }
                self.bvh.optimize_incremental(&mut self.workspace);
                self.bvh.refit(&mut self.workspace);
            }
        }

        /// Clamps infinite boxes to the size of rapier's half-spaces, because the tree computes centres.
        pub(crate) fn to_tree(aabb: &Bounds) -> TreeAabb {
            let corner = |corner: [Real; 3]| {
                let clamped = |k: usize| corner[k].clamp(Real::MIN / 2.0, Real::MAX / 2.0);
                $Corner::from(std::array::from_fn::<Real, DIM, _>(clamped))
            };
            let [min, max] = $crate::Bounds::corners(aabb);
            TreeAabb::new(corner(min), corner(max))
        }
    };
}

/// Implements `debug_render` for a type with a field `colliders`. `$unmoved` and `$unscaled` are arguments of rapier's renderer.
/// In scope: the imports of an adapter's `debug_render.rs`.
#[doc(hidden)]
#[macro_export]
macro_rules! define_debug_render {
    ($Type:ident, $unmoved:expr, $unscaled:expr) => {
        impl $Type {
            /// Draws the stored boxes and cells as lines, through the renderer that also draws rapier's own pictures. Each is passed
            /// as a [`DebugRenderObject::ColliderAabb`], a cell with the first collider in it. Few boxes have no cells, because they
            /// need no grid. A GPU shows no cells.
            pub fn debug_render(
                &self,
                colliders: &ColliderSet,
                parts: $crate::DebugRenderParts,
                backend: &mut dyn DebugRenderBackend,
            ) {
                let edges = $crate::box_edges(DIM);
                for drawn in self.colliders.drawn(parts, |handle| colliders.contains(to_handle(handle))) {
                    let (handle, aabb) = (to_handle(drawn.collider), to_tree(&drawn.aabb));
                    let object = DebugRenderObject::ColliderAabb(handle, &colliders[handle], &aabb);
                    if backend.filter_object(object) {
                        backend.draw_polyline(
                            object,
                            &aabb.vertices(),
                            &edges,
                            $unmoved,
                            $unscaled,
                            drawn.color,
                        );
                    }
                }
            }
        }
    };
}

/// Implements [`crate::shadow::View`] for `Call`, which has functions `aabb_of_stock` and `reaches_further_with`, and updates rapier's own
/// broad phase. `$distance` returns the distance between the shapes of two colliders. In scope: the imports of an
/// adapter's `shadow`.
#[doc(hidden)]
#[macro_export]
macro_rules! define_view {
    ($distance:ident) => {
        impl Call<'_> {
            fn find_enabled(&self, wanted: $crate::Handle) -> Option<&Collider> {
                self.colliders.get(to_handle(wanted)).filter(|collider| collider.is_enabled())
            }
        }

        impl $crate::shadow::View for Call<'_> {
            fn enabled(&self) -> Vec<$crate::Handle> {
                self.colliders.iter_enabled().map(|(each, _)| handle(each)).collect()
            }

            fn side(&self, wanted: $crate::Handle) -> Option<Side> {
                let collider = self.colliders.get(to_handle(wanted))?;
                Some(Side {
                    aabb: self.aabb(wanted).map(|aabb| $crate::Bounds::to_f32(&aabb)),
                    parent: collider.parent().map(|body| body.into_raw_parts().into()),
                    body_type: kind_of(parent_of(self.bodies, collider)),
                    active_collision_types: collider.active_collision_types().bits(),
                    groups: groups_of(collider.collision_groups()),
                })
            }

            fn aabb(&self, wanted: $crate::Handle) -> Option<Bounds> {
                self.find_enabled(wanted).map(|collider| self.aabb_of_stock(to_handle(wanted), collider))
            }

            fn allowed(&self, pair: HandlePair) -> bool {
                let (Some(a), Some(b)) = (self.find_enabled(pair.0), self.find_enabled(pair.1)) else {
                    return false;
                };
                let same_body = a.parent().is_some() && a.parent() == b.parent();
                let [x, y] = [a, b].map(|collider| {
                    parent_of(self.bodies, collider).map_or(RigidBodyType::Fixed, RigidBody::body_type)
                });
                let kinds = a.active_collision_types().test(x, y) || b.active_collision_types().test(x, y);
                !same_body && kinds && a.collision_groups().test(b.collision_groups())
            }

            /// Parry 0.22's contact query between a cuboid and a compound can report a penetration for shapes 0.08 apart (in the
            /// scene `compounds`), so its distance query must agree. If parry cannot compare the shapes, their AABBs decide.
            fn in_contact(&self, pair: HandlePair) -> bool {
                let (Some(x), Some(y)) = (self.find_enabled(pair.0), self.find_enabled(pair.1)) else {
                    return false;
                };
                let reach = self.params.prediction_distance() + x.contact_skin() + y.contact_skin();
                match contact(x.position(), x.shape(), y.position(), y.shape(), reach) {
                    Ok(found) => found.is_some() && !$distance(x, y).is_some_and(|apart| apart > reach),
                    Err(_) => self
                        .aabb(pair.0)
                        .zip(self.aabb(pair.1))
                        .is_some_and(|(a, b)| $crate::Bounds::overlaps(&a, &b)),
                }
            }

            fn reaches_further(&self, wanted: $crate::Handle) -> bool {
                let collider = self.find_enabled(wanted);
                let body = collider.and_then(|collider| parent_of(self.bodies, collider));
                collider.zip(body).is_some_and(|(collider, body)| self.reaches_further_with(collider, body))
            }
        }

        /// Updates stock, and returns its events unless it panics. The world may be older than stock, so stock sees all colliders
        /// before its first update. It skips colliders that have not changed, so a copy of them is marked as changed.
        pub(super) fn update_stock(
            stock: &mut $crate::shadow::Stock<BroadPhaseBvh>,
            call: &Call<'_>,
        ) -> Option<Vec<$crate::PairEvent>> {
            let (Call { params, bodies, modified, removed, .. }, mut events) = (*call, Vec::new());
            let is_first = stock.starts();
            stock.guard(|stock| {
                if is_first {
                    let mut colliders = call.colliders.clone();
                    let all: Vec<_> = colliders.iter_enabled().map(|(handle, _)| handle).collect();
                    for &handle in &all {
                        let pose = *colliders[handle].position();
                        colliders[handle].set_position(pose);
                    }
                    stock.update(params, &colliders, bodies, &all, &[], &mut events);
                }
                stock.update(params, call.colliders, bodies, modified, removed, &mut events);
            })?;
            Some(of_events(&events))
        }

        pub(super) fn of_pair(pair: &ColliderPair) -> $crate::HandlePair {
            $crate::HandlePair(handle(pair.collider1), handle(pair.collider2))
        }

        pub(super) fn of_events(events: &[BroadPhasePairEvent]) -> Vec<$crate::PairEvent> {
            let of = |event: &BroadPhasePairEvent| match event {
                BroadPhasePairEvent::AddPair(pair) => $crate::PairEvent::Add(of_pair(pair)),
                BroadPhasePairEvent::DeletePair(pair) => $crate::PairEvent::Delete(of_pair(pair)),
            };
            events.iter().map(of).collect()
        }
    };
}
