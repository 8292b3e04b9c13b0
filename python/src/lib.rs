//! The module `pbig._pbig`: searches over arrays that the package `pbig` has checked.

mod arrays;
mod broad_phase;
mod mesh;
mod search;

use arrays::{BoxArray, Table, table};
use mesh::{KindPair, Mesh};
use numpy::PyReadonlyArray2;
use pbig_core::Finder;
use pyo3::prelude::*;
use search::{search, search_mesh};

/// Returns the pairs of overlapping boxes, and the number of invalid boxes.
#[pyfunction]
fn pairs<'py>(py: Python<'py>, boxes: BoxArray<'py>) -> PyResult<(Table<'py>, u64)> {
    let numbers = boxes.numbers()?;
    let find = || {
        let mut finder = Finder::default();
        finder.find(&numbers.boxes())?;
        let invalid = finder.report().invalid;
        Ok((finder.into_pairs(), invalid))
    };
    let (pairs, invalid) = search(py, find)?;
    Ok((table(py, pairs), invalid))
}

/// Returns the pairs of a box of one set and a box of another, and the number of invalid boxes.
#[pyfunction]
fn pairs_between<'py>(py: Python<'py>, a: BoxArray<'py>, b: BoxArray<'py>) -> PyResult<(Table<'py>, u64)> {
    let (a, b) = (a.numbers()?, b.numbers()?);
    let find = || {
        let mut finder = Finder::default();
        finder.find_between(&a.boxes(), &b.boxes())?;
        let invalid = finder.report().invalid;
        Ok((finder.into_pairs_between(), invalid))
    };
    let (pairs, invalid) = search(py, find)?;
    Ok((table(py, pairs), invalid))
}

/// Returns a table of pairs for each two kinds of elements. The frames are the vertices at the beginning and the end of a step.
#[pyfunction]
fn mesh_pairs<'py>(
    py: Python<'py>,
    frames: [PyReadonlyArray2<'py, f64>; 2],
    faces: PyReadonlyArray2<'py, u32>,
    edges: Option<PyReadonlyArray2<'py, u32>>,
    margin: f64,
    kinds: Vec<KindPair>,
) -> PyResult<Vec<Table<'py>>> {
    let frames = [frames[0].as_slice()?, frames[1].as_slice()?].map(bytemuck::cast_slice);
    let faces = bytemuck::cast_slice(faces.as_slice()?);
    let edges = edges.as_ref().map(PyReadonlyArray2::as_slice).transpose()?.map(bytemuck::cast_slice);
    let found = search_mesh(py, || Mesh::new(frames, faces, edges, margin).find(&kinds))?;
    Ok(found.into_iter().map(|pairs| table(py, pairs)).collect())
}

/// Returns the table of edges.
#[pyfunction]
fn edges<'py>(py: Python<'py>, faces: PyReadonlyArray2<'py, u32>) -> PyResult<Table<'py>> {
    let faces = bytemuck::cast_slice(faces.as_slice()?);
    Ok(table(py, search(py, || Ok(mesh::edges(faces)))?))
}

#[pymodule]
mod _pbig {
    #[pymodule_export]
    use super::broad_phase::PyBroadPhase;
    #[pymodule_export]
    use super::{edges, mesh_pairs, pairs, pairs_between};
    use pbig_core::Limits;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::search::note_process();
        module.add("MAX_BOXES", Limits::DEFAULT.max_boxes)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
