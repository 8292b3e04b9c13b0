//! A GPU for pbig: a [`GpuFinder`] is a [`pbig_core::PairDevice`] that finds pairs by PBIG's pipeline in WGSL, on any device
//! that wgpu supports.
//!
//! ```no_run
//! use pbig_core::{Aabb, Backend, Config, Finder};
//! use pbig_gpu::GpuFinder;
//!
//! let config = Config { backend: Backend::Device, ..Config::DEFAULT };
//! let mut finder = Finder::with_device(config, Box::new(GpuFinder::shared()));
//! finder.find(&[Aabb::new([0.0; 3], [1.0; 3]); 2000])?;
//! println!("{}", finder.report().plan);
//! # Ok::<(), pbig_core::Error>(())
//! ```
//!
//! Without an adapter, or if it fails, the CPU finishes the call, and [`pbig_core::Report::fallback`] says why. An app that has
//! a wgpu device passes it on by [`GpuFinder::from_device`].
//!
//! An app whose boxes are on the device already, and that wants the pairs there, uses [`GpuFinder::record_pairs`]: nothing but a count
//! crosses the bus.
//!
//! A page, where nothing may block, uses [`GpuFinder::open_async`] and [`GpuFinder::find_all_async`], with the feature `webgpu`.

// Labels each item in the documentation with the feature that it needs; on docs.rs only, as it takes nightly Rust.
#![cfg_attr(docsrs, feature(doc_cfg))]

/// Runs the programs in the README as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

// Hidden modules are for tests and studies, and may change in any release.
#[cfg(feature = "wgpu")]
mod gpu;
#[doc(hidden)]
pub mod layout;
mod options;
#[doc(hidden)]
pub mod pbig;
#[cfg(feature = "wgpu")]
mod policy;

#[doc(hidden)]
#[cfg(feature = "wgpu")]
pub use gpu::testing;
#[cfg(feature = "wgpu")]
pub use gpu::{DECLINED, DeviceBoxes, DevicePairs, GpuError, GpuFinder, adapter, adapters, describe};
#[cfg(feature = "wgpu")]
pub use layout::PairCount;
pub use options::GpuOptions;
