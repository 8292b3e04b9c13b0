//! Arrays of numpy as boxes, and pairs as arrays.

use bytemuck::Pod;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pbig_core::Aabb;
use pyo3::prelude::*;
use std::borrow::Cow;

/// Rows of numbers.
pub(crate) type Table<'py> = Bound<'py, PyArray2<u32>>;

/// Boxes of a caller: six numbers in a row.
#[derive(FromPyObject)]
pub(crate) enum BoxArray<'py> {
    #[pyo3(transparent)]
    Single(PyReadonlyArray2<'py, f32>),
    #[pyo3(transparent)]
    Double(PyReadonlyArray2<'py, f64>),
}

impl BoxArray<'_> {
    /// Returns the numbers, to be read without the interpreter's lock.
    pub(crate) fn numbers(&self) -> PyResult<Numbers<'_>> {
        Ok(match self {
            Self::Single(array) => Numbers::Single(array.as_slice()?),
            Self::Double(array) => Numbers::Double(array.as_slice()?),
        })
    }
}

/// Numbers of boxes.
#[derive(Clone, Copy)]
pub(crate) enum Numbers<'a> {
    Single(&'a [f32]),
    Double(&'a [f64]),
}

impl<'a> Numbers<'a> {
    /// Returns the boxes as they lie, or rounded outward from f64.
    pub(crate) fn boxes(self) -> Cow<'a, [Aabb]> {
        let rounded = |row: &[f64]| Aabb::from_f64([row[0], row[1], row[2]], [row[3], row[4], row[5]]);
        match self {
            Self::Single(numbers) => Cow::Borrowed(bytemuck::cast_slice(numbers)),
            Self::Double(numbers) => Cow::Owned(numbers.chunks_exact(6).map(rounded).collect()),
        }
    }
}

/// Makes an array of shape (n, 2) from pairs of two numbers in 32 bits. It takes over the memory.
pub(crate) fn table<P: Pod>(py: Python<'_>, pairs: Vec<P>) -> Table<'_> {
    let shape = (pairs.len(), 2);
    let numbers: Vec<u32> = bytemuck::cast_vec(pairs);
    Array2::from_shape_vec(shape, numbers).expect("two numbers a pair").into_pyarray(py)
}
