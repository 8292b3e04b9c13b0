"""Candidate pairs of real meshes: the tree (LBVH) of ipctk beside pbig, in turn, on two threads.

    pip install ipctk plyfile
    cargo build --release
    python3 lab/ipctk.py FOLDER [PBIG]

FOLDER is Sample-Scalable-CCD-Data (on GitHub at Continuous-Collision-Detection): a folder for each scene, with two frames. PBIG is
the program, target/release/pbig. Ipctk's time includes the boxes, about a tenth of it; pbig's begins with boxes in memory. Pairs
differ by the few whose boxes only touch because of rounding: ipctk makes each box larger by a step of f32.
"""

import json
import os
import pathlib
import statistics
import subprocess
import sys
import time

import ipctk
import numpy
import plyfile

ROUNDS = 7
THREADS = 2
DETECT = {"vf": "detect_face_vertex_candidates", "ee": "detect_edge_edge_candidates"}


def read(path):
    """Returns the vertices and the faces of a .ply file."""
    data = plyfile.PlyData.read(path)
    vertices = numpy.column_stack([data["vertex"][axis] for axis in "xyz"]).astype(float)
    return vertices, numpy.vstack(data["face"]["vertex_indices"]).astype(numpy.int32)


def theirs(before, after, edges, faces, kind):
    """Returns the milliseconds and the number of candidates of one search by ipctk."""
    clock, tree = time.perf_counter(), ipctk.LBVH()
    tree.build(before, after, edges, faces)
    pairs = len(getattr(tree, DETECT[kind])())
    return (time.perf_counter() - clock) * 1e3, pairs


def ours(program, frames, kind):
    """Returns the milliseconds and the number of candidates of one search by pbig, the second of its process."""
    mesh = ["pairs", "--mesh", frames[0], "--next", frames[1], "--elements", kind]
    options = ["--repeat", "2", "--threads", str(THREADS), "--json"]
    search = json.loads(subprocess.check_output([program, *mesh, *options]))["searches"][0]
    return search["ms"]["min"], search["pairs"]


def measure(program, scene):
    """Prints a line for each kind of pairs of a scene."""
    frames = sorted((scene / "frames").iterdir())
    (before, faces), (after, _) = map(read, frames)
    edges = ipctk.edges(faces)
    for kind in DETECT:
        rounds = [(theirs(before, after, edges, faces, kind), ours(program, frames, kind)) for _ in range(ROUNDS)]
        ipc, pbig = (statistics.median(side[0] for side in sides) for sides in zip(*rounds))
        (_, ipc_pairs), (_, pbig_pairs) = rounds[0]
        print(f"{scene.name},{kind},{ipc_pairs},{pbig_pairs},{ipc:.2f},{pbig:.2f},{ipc / pbig:.2f}", flush=True)


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    program = sys.argv[2] if len(sys.argv) == 3 else os.path.join("target", "release", "pbig")
    ipctk.set_num_threads(THREADS)
    print("scene,kind,ipctk_pairs,pbig_pairs,ipctk_ms,pbig_ms,ratio")
    for scene in sorted(path for path in pathlib.Path(sys.argv[1]).iterdir() if path.is_dir()):
        measure(program, scene)


if __name__ == "__main__":
    main()
