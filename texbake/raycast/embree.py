"""The Embree library from the embreex wheel, called directly from compiled kernels.

embreex's own mesh constructor copies the mesh index by index, and its `run` returns arrays for all
rays at once. Called through ctypes with shared buffers, the same library builds a scene of millions
of triangles several times faster, and a numba kernel can pass it packets of 16 rays without Python.
Neighboring triangles are built in as quads, which halves the time and memory of the ray tree.

Based on: Wald, Woop, Benthin, Johnson, Ernst, "Embree: A Kernel Framework for Efficient CPU Ray
Tracing", 2014; the Embree 4 API manual for the layout of its structures.
"""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import carray, types
from numba.extending import intrinsic

from texbake.errors import DependencyError
from texbake.kernels import callback, kernel
from texbake.mesh.mesh import IntArray

PACKET = 16  # rays per call
# Offsets of the fields of RTCRay and RTCHit in a packet; each field is PACKET words wide.
ORIGIN, NEAR, DIRECTION, TIME, FAR, MASK, LANE, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
NORMAL, HIT_U, HIT_V, QUAD_ID, GEOMETRY_ID, INSTANCE_ID = 12, 15, 16, 17, 18, 19
_RAY_WORDS = 21
# Offsets of what the query for the nearest hit stores per lane, in fields of the same width; the
# first two words of the field before them hold the RTCRayQueryContext.
NEAREST, NEAREST_QUAD, NEAREST_SECOND, NEAREST_BEHIND = 1, 2, 3, 4
FRONT_ONLY = 8  # word that is 1 where back faces are skipped
_QUERY_WORDS = 5
# In local units: boxes of the tree that begin this far behind the nearest hit are still visited.
# It exceeds the rounding of distances in float32, so that no equally near or nearer hit is missed.
_SLACK = 1e-4

_FLAG_COMPACT, _FLAG_ROBUST = 2, 4
_QUALITY_MEDIUM = 1
_GEOMETRY_QUADS = 1
_BUFFER_INDEX, _BUFFER_VERTEX = 0, 1
_FORMAT_UINT4, _FORMAT_FLOAT3 = 0x5004, 0x9003
_QUERY_COHERENT = 1 << 16
_QUERY_ARGUMENT_FILTER = 1 << 1
_ALL_FEATURES = 0xFFFFFFFF

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
    "rtcSetGeometryEnableFilterFunctionFromArguments": (None, [ctypes.c_void_p, ctypes.c_bool]),
    "rtcCommitGeometry": (None, [ctypes.c_void_p]),
    "rtcAttachGeometry": (ctypes.c_uint, [ctypes.c_void_p, ctypes.c_void_p]),
    "rtcJoinCommitScene": (None, [ctypes.c_void_p]),
    "rtcIntersect16": (None, [ctypes.c_void_p] * 4),
    "rtcOccluded16": (None, [ctypes.c_void_p] * 4),
}


class _IntersectArguments(ctypes.Structure):
    """RTCIntersectArguments, and RTCOccludedArguments, which has the same fields."""

    _fields_ = (
        ("flags", ctypes.c_uint),
        ("feature_mask", ctypes.c_uint),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("intersect", ctypes.c_void_p),
        ("min_width_distance_factor", ctypes.c_float),
    )


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


class RayPacket:
    """Memory for an RTCRayHit16 and its mask, aligned to 64 bytes.

    Attributes
    ----------
    valid : (PACKET,) int32
        -1 for a lane that holds a ray, 0 for an empty one.
    words : (21 * PACKET,) float32
        Field after field, each with one word per lane.
    ids : (21 * PACKET,) int32
        The same memory, for integer fields.
    query : (5 * PACKET,) float32
        Results of the query for the nearest hit.
    query_ids : (5 * PACKET,) int32
        The same memory, for integer fields.
    """

    def __init__(self) -> None:
        self.words = _aligned_words(_RAY_WORDS * PACKET)
        self.ids = self.words.view(np.int32)
        self.valid = _aligned_words(PACKET).view(np.int32)
        self.query = _aligned_words(_QUERY_WORDS * PACKET)
        self.query_ids = self.query.view(np.int32)
        self.query_ids[:FRONT_ONLY] = -1  # no instance
        self.arguments = _IntersectArguments(
            _QUERY_COHERENT | _QUERY_ARGUMENT_FILTER,
            _ALL_FEATURES,
            self.query.ctypes.data,
            _keep_nearest.address,
        )


def _aligned_words(n: int) -> npt.NDArray[np.float32]:
    words = np.zeros(n + 16, dtype=np.float32)
    skipped = -(words.ctypes.data // 4) % 16
    return words[skipped : skipped + n]


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
        # The library reads 16 bytes at each vertex of 12 bytes, so the buffer needs some to spare.
        self._vertices = np.zeros((len(positions) + 2, 3), dtype=np.float32)
        self._vertices[: len(positions)] = positions
        self._quads = quads
        self._device = library.rtcNewDevice(f"threads={threads},hugepages=1".encode())
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
        library.rtcSetGeometryEnableFilterFunctionFromArguments(geometry, True)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(self._scene, geometry)
        library.rtcReleaseGeometry(geometry)
        # This thread joins the commit. Left to the library's own threads, one of them would keep
        # spinning as long as a scene built with one thread exists.
        library.rtcJoinCommitScene(self._scene)
        error = library.rtcGetDeviceError(self._device)
        if error:
            self.close()
            raise DependencyError(
                f"embreex: Embree could not build its tree over {len(quads)} quads "
                f"(error {error}); if memory ran out, simplify the high-poly mesh first"
            )
        self._any_arguments = _IntersectArguments(_QUERY_COHERENT, _ALL_FEATURES)
        self._apart_arguments = _IntersectArguments(0, _ALL_FEATURES)

    def addresses(self, packet: RayPacket) -> npt.NDArray[np.uintp]:
        """Return the addresses that a kernel needs to find the nearest hits of a packet.

        They are those of the query, the scene, the packet's mask, the packet, and the arguments.
        Of all hits of a lane `packet.query` keeps the nearest, and of equally near ones that on
        the first face, so the result depends on the ray and the faces alone, not on the tree or
        on the other rays of the packet.
        """
        values = (
            ctypes.cast(self._library.rtcIntersect16, ctypes.c_void_p).value,
            self._scene,
            packet.valid.ctypes.data,
            packet.words.ctypes.data,
            ctypes.addressof(packet.arguments),
        )
        return np.array(values, dtype=np.uintp)

    def secondary_addresses(self, packet: RayPacket) -> npt.NDArray[np.uintp]:
        """Return the addresses that a kernel needs for packets of rays of similar directions.

        They are those of the scene, the packet's mask, the packet, the occlusion query and its
        arguments, and the query for the first hit and its arguments. The occlusion query is
        fastest ray by ray, since most rays either hit at once or hit nothing; the other, whose
        rays all continue to the far side, is fastest for the packet as a whole.
        """
        values = (
            self._scene,
            packet.valid.ctypes.data,
            packet.words.ctypes.data,
            ctypes.cast(self._library.rtcOccluded16, ctypes.c_void_p).value,
            ctypes.addressof(self._apart_arguments),
            ctypes.cast(self._library.rtcIntersect16, ctypes.c_void_p).value,
            ctypes.addressof(self._any_arguments),
        )
        return np.array(values, dtype=np.uintp)

    def close(self) -> None:
        """Free the tree; the scene cannot be used afterwards."""
        if self._scene is not None:
            self._library.rtcReleaseScene(self._scene)
            self._library.rtcReleaseDevice(self._device)
            self._scene = self._device = None


@intrinsic
def call_native(typing_context, function, first, second, third, fourth):  # type: ignore[no-untyped-def]
    """Call a C function that takes four pointers and returns nothing, by its address."""
    del typing_context, function, first, second, third, fourth
    signature = types.void(*[types.uintp] * 5)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        del signature
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer] * 4).as_pointer()
        values = [builder.inttoptr(argument, pointer) for argument in arguments[1:]]
        builder.call(builder.inttoptr(arguments[0], kind), values)
        return context.get_dummy_value()

    return signature, generate


@intrinsic
def _pointer_to(typing_context, address):  # type: ignore[no-untyped-def]
    """Turn an address into a pointer that `carray` accepts."""
    del typing_context, address

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        del context, signature
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.uintp), generate


@callback(types.void(types.CPointer(types.uintp)))
def _keep_nearest(arguments):  # type: ignore[no-untyped-def]
    """Keep a hit if it is the nearest, and end the ray just behind it (RTCFilterFunctionN)."""
    fields = carray(arguments, 6)
    n = np.intp(fields[5] & np.uintp(0xFFFFFFFF))  # an unsigned int, and padding after it
    valid = carray(_pointer_to(fields[0]), n, np.int32)
    query = carray(_pointer_to(fields[2]), _QUERY_WORDS * PACKET, np.float32)
    query_ids = carray(_pointer_to(fields[2]), _QUERY_WORDS * PACKET, np.int32)
    rays = carray(_pointer_to(fields[3]), 12 * n, np.float32)
    ray_ids = carray(_pointer_to(fields[3]), 12 * n, np.int32)
    hits = carray(_pointer_to(fields[4]), 6 * n, np.float32)
    hit_ids = carray(_pointer_to(fields[4]), 6 * n, np.int32)
    for k in range(n):
        if valid[k] == 0:
            continue
        facing = 0.0
        for axis in range(3):
            facing += hits[axis * n + k] * rays[(DIRECTION + axis) * n + k]
        if facing >= 0.0 and query_ids[FRONT_ONLY] != 0:
            valid[k] = 0
            continue
        lane, quad = ray_ids[LANE * n + k], hit_ids[5 * n + k]
        second = 1 if hits[3 * n + k] + hits[4 * n + k] > 1.0 else 0
        distance, nearest = rays[FAR * n + k], query[PACKET * NEAREST + lane]
        kept, kept_second = (
            query_ids[PACKET * NEAREST_QUAD + lane],
            query_ids[PACKET * NEAREST_SECOND + lane],
        )
        if distance < nearest or (
            distance == nearest and (quad < kept or (quad == kept and second < kept_second))
        ):
            query[PACKET * NEAREST + lane] = distance
            query_ids[PACKET * NEAREST_QUAD + lane] = quad
            query_ids[PACKET * NEAREST_SECOND + lane] = second
            query_ids[PACKET * NEAREST_BEHIND + lane] = 1 if facing >= 0.0 else 0
        # The hit is accepted, so that the ray ends here.
        rays[FAR * n + k] = query[PACKET * NEAREST + lane] + np.float32(_SLACK)


def pair_faces(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Join each triangle with the next one in the list where the two share an edge.

    Sculpts and scans list most of their triangles in such pairs (88 and 99 % in two MRI scans). A
    triangle that shares no edge with the next one becomes a quad of its own, at no extra cost.

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
    n_quads = _pair_kernel(faces, quads, first_faces)
    first_faces[n_quads] = len(faces)
    return quads[:n_quads], first_faces[: n_quads + 1]


@kernel
def _pair_kernel(faces, quads, first_faces):  # type: ignore[no-untyped-def]
    n_quads = 0
    face = 0
    while face < len(faces):
        first_faces[n_quads] = face
        quad = quads[n_quads]
        n_quads += 1
        quad[0], quad[1] = faces[face, 0], faces[face, 1]
        quad[2] = quad[3] = faces[face, 2]
        paired = False
        if face + 1 < len(faces):
            for edge in range(3):
                # The edge opposite v0, from v1 to v3; its neighbor runs along it from v3 to v1.
                v1, v3 = faces[face, (edge + 1) % 3], faces[face, (edge + 2) % 3]
                for other in range(3):
                    if faces[face + 1, other] == v3 and faces[face + 1, (other + 1) % 3] == v1:
                        quad[0], quad[1] = faces[face, edge], v1
                        quad[2], quad[3] = faces[face + 1, (other + 2) % 3], v3
                        paired = True
        face += 2 if paired else 1
    return n_quads
