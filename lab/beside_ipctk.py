"""Candidate pairs of real meshes: the tree (LBVH) of ipctk beside pbig, in turn, on two threads.

    pip install ipctk plyfile
    cargo build --release
    python3 lab/beside_ipctk.py FOLDER [PBIG]

FOLDER is Sample-Scalable-CCD-Data (on GitHub at Continuous-Collision-Detection): a folder for each scene, with two frames. PBIG is
the program, target/release/pbig. Ipctk's time includes the making of boxes; pbig's begins with boxes in memory. Pairs
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


def read(path):
    """Returns the vertices and the faces of a .ply file."""
    data = plyfile.PlyData.read(path)
    vertices = numpy.column_stack([data["vertex"][axis] for axis in "xyz"]).astype(float)
    return vertices, numpy.vstack(data["face"]["vertex_indices"]).astype(numpy.int32)


def theirs(mesh, before, after):
    """Returns the milliseconds and the number of candidates, vertex-face and edge-edge, of one search by ipctk."""
    clock, candidates = time.perf_counter(), ipctk.Candidates()
    # Lists of Python objects, as the methods of the tree return, would take longer than the search.
    candidates.build(mesh, before, after, broad_phase=ipctk.LBVH())
    return (time.perf_counter() - clock) * 1e3, len(candidates)


def ours(program, frames):
    """Returns the milliseconds and the number of candidates of both searches by pbig, the second of each in its process."""
    mesh = ["pairs", "--mesh", frames[0], "--next", frames[1], "--elements", "vf,ee"]
    options = ["--repeat", "2", "--threads", str(THREADS), "--json"]
    searches = json.loads(subprocess.check_output([program, *mesh, *options]))["searches"]
    return sum(search["ms"]["min"] for search in searches), sum(search["pairs"] for search in searches)


def measure(program, scene):
    """Prints a line for a scene."""
    frames = sorted((scene / "frames").iterdir())
    (before, faces), (after, _) = map(read, frames)
    mesh = ipctk.CollisionMesh(before, ipctk.edges(faces), faces)
    rounds = [(theirs(mesh, before, after), ours(program, frames)) for _ in range(ROUNDS)]
    ipc, pbig = (statistics.median(side[0] for side in sides) for sides in zip(*rounds))
    (_, ipc_pairs), (_, pbig_pairs) = rounds[0]
    print(f"{scene.name},{ipc_pairs},{pbig_pairs},{ipc:.2f},{pbig:.2f},{ipc / pbig:.2f}", flush=True)


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    program = sys.argv[2] if len(sys.argv) == 3 else os.path.join("target", "release", "pbig")
    ipctk.set_num_threads(THREADS)
    print("scene,ipctk_pairs,pbig_pairs,ipctk_ms,pbig_ms,ratio")
    for scene in sorted(path for path in pathlib.Path(sys.argv[1]).iterdir() if path.is_dir()):
        measure(program, scene)


if __name__ == "__main__":
    main()
