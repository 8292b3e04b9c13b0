//! The class `BroadPhase`.

use crate::arrays::{BoxArray, Table, table};
use crate::search::{to_python, with_threads};
use numpy::PyReadonlyArray1;
use pbig_core::{BroadPhase, Config, Error, ProxyFilter};
use pyo3::prelude::*;
use std::sync::Mutex;

/// A broad phase that several Python threads may use, one after the other.
#[pyclass(frozen, name = "BroadPhase", module = "pbig._pbig")]
pub(crate) struct PyBroadPhase(Mutex<BroadPhase>);

impl PyBroadPhase {
    /// Runs work without the interpreter's lock. The broad phase is locked outside of a pool's thread: while that waits, it may be given
    /// other work.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut BroadPhase) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let result = py.detach(|| {
            let mut guard = self.0.lock().expect("no call has panicked");
            let broad_phase = &mut *guard;
            with_threads(|| work(broad_phase))
        });
        result.map_err(to_python)
    }
}

#[pymethods]
impl PyBroadPhase {
    #[new]
    fn new(margin: f32) -> PyResult<Self> {
        let broad_phase = BroadPhase::new(Config { margin, ..Config::DEFAULT });
        Ok(Self(Mutex::new(broad_phase.map_err(to_python)?)))
    }

    /// Sets a box for each id. Stops at the first id that is refused.
    fn set(&self, py: Python<'_>, ids: PyReadonlyArray1<'_, u32>, boxes: BoxArray<'_>) -> PyResult<()> {
        let (ids, numbers) = (ids.as_slice()?, boxes.numbers()?);
        self.with(py, |broad_phase| {
            let boxes = numbers.boxes();
            let mut all = ids.iter().zip(boxes.iter());
            all.try_for_each(|(id, aabb)| broad_phase.set(*id, *aabb, ProxyFilter::ALL))
        })
    }

    /// Sets the boxes with the ids from 0 on, and removes all others.
    fn set_all(&self, py: Python<'_>, boxes: BoxArray<'_>) -> PyResult<()> {
        let numbers = boxes.numbers()?;
        self.with(py, |broad_phase| {
            let boxes = numbers.boxes();
            let (ids, known) = (0..boxes.len() as u32, broad_phase.id_count());
            (ids.end..known).for_each(|id| _ = broad_phase.remove(id));
            let ids: Vec<u32> = ids.collect();
            broad_phase.set_many(&ids, |id| Some((boxes[id as usize], ProxyFilter::ALL)))
        })
    }

    /// Removes boxes, and returns how many there were.
    fn remove(&self, py: Python<'_>, ids: PyReadonlyArray1<'_, u32>) -> PyResult<usize> {
        let ids = ids.as_slice()?;
        self.with(py, |broad_phase| Ok(ids.iter().filter(|id| broad_phase.remove(**id)).count()))
    }

    /// Returns the pairs that were added and removed since the last update.
    fn update<'py>(&self, py: Python<'py>) -> PyResult<(Table<'py>, Table<'py>)> {
        let (added, removed) = self.with(py, |broad_phase| {
            let events = broad_phase.update()?;
            Ok((events.added.clone(), events.removed.clone()))
        })?;
        Ok((table(py, added), table(py, removed)))
    }

    fn pairs<'py>(&self, py: Python<'py>) -> PyResult<Table<'py>> {
        let pairs: Vec<_> = self.with(py, |broad_phase| Ok(broad_phase.pairs().collect()))?;
        Ok(table(py, pairs))
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |broad_phase| Ok(broad_phase.len()))
    }
}
