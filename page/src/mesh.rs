//! Triangles of a shape.

use rapier3d::parry::shape::TypedShape;
use rapier3d::prelude::*;

/// Triangles in the frame of a shape.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    /// Three coordinates of each vertex.
    pub(crate) coordinates: Vec<f32>,
    /// Three vertices of each triangle.
    pub(crate) indices: Vec<u32>,
}

type Triangles = (Vec<Point<Real>>, Vec<[u32; 3]>);

impl Mesh {
    /// Returns the triangles of a shape whose round borders have this many sides, or `None` if it has none. Rounded shapes are
    /// drawn without their rounding.
    pub(crate) fn of(shape: TypedShape<'_>, sides: u32) -> Option<Self> {
        let triangles = match shape {
            TypedShape::TriMesh(it) => (it.vertices().to_vec(), it.indices().to_vec()),
            TypedShape::HeightField(it) => it.to_trimesh(),
            TypedShape::ConvexPolyhedron(it) => it.to_trimesh(),
            TypedShape::RoundConvexPolyhedron(it) => it.inner_shape.to_trimesh(),
            TypedShape::RoundCylinder(it) => it.inner_shape.to_trimesh(sides),
            TypedShape::RoundCone(it) => it.inner_shape.to_trimesh(sides),
            TypedShape::Voxels(it) => it.to_trimesh(),
            TypedShape::Triangle(it) => (vec![it.a, it.b, it.c], vec![[0, 1, 2]]),
            _ => return None,
        };
        Some(triangles.into())
    }
}

impl From<Triangles> for Mesh {
    fn from((points, triangles): Triangles) -> Self {
        let coordinates = points.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
        Self { coordinates, indices: triangles.into_flattened() }
    }
}
