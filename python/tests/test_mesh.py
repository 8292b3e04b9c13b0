"""`mesh_pairs` finds what a test of all elements finds, and `edges` numbers edges as the program does."""

import os
import subprocess

import brute
import numpy as np
import pytest

import pbig

KINDS = ["ee", "vf", "fv", "vv", "ff", "ev", "ve", "ef", "fe"]


def soup(seed, corners=3, faces=40):
    """Returns faces of random vertices, some of which name a vertex twice."""
    random = np.random.default_rng(seed)
    return random.normal(size=(60, 3)), random.integers(0, 60, (faces, corners))


def cloth(side=9):
    """Returns a square of triangles that is folded onto itself, with whole numbers as coordinates."""
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    vertices = np.stack([np.minimum(x, side - x), y, x % 2], axis=-1).reshape(-1, 3).astype(float)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1, 1)
    return vertices, np.vstack([corner + [0, 1, side], corner + [1, side + 1, side]])


MESHES = {
    "soup": soup(1),
    "quadrilaterals": soup(2, corners=4),
    "cloth": cloth(),
    "no faces": (soup(3)[0], np.zeros((0, 3), int)),
    "nothing": (np.zeros((0, 3)), np.zeros((0, 4), np.uint8)),
}


@pytest.mark.parametrize("margin", [0.0, 0.1, 1e-9, 1.0])
@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("mesh", MESHES)
def test_candidates_are_those_of_a_test_of_all(mesh, moves, margin):
    vertices, faces = MESHES[mesh]
    after = vertices + np.random.default_rng(4).normal(size=vertices.shape) * 0.1 if moves else None
    found = pbig.mesh_pairs(vertices, faces, after, margin, ", ".join(KINDS))
    assert list(found) == KINDS
    frames = [vertices] if after is None else [vertices, after]
    for kinds, pairs in found.items():
        assert pairs.dtype == np.uint32 and pairs.shape == (len(pairs), 2)
        assert pairs.tolist() == brute.mesh_pairs(kinds, frames, faces.tolist(), margin), kinds


def test_edges_of_ones_own_are_numbered_as_given():
    vertices, faces = MESHES["cloth"]
    usual = pbig.edges(faces)
    found = pbig.mesh_pairs(vertices, faces, elements="ee,ev")
    turned = pbig.mesh_pairs(vertices, faces, elements="ee,ev", edges=usual[::-1, ::-1])
    last = len(usual) - 1
    assert turned["ee"].tolist() == sorted([last - j, last - i] for i, j in found["ee"].tolist())
    assert turned["ev"].tolist() == sorted([last - i, v] for i, v in found["ev"].tolist())
    rods = pbig.mesh_pairs([[0.0, 0, 0], [2, 2, 0], [2, 0, 0], [0, 2, 0]], [], edges=[[0, 1], [2, 3]], elements="ee")
    assert rods["ee"].tolist() == [[0, 1]]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_margin_below_the_last_bit_grows_boxes(sign):
    places = np.array([1, np.nextafter(np.float32(1), np.float32(2))], float) * sign
    vertices = np.stack([places, places * 0, places * 0], axis=-1)
    for margin, pairs in [(0.0, []), (1e-30, [[0, 1]])]:
        found = pbig.mesh_pairs(vertices, np.zeros((0, 3), int), margin=margin, elements="vv")["vv"].tolist()
        assert found == brute.mesh_pairs("vv", [vertices], [], margin) == pairs


def test_meshes_have_candidates_and_other_elements():
    for mesh in ("soup", "quadrilaterals", "cloth"):
        vertices, faces = MESHES[mesh]
        found = pbig.mesh_pairs(vertices, faces, elements="ee,vf")
        edges = len(pbig.edges(faces))
        assert 100 < len(found["ee"]) < edges * (edges - 1) / 2 and 100 < len(found["vf"]), mesh


def test_edges_and_vertices_with_faces_are_the_default():
    vertices, faces = MESHES["soup"]
    found, named = pbig.mesh_pairs(vertices, faces), pbig.mesh_pairs(vertices, faces, elements="ee,vf")
    assert list(found) == ["ee", "vf"] and all((found[kinds] == named[kinds]).all() for kinds in named)


def test_an_element_with_a_nan_has_no_candidates():
    vertices, faces = soup(5)
    after = vertices.copy()
    after[faces[3, 1]] = np.nan
    found = pbig.mesh_pairs(vertices, faces, after, elements="ff,ee")
    assert found["ff"].tolist() == brute.mesh_pairs("ff", [vertices, after], faces.tolist(), 0)
    assert found["ee"].tolist() == brute.mesh_pairs("ee", [vertices, after], faces.tolist(), 0)
    assert not (found["ff"] == 3).any() and len(found["ff"]) > 0


def test_arrays_of_any_layout_and_type_have_the_same_candidates():
    vertices, faces = MESHES["cloth"]
    wanted = pbig.mesh_pairs(vertices, faces)["ee"].tolist()
    others = [
        (vertices.astype(np.float32), faces.astype(np.int32)),
        (np.asfortranarray(vertices), np.asfortranarray(faces.astype(np.uint32))),
        (vertices.repeat(2, axis=0)[::2], faces.astype(">u8")),
        (vertices.tolist(), faces.tolist()),
        (vertices.astype(np.int64), faces),
        (vertices.astype(">u2"), faces),
        (vertices.astype(int).tolist(), faces.tolist()),
    ]
    for vertices, faces in others:
        assert pbig.mesh_pairs(vertices, faces, after=vertices)["ee"].tolist() == wanted


@pytest.mark.parametrize("mesh", MESHES)
def test_edges_are_numbered_by_larger_then_smaller_vertex(mesh):
    faces = MESHES[mesh][1]
    edges = pbig.edges(faces)
    assert edges.dtype == np.uint32 and edges.shape == (len(edges), 2)
    assert list(map(tuple, edges.tolist())) == brute.edges(faces.tolist())


def test_edges_are_those_of_an_example():
    # Two triangles, and a quadrilateral.
    triangles = pbig.edges([[0, 1, 2], [2, 1, 3]]).tolist()
    assert triangles == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    assert pbig.edges([[1, 4, 6, 3]]).tolist() == [[1, 3], [1, 4], [3, 6], [4, 6]]


@pytest.mark.skipif("PBIG_PROGRAM" not in os.environ, reason="PBIG_PROGRAM does not name the program pbig")
@pytest.mark.parametrize("mesh", ["soup", "quadrilaterals", "cloth"])
def test_candidates_are_those_of_the_program(mesh, tmp_path):
    vertices, faces = MESHES[mesh]
    lines = ["v {!r} {!r} {!r}".format(*place) for place in vertices.tolist()]
    lines += ["f " + " ".join(str(vertex + 1) for vertex in face) for face in faces.tolist()]
    (tmp_path / "mesh.obj").write_text("\n".join(lines))
    for kinds, pairs in pbig.mesh_pairs(vertices, faces, elements="ee,vf,fe").items():
        command = [os.environ["PBIG_PROGRAM"], "pairs", "--mesh", "mesh.obj", "--elements", kinds, "-o", "pairs.npy"]
        command += ["--edges", "edges.npy"]
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
        assert (np.load(tmp_path / "pairs.npy") == pairs).all(), kinds
        assert (np.load(tmp_path / "edges.npy") == pbig.edges(faces)).all()
