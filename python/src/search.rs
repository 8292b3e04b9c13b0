//! Searches without the lock of Python's interpreter, in processes that may have been forked.

use crate::mesh::KindPair;
use pbig_core::Error;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::process::id;
use std::sync::{Mutex, OnceLock, PoisonError};

/// The process that imported the module.
static IMPORTED_BY: OnceLock<u32> = OnceLock::new();

/// Notes the process whose threads are those of rayon's global pool.
pub(crate) fn note_process() {
    IMPORTED_BY.get_or_init(id);
}

/// Runs a search while other Python threads go on.
pub(crate) fn search<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Error> + Send) -> PyResult<T> {
    py.detach(|| with_threads(work)).map_err(to_python)
}

/// As [`search`], of a mesh.
pub(crate) fn search_mesh<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, (KindPair, Error)> + Send,
) -> PyResult<T> {
    py.detach(|| with_threads(work)).map_err(|([a, b], error)| match error {
        Error::TooManyPairs { limit } => PyValueError::new_err(format!(
            "{a}{b}: more than {limit} candidate pairs; give a smaller margin or step, or one entry of elements a call"
        )),
        other => to_python(other),
    })
}

/// Runs work where rayon has threads.
pub(crate) fn with_threads<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if IMPORTED_BY.get() == Some(&id()) { work() } else { pool_after_fork().install(work) }
}

/// Returns the pool of a process that was forked after the import. A fork copies one thread only, so the global pool would never
/// finish its work.
fn pool_after_fork() -> &'static ThreadPool {
    static POOL: Mutex<Option<(u32, &ThreadPool)>> = Mutex::new(None);
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match *pool {
        Some((process, pool)) if process == id() => pool,
        _ => {
            // Never freed: a pool of the parent process has no threads here that could end it.
            let own = ThreadPoolBuilder::new().build().expect("the system starts threads");
            let own = Box::leak(Box::new(own));
            *pool = Some((id(), own));
            own
        }
    }
}

/// Turns an error into Python's, with a remedy that a user of the package has.
pub(crate) fn to_python(error: Error) -> PyErr {
    let way_out = "split the set, and search its parts with pairs_between";
    PyValueError::new_err(match error {
        Error::TooManyBoxes { boxes, limit } => format!("{boxes} boxes are more than {limit}; {way_out}"),
        Error::TooManyPairs { limit } => format!("more than {limit} overlapping pairs; {way_out}"),
        other => other.to_string(),
    })
}
