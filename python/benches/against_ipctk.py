"""Times the searches of ipctk and pbig for candidates of moving meshes, and checks pbig's.

    python python/benches/against_ipctk.py FOLDER [--rounds 9] [--radius 0]

A folder below FOLDER with two frames of the same triangles is a scene, as in the public data of Scalable-CCD. A frame is
an .obj, or a binary .ply of vertices and then faces. The output is a CSV file; times are milliseconds.
"""

import argparse
import importlib.metadata
import os
import pathlib
import time

import ipctk
import numpy as np

import pbig

TYPES = {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8", "uchar": "u1", "uint8": "u1"}


def read(path):
    """Returns the vertices and the triangles of a mesh."""
    if path.suffix == ".obj":
        lines = [line.split() for line in path.read_text().splitlines()]
        faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[:1] == ["f"]]
        return np.array([line[1:4] for line in lines if line[:1] == ["v"]], float), np.array(faces, np.int32)
    head, body = path.read_bytes().split(b"end_header\n", 1)
    order = "<" if b"little_endian" in head else ">"
    lines = [line.split() for line in head.decode("latin-1").splitlines()]
    vertex_count, face_count = (int(line[2]) for line in lines if line[0] == "element")
    columns = [(line[2], order + TYPES[line[1]]) for line in lines if line[0] == "property" and line[1] != "list"]
    rows = np.frombuffer(body, columns, vertex_count)
    faces = np.frombuffer(body, [("size", "u1"), ("corners", order + "i4", (3,))], face_count, rows.nbytes)
    assert (faces["size"] == 3).all(), f"{path}: not a binary .ply of vertices and triangles"
    return np.stack([rows[axis] for axis in "xyz"], axis=-1).astype(float), faces["corners"].astype(np.int32)


def missed(theirs, ours, first, second):
    """Returns the number of pairs that ipctk lists and pbig lacks, and whose boxes overlap in float64."""
    i, j = theirs[~np.isin(*(pairs[:, 0].astype(np.int64) << 32 | pairs[:, 1] for pairs in (theirs, ours)))].T
    return ((first[0][i] <= second[1][j]) & (second[0][j] <= first[1][i])).all(axis=1).sum()


def row(name, before, after, faces, rounds, radius):
    """Returns a row of the table."""
    edges = pbig.edges(faces).astype(np.int32)
    mesh = ipctk.CollisionMesh(before, edges, faces)

    def of_ipctk():
        candidates = ipctk.Candidates()
        candidates.build(mesh, before, after, radius)
        return candidates

    theirs, ours = of_ipctk(), pbig.mesh_pairs(before, faces, after, radius)
    ee = np.array([sorted((pair.edge0_id, pair.edge1_id)) for pair in theirs.ee_candidates], int).reshape(-1, 2)
    vf = np.array([(pair.vertex_id, pair.face_id) for pair in theirs.fv_candidates], int).reshape(-1, 2)
    elements = np.arange(len(before))[:, None], edges, faces
    places = [np.concatenate([before[corners], after[corners]], axis=1) for corners in elements]
    v, e, f = [(kind.min(axis=1) - radius, kind.max(axis=1) + radius) for kind in places]
    lost = missed(ee, ours["ee"], e, e) + missed(vf, ours["vf"], v, f)
    assert lost == 0, f"{name}: pbig lacks {lost} candidates"
    sides, times = [of_ipctk, lambda: pbig.mesh_pairs(before, faces, after, radius)], np.empty((2, rounds))
    for turn in range(rounds):
        for side in (turn % 2, 1 - turn % 2):
            start = time.perf_counter()
            found = sides[side]()
            times[side, turn] = (time.perf_counter() - start) * 1e3
            del found  # outside of the time
    spread = [*np.median(times, axis=1), *times.max(axis=1)]
    return ",".join(map(str, [name, len(faces), len(ee) + len(vf), sum(map(len, ours.values())), *np.round(spread, 2)]))



parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", type=pathlib.Path)
parser.add_argument("--rounds", type=int, default=9)
parser.add_argument("--radius", type=float, default=0.0)
args = parser.parse_args()
folders = sorted({path.parent for path in args.folder.resolve().rglob("*") if path.suffix in (".obj", ".ply")})
if not folders or args.rounds < 1:
    parser.error(f"no .obj or .ply below {args.folder}" if not folders else "--rounds is below 1")
print(f"# cores: {os.cpu_count()}\n# ipctk: {importlib.metadata.version('ipctk')}\n# rounds: {args.rounds}")
print("scene,faces,ipctk_pairs,pbig_pairs,ipctk_median_ms,pbig_median_ms,ipctk_slowest_ms,pbig_slowest_ms")
for folder in folders:
    frames = sorted(path for path in folder.iterdir() if path.suffix in (".obj", ".ply"))
    assert len(frames) == 2, f"{folder}: {len(frames)} frames, not two"
    (before, faces), (after, later) = map(read, frames)
    assert np.array_equal(faces, later), f"{folder}: the frames differ in their faces"
    name = (folder.parent if folder.name == "frames" else folder).name
    print(row(name, before, after, faces, args.rounds, args.radius), flush=True)
