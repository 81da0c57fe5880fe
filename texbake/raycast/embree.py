"""The Embree library from the embreex wheel, called directly from compiled kernels.

embreex's own mesh constructor copies the mesh index by index, and its `run` returns arrays for all
rays at once. Called through ctypes with shared buffers, the same library builds a scene of millions
of triangles several times faster, and a kernel can pass it packets of 16 rays without Python.
Neighboring triangles are built in as quads, which halves the time and memory of the ray tree.

Based on: Wald, Woop, Benthin, Johnson, Ernst, "Embree: A Kernel Framework for Efficient CPU Ray
Tracing", 2014.
"""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import DependencyError
from texbake.mesh.mesh import IntArray

_FLAG_COMPACT, _FLAG_ROBUST = 2, 4
_OUT_OF_MEMORY = 4
_QUALITY_MEDIUM = 1
_GEOMETRY_QUADS = 1
_BUFFER_INDEX, _BUFFER_VERTEX = 0, 1
_FORMAT_UINT4, _FORMAT_FLOAT3 = 0x5004, 0x9003

# What Embree takes to start, for each thread, and to build its tree: twice what was measured, of
# grids, scans and loose triangles.
_START_BYTES, _THREAD_BYTES, _QUAD_BYTES = 24 << 20, 8 << 20, 80
# Without a cache of 128 MB for subdivision surfaces, which are not used here.
_CONFIGURATION = "hugepages=1,tessellation_cache_size=0"

_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (ctypes.c_void_p, [ctypes.c_char_p]),
    "rtcReleaseDevice": (None, [ctypes.c_void_p]),
    "rtcGetDeviceError": (ctypes.c_int, [ctypes.c_void_p]),
    "rtcNewScene": (ctypes.c_void_p, [ctypes.c_void_p]),
    "rtcReleaseScene": (None, [ctypes.c_void_p]),
    "rtcSetSceneFlags": (None, [ctypes.c_void_p, ctypes.c_int]),
    "rtcSetSceneBuildQuality": (None, [ctypes.c_void_p, ctypes.c_int]),
    "rtcNewGeometry": (ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_int]),
    "rtcReleaseGeometry": (None, [ctypes.c_void_p]),
    "rtcSetSharedGeometryBuffer": (
        None,
        [
            ctypes.c_void_p,
            ctypes.c_int,
            ctypes.c_uint,
            ctypes.c_int,
            ctypes.c_void_p,
            ctypes.c_size_t,
            ctypes.c_size_t,
            ctypes.c_size_t,
        ],
    ),
    "rtcCommitGeometry": (None, [ctypes.c_void_p]),
    "rtcAttachGeometry": (ctypes.c_uint, [ctypes.c_void_p, ctypes.c_void_p]),
    "rtcJoinCommitScene": (None, [ctypes.c_void_p]),
    "rtcIntersect16": (None, [ctypes.c_void_p] * 4),
    "rtcOccluded16": (None, [ctypes.c_void_p] * 4),
}


@cache
def load_library() -> ctypes.CDLL:
    """Load the Embree library beside the embreex package.

    Raises
    ------
    DependencyError
        embreex is not installed or does not load, or its library is not where its wheels put it.
    """
    try:
        import embreex
        import embreex.rtcore_scene  # loads the libraries that Embree itself needs
    except ImportError as error:
        raise DependencyError(
            f"embreex: it does not load ({error}); install it with: pip install embreex"
        ) from error

    folder = Path(embreex.__file__).parent
    pattern = {"win32": "embree4*.dll", "darwin": "libembree4*.dylib"}.get(
        sys.platform, "libembree4*.so*"
    )
    places = [folder.parent / "embreex.libs", folder, folder / ".dylibs"]
    found = sorted(path for place in places for path in place.glob(pattern))
    if not found:
        raise DependencyError(
            f"embreex: there is no Embree library beside {folder}; install the wheel with: "
            "pip install --force-reinstall --only-binary :all: embreex"
        )
    try:
        library = ctypes.CDLL(str(found[0]))
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise DependencyError(f"embreex: its Embree library does not load: {error}") from error
    return library


class EmbreeScene:
    """A ray tree over quads, and the addresses that a kernel needs to cast rays into it.

    Parameters
    ----------
    positions : (V, 3) float32
        Local coordinates.
    quads : (Q, 4) int32
        From `pair_faces`; shared with the library, not copied.
    threads : int
        Threads used to build the tree.
    """

    def __init__(
        self, positions: npt.NDArray[np.float32], quads: npt.NDArray[np.int32], threads: int
    ) -> None:
        self._library = library = load_library()
        _require_memory(len(quads), threads)
        # The library reads 16 bytes at each vertex of 12 bytes, so the buffer needs some to spare.
        self._vertices = np.zeros((len(positions) + 2, 3), dtype=np.float32)
        self._vertices[: len(positions)] = positions
        self._quads = quads
        self._device = library.rtcNewDevice(f"threads={threads},{_CONFIGURATION}".encode())
        if not self._device:
            raise _failed(library.rtcGetDeviceError(None), "start")
        self._scene = library.rtcNewScene(self._device)
        library.rtcSetSceneFlags(self._scene, _FLAG_COMPACT | _FLAG_ROBUST)
        library.rtcSetSceneBuildQuality(self._scene, _QUALITY_MEDIUM)
        geometry = library.rtcNewGeometry(self._device, _GEOMETRY_QUADS)
        for slot, layout, array, count in (
            (_BUFFER_INDEX, _FORMAT_UINT4, quads, len(quads)),
            (_BUFFER_VERTEX, _FORMAT_FLOAT3, self._vertices, len(positions)),
        ):
            library.rtcSetSharedGeometryBuffer(
                geometry, slot, 0, layout, array.ctypes.data, 0, array.strides[0], count
            )
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(self._scene, geometry)
        library.rtcReleaseGeometry(geometry)
        # This thread joins the commit. Left to the library's own threads, one of them would keep
        # spinning as long as a scene built with one thread exists.
        library.rtcJoinCommitScene(self._scene)
        error = library.rtcGetDeviceError(self._device)
        if error:
            self.close()
            raise _failed(error, f"build its tree over {len(quads)} quads")

    def addresses(self) -> tuple[int, int, int]:
        """Return the addresses of the scene, and of the queries for occlusion and the first hit."""
        occluded = ctypes.cast(self._library.rtcOccluded16, ctypes.c_void_p).value or 0
        intersect = ctypes.cast(self._library.rtcIntersect16, ctypes.c_void_p).value or 0
        return self._scene, occluded, intersect

    def close(self) -> None:
        """Free the tree; the scene cannot be used afterwards."""
        if self._scene is not None:
            self._library.rtcReleaseScene(self._scene)
            self._library.rtcReleaseDevice(self._device)
            self._scene = self._device = None


def _require_memory(n_quads: int, threads: int) -> None:
    """Raise `MemoryError` where the system will not give Embree the memory that it takes.

    Its threads wait for one another for ever, or the process is aborted, if memory ends while they
    build. What is asked for here is given back at once, and never used.
    """
    try:
        np.empty(_START_BYTES + _THREAD_BYTES * threads + _QUAD_BYTES * n_quads, np.uint8)
    except MemoryError:
        raise _failed(_OUT_OF_MEMORY, f"build its tree over {n_quads} quads") from None


def _failed(error: int, what: str) -> Exception:
    if error == _OUT_OF_MEMORY:
        return MemoryError(f"embreex: Embree found no memory to {what}")
    return DependencyError(f"embreex: Embree could not {what} (error {error}); reinstall embreex")


def pair_faces(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Join each triangle with the next one in the list where the two share an edge.

    Sculpts and scans list most of their triangles in such pairs (88 and 99 % in two MRI scans). A
    triangle that shares no edge with the next one becomes a quad of its own, at no extra cost.
    Kernel: `core/triangle_pairs.c`.

    Parameters
    ----------
    faces : (F, 3) int32

    Returns
    -------
    quads : (Q, 4) int32
        Embree's quad v0, v1, v2, v3 is the triangles (v0, v1, v3) and (v2, v3, v1), of which the
        second has no area where v2 = v3.
    first_faces : (Q + 1,) int32
        Face of the first triangle of each quad; the second triangle is the next face. The last
        entry is the number of faces, so that each quad holds the faces up to the next entry.
    """
    quads = np.empty((len(faces), 4), dtype=np.int32)
    first_faces = np.empty(len(faces) + 1, dtype=np.int32)
    n_quads = core.pair_triangles(faces, quads, first_faces)
    return quads[:n_quads], first_faces[: n_quads + 1]
