"""Pairs of triangles are the same triangles, each once."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, strategies as st

from texbake.errors import DependencyError
from texbake.mesh.shapes import grid_sphere, icosphere, plane
from texbake.raycast import embree
from texbake.raycast.embree import pair_faces


def triangles_of(quads, first_faces):
    """Each face's vertices, from the quads alone."""
    faces = {}
    for quad, first, end in zip(quads.tolist(), first_faces, first_faces[1:], strict=False):
        v0, v1, v2, v3 = quad
        both = [(v0, v1, v3), (v2, v3, v1)]
        assert end - first in (1, 2)
        if end - first == 1:
            assert v2 == v3
        faces.update(zip(range(first, end), both, strict=False))
    return faces


def same_winding(triangle, face):
    rotations = [(*face[k:], *face[:k]) for k in range(3)]
    return tuple(triangle) in rotations


@pytest.mark.parametrize("mesh", [plane(4, 5), icosphere(2), grid_sphere(6, 8)])
def test_quads_are_the_faces_of_the_mesh(mesh):
    quads, first_faces = pair_faces(mesh.faces)
    triangles = triangles_of(quads, first_faces)
    assert sorted(triangles) == list(range(mesh.n_faces))
    assert all(same_winding(triangles[i], mesh.faces[i].tolist()) for i in triangles)


@given(st.lists(st.tuples(*[st.integers(0, 5)] * 3), min_size=1, max_size=12))
def test_any_soup_keeps_its_triangles(soup):
    """Degenerate, duplicate and flipped faces as well."""
    faces = np.array(soup, dtype=np.int32)
    faces.flags.writeable = False
    quads, first_faces = pair_faces(faces)
    triangles = triangles_of(quads, first_faces)
    assert sorted(triangles) == list(range(len(faces)))
    assert all(same_winding(triangles[i], faces[i].tolist()) for i in triangles)


def test_split_quads_pair_up():
    mesh = plane(10, 10)
    quads, _ = pair_faces(mesh.faces)
    assert len(quads) == 100


@pytest.mark.parametrize(
    ("number", "kind", "said"),
    [
        (4, MemoryError, "found no memory to start"),
        (5, DependencyError, "could not start .error 5"),
    ],
)
def test_an_embree_that_cannot_start_is_no_crash(monkeypatch, number, kind, said):
    class Library:
        """As where the system gives no memory: no device, and the error of that."""

        def rtcNewDevice(self, options):  # noqa: N802
            return None

        def rtcGetDeviceError(self, device):  # noqa: N802
            return number

    monkeypatch.setattr(embree, "load_library", Library)
    with pytest.raises(kind, match=said):
        embree.EmbreeScene(np.zeros((4, 3), np.float32), np.zeros((1, 4), np.int32), 1)


BUILD = """
import resource, sys
from pathlib import Path
from texbake.mesh.shapes import plane
from texbake.raycast.embree import EmbreeScene, load_library, pair_faces
mesh = plane(100, 100)
quads, _ = pair_faces(mesh.faces)
load_library()
status = Path("/proc/self/status").read_text()
used = int(status.split("VmData:")[1].split()[0]) << 10
limit = used + (int(sys.argv[1]) << 20)
resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
try:
    EmbreeScene(mesh.positions.astype("f4"), quads, 2).close()
except MemoryError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the data of a process")
@pytest.mark.parametrize(
    ("megabytes", "said"),
    [
        (4, "embreex: Embree found no memory to build its tree over 10000 quads\n"),
        # Enough for Embree to begin; it could run out of it, and its threads then wait for ever.
        (16, "embreex: Embree found no memory to build its tree over 10000 quads\n"),
        # Less than the cache for subdivision surfaces, which Embree would take by default.
        (64, ""),
    ],
)
def test_memory_that_is_not_there_is_noticed_before_embree_starts(megabytes, said):
    done = subprocess.run(
        [sys.executable, "-P", "-c", BUILD, str(megabytes)],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, said), done.stderr
