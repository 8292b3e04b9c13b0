//! The settings. Every field says its unit, why one would change it, and what follows.

use crate::Error;

/// The processor that does the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Backend {
    /// The given device for a search of many boxes, if it is hardware; otherwise the CPU. Updates are the CPU's.
    #[default]
    Auto,
    /// The CPU, with rayon's threads if there are enough boxes.
    Cpu,
    /// The device that was given. Without one the call finishes on the CPU and [`crate::Report::fallback`] says so.
    // Snapshots keep the earlier name of this variant.
    #[cfg_attr(feature = "serde", serde(rename = "Gpu"))]
    Device,
    /// Every pair is tested, on the CPU: the definition of right, quadratic time.
    Brute,
}

/// The order of lists of pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Order {
    /// By `(a, b)`: the same bytes on every backend and thread count.
    #[default]
    Sorted,
    /// The order of discovery, which saves the sort. It depends on threads, and on a device on timing.
    Unspecified,
}

/// Maximum numbers of boxes and pairs for a call. They bound memory, but not to the memory of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// Maximum number of boxes, and of ids of [`crate::BroadPhase`].
    pub max_boxes: u64,
    /// Maximum number of pairs that a [`crate::Finder`] lists, or a [`crate::BroadPhase`] keeps. A listed pair takes 8 bytes, and up to
    /// 32 while the list is made; a kept one 8 bytes, and up to 70 in an update in which most pairs begin or end.
    pub max_pairs: u64,
}

impl Limits {
    /// 2^27 boxes (3 GiB of boxes alone) and 2^28 pairs (2 GiB).
    pub const DEFAULT: Self = Self { max_boxes: 1 << 27, max_pairs: 1 << 28 };
    /// 2^28 boxes and 2^29 pairs: as many as the numbers inside can tell apart.
    pub const UNLIMITED: Self = Self { max_boxes: 1 << 28, max_pairs: 1 << 29 };

    /// Returns [`Limits::max_pairs`], at most that of [`Limits::UNLIMITED`].
    pub(crate) fn pairs(&self) -> u64 {
        self.max_pairs.min(Self::UNLIMITED.max_pairs)
    }

    /// Returns an error if there are too many boxes.
    pub(crate) fn check_boxes(&self, boxes: u64) -> Result<(), Error> {
        let limit = self.max_boxes.min(Self::UNLIMITED.max_boxes);
        if boxes > limit { Err(Error::TooManyBoxes { boxes, limit }) } else { Ok(()) }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The settings of a [`crate::Finder`] or [`crate::BroadPhase`]. The defaults suit most programs. A later version may have
/// more settings: end with `..Config::DEFAULT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// The processor that does the work.
    pub backend: Backend,
    /// Order of lists of pairs; events are always sorted.
    pub order: Order,
    /// Limits beyond which a call ends with an error.
    pub limits: Limits,
    /// The distance by which a stored box is larger than the given one on every side, in the caller's length unit
    /// ([`crate::BroadPhase`] only). A larger margin means fewer changed boxes, and more reported pairs that do not touch yet.
    pub margin: f32,
    /// An engine that replaces the policy's choice, for tests and measurements.
    #[doc(hidden)]
    pub engine: Option<Engine>,
}

impl Config {
    /// The defaults.
    pub const DEFAULT: Self = Self {
        backend: Backend::Auto,
        order: Order::Sorted,
        limits: Limits::DEFAULT,
        margin: 0.0,
        engine: None,
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The ways in which the CPU makes an update of [`crate::BroadPhase`], or a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[doc(hidden)]
pub enum Engine {
    /// An update looks up the changed boxes, however many.
    LookUp,
    /// All boxes are searched for by a grid.
    Grid,
    /// All boxes are sorted into a tree, which is joined with itself.
    Tree,
}

impl Engine {
    /// All engines, for tests.
    pub const ALL: [Self; 3] = [Self::LookUp, Self::Grid, Self::Tree];

    /// Returns the name in messages of tests.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LookUp => "look-up",
            Self::Grid => "grid",
            Self::Tree => "tree",
        }
    }
}
