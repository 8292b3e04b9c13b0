//! The constants behind the adapters' choices. None of them changes an event.

/// Colliders whose memory is requested before the first of them is read, so that the processor waits for several at a time.
pub const COLLIDERS_PER_BLOCK: usize = 16;

/// Minimum number of listed colliders for several threads. For fewer, waking a second thread costs more than it saves.
#[cfg(feature = "parallel")]
pub(crate) const PARALLEL_FROM_COLLIDERS: usize = 8192;

/// Proxies that several threads compute before one thread stores them. They take 1 MB, which stays in a processor's cache.
#[cfg(feature = "parallel")]
pub(crate) const PROXIES_PER_BATCH: usize = 16_384;

/// Proxies that one thread computes at a time: few enough to share a batch evenly, enough to outweigh the hand-over.
#[cfg(feature = "parallel")]
pub(crate) const PROXIES_PER_PIECE: usize = 512;

/// Changes since the last scene query, per collider, beyond which the tree for queries is dropped. A rebuild then costs
/// little more than an update, and perhaps there are no more queries.
pub(crate) const TREE_CHANGES_PER_COLLIDER: usize = 1;

/// Frames in a file for `pbig replay`: they show the motion that led to a difference, and each costs a copy of all AABBs.
#[cfg(feature = "shadow")]
pub(crate) const REPLAY_FRAMES: usize = 8;

/// Maximum number of differences that a checker keeps: a broad phase that reports nothing would fill the memory.
#[cfg(feature = "shadow")]
pub(crate) const MAX_DIFFERENCES: usize = 1000;

/// Margin that covers rounding to f32, per distance from the origin: twice what `lab/tests/far.rs` needs for a box, because the other box
/// of a pair may have used up its own.
pub(crate) const MARGIN_OF_ROUNDING: f32 = 1.0 / (1 << 21) as f32;

/// Distance from the centre of a world in f64, in margins, beyond which a box is far. There f32 is exact to a 128th of a margin.
pub(crate) const FAR_MARGINS: f64 = 65_536.0;

/// Number of times that boxes are set, per box of a world in f64, before its centre is considered again: that reads all boxes.
pub(crate) const CENTRE_SETS_PER_BOX: usize = 4;

/// Ids per changed box of a world in f64, above which the candidates of each changed box are looked up. Else all are read.
pub(crate) const WIDE_LOOKUPS: usize = 16;
