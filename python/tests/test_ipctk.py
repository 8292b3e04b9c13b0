"""Candidates against those of the IPC Toolkit."""

import numpy as np
import pytest
from test_mesh import cloth

import pbig

ipctk = pytest.importorskip("ipctk", reason="the package ipctk is not installed")


def moving_cloth(side):
    """Returns a folded cloth before and after a step."""
    random = np.random.default_rng(side)
    vertices, faces = cloth(side)
    before = vertices + random.normal(size=vertices.shape) * 0.2
    return before, before + random.normal(size=vertices.shape) * 0.3, faces


def ball(side):
    """Returns an uneven ball without poles, moved and turned."""
    longitude, latitude = np.meshgrid(np.arange(side) * 2 * np.pi / side, np.linspace(0.1, np.pi - 0.1, side))
    x, y, z = np.cos(longitude) * np.sin(latitude), np.sin(longitude) * np.sin(latitude), np.cos(latitude)
    before = np.stack([x, y, 0.1 * z], axis=-1).reshape(-1, 3)
    # Otherwise many boxes differ by less than float32 can tell.
    before += np.random.default_rng(side).normal(size=before.shape) * 0.01
    corner = np.array([[row * side + k, row * side + (k + 1) % side] for row in range(side - 1) for k in range(side)])
    faces = np.vstack([np.hstack([corner, corner[:, :1] + side]), np.hstack([corner[:, 1:], corner + side])])
    return before, before[:, [1, 2, 0]] + 0.1, faces


def candidates_of_ipctk(before, after, faces, margin):
    mesh = ipctk.CollisionMesh(before, pbig.edges(faces).astype(np.int32), faces.astype(np.int32))
    candidates = ipctk.Candidates()
    candidates.build(mesh, before, after, margin, ipctk.BruteForce())
    edges = {tuple(sorted((pair.edge0_id, pair.edge1_id))) for pair in candidates.ee_candidates}
    return {"ee": edges, "vf": {(pair.vertex_id, pair.face_id) for pair in candidates.fv_candidates}}


def candidates_of_pbig(before, after, faces, margin):
    found = pbig.mesh_pairs(before, faces, after, margin)
    return {kinds: {tuple(pair) for pair in pairs.tolist()} for kinds, pairs in found.items()}


SCENES = [scene for side in (6, 15) for scene in (moving_cloth(side), ball(side))]


@pytest.mark.parametrize("margin", [0.0, 1e-3, 0.1])
@pytest.mark.parametrize("scene", SCENES)
def test_candidates_contain_those_of_ipctk(scene, margin):
    theirs, ours = candidates_of_ipctk(*scene, margin), candidates_of_pbig(*scene, margin)
    for kinds in ("ee", "vf"):
        assert len(theirs[kinds]) > 50
        assert theirs[kinds] <= ours[kinds]
        # Rounding to float32 adds next to none.
        assert len(ours[kinds]) <= 1.001 * len(theirs[kinds])


@pytest.mark.parametrize("scene", SCENES)
def test_candidates_are_those_of_ipctk_where_nothing_is_rounded(scene):
    # Coordinates in steps of 1/1024, of which no two differ by the last bit of a float64.
    before, after = (np.round(frame * 1024) / 1024 for frame in scene[:2])
    args = (before, after, scene[2], 1 / 64)
    assert candidates_of_ipctk(*args) == candidates_of_pbig(*args)
