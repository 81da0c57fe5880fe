"""Meshes that are hard in space: of shapes, scales and places that break naive geometry."""

import numpy as np
from catalog.case import Case

from texbake import Mesh, make
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane, uv_sphere

CLOSED = frozenset({"closed"})
SOLID = CLOSED | {"solid"}  # closed, turned outwards, and nothing of it inside itself
# Every face has area, so that invariances hold to rounding ...
AREAS = frozenset({"plain"})
# ... and its smooth normals look away from none, so that it bakes flat onto itself.
PLAIN = AREAS | {"flat"}

UNMEASURABLE = "areas cannot be computed"
BEYOND_MAPS = "float32 numbers of maps cannot hold"
MERGED = "would leave"
NO_AREA = dict.fromkeys(("atlas", "study"), "no face has an area")


def mesh_of(positions, faces, **fields):
    """Mesh of nested lists."""
    return Mesh(positions=np.array(positions, float), faces=np.array(faces, np.int32), **fields)


def moved(mesh, scale=1.0, offset=(0, 0, 0)):
    """Mesh scaled about the origin and then moved."""
    return mesh.replace(positions=mesh.positions * scale + np.array(offset, float))


def with_faces(mesh, faces, positions=()):
    """Mesh without coordinates, with more positions and faces at the end of its lists."""
    points = np.array(positions, float).reshape(-1, 3)
    return mesh_of(
        np.concatenate([mesh.positions, points]),
        np.concatenate([mesh.faces, np.array(faces, np.int32).reshape(-1, 3)]),
    )


def joined(*meshes):
    """Several meshes as one, without their coordinates."""
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    return mesh_of(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


def _turned(mesh, every=1):
    faces = mesh.faces.copy()
    faces[::every] = faces[::every, ::-1]
    return mesh_of(mesh.positions, faces)


def _needles():
    """Flat fan of 16 needles, each 1 long and 1e-8 wide, closed by two wide faces."""
    angles = np.arange(17) * 1e-8
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(17)])
    points = np.concatenate([[[0.0, 0.0, 0.0]], rim, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    fan = [[0, i + 1, i + 2] for i in range(16)]
    return mesh_of(points, [*fan, [0, 17, 18], [0, 19, 1]])


def _caps():
    """Square with a row of caps (flat obtuse triangles) along a side, 1e8 times as wide as high."""
    x = np.arange(9) / 8.0
    bottom = np.column_stack([x, np.zeros(9), np.zeros(9)])
    peaks = np.column_stack([(x[:-1] + x[1:]) / 2.0, np.full(8, 1.25e-9), np.zeros(8)])
    caps = [[i, i + 1, 9 + i] for i in range(8)]
    body = [[9 + i, 10 + i, 17] for i in range(7)]
    return mesh_of(np.concatenate([bottom, peaks, [[0.5, 1.0, 0.0]]]), [*caps, *body])


def _edge_of_five():
    angles = np.arange(5) * 2.0 * np.pi / 5.0
    rim = np.column_stack([np.cos(angles), np.zeros(5), np.sin(angles)])
    return mesh_of(np.concatenate([[[0, 0, 0], [0, 1, 0]], rim]), [[0, 1, i + 2] for i in range(5)])


def _bow_tie():
    tip = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]
    up = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    down = [[0, 4, 5], [0, 6, 4], [0, 5, 6], [4, 6, 5]]
    return mesh_of(tip, up + down)


def _fan(n):
    angles = np.arange(n) * 2.0 * np.pi / n
    rim = np.column_stack([np.cos(angles), np.sin(angles), 0.1 * np.sin(3.0 * angles)])
    return mesh_of(
        np.concatenate([[[0.0, 0.0, 0.2]], rim]), [[0, i + 1, (i + 1) % n + 1] for i in range(n)]
    )


def _t_junctions():
    """A square whose one half has a vertex more on the common edge than the other."""
    return mesh_of(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]],
        [[0, 1, 2], [0, 4, 3], [4, 2, 3]],
    )


def _crossing(shift):
    """Two sheets at right angles, the one through the middle of the other but for a shift."""
    upright = moved(plane(2, 2), 1.0, (-0.5, -0.5, 0.0))
    turned = mesh_of(upright.positions[:, [2, 1, 0]], upright.faces)
    return joined(upright, moved(turned, 1.0, shift))


def _one_step_apart():
    """A square whose middle vertices are doubled, one float64 step apart, with slivers between."""
    step = np.nextafter(0.5, 1.0)
    return mesh_of(
        [[0, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [0, 1, 0], [step, 0, 0], [step, 1, 0], [1, 0, 0],
         [1, 1, 0]],
        [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2], [4, 6, 7], [4, 7, 5]],
    )  # fmt: skip


def _zero_normals():
    mesh = icosphere(1)
    normals = mesh.positions.copy()
    normals[::2] = 0.0
    normals[1] = -normals[1]
    return mesh.replace(normals=normals, normal_faces=mesh.faces)


def _signed_zeros():
    """A cube in which every face has vertices of its own, half of them with -0.0 for 0.0."""
    box = moved(cube(), 1.0, (0.5, 0.5, 0.5))
    points = box.positions[box.faces].reshape(-1, 3).copy()
    points[::2][points[::2] == 0.0] = -0.0
    return mesh_of(points, np.arange(len(points)).reshape(-1, 3))


def _split():
    ball = icosphere(1)
    return mesh_of(
        ball.positions[ball.faces].reshape(-1, 3), np.arange(3 * ball.n_faces).reshape(-1, 3)
    )


def _degenerate_among():
    return with_faces(
        icosphere(1),
        [[0, 0, 1], [2, 2, 2], [42, 43, 44], [45, 45, 45]],
        [[2, 0, 0], [3, 0, 0], [4, 0, 0], [0, 3, 0]],
    )


def _thin_wall():
    return mesh_of(cube().positions * [1.0, 1.0, 1e-5], cube().faces)


def _spread_of_scales():
    sizes = (1.0, 1e-3, 1e-6, 1e-9)
    return joined(*(moved(cube(), size, (2.0 * i, 0.0, 0.0)) for i, size in enumerate(sizes)))


GEOMETRY: tuple[Case[Mesh], ...] = (
    Case(name="needles",
         wrong="heights of 1e-8 cancel in float32, and angles from the arc cosine are 0",
         make=_needles),
    Case(name="caps",
         wrong="the sum of the angles is not π, and the long edge swallows the vertex on it",
         make=_caps),
    Case(name="zero-area faces", wrong="the code divides by a cross product of length 0",
         make=_degenerate_among),
    Case(name="split vertices",
         wrong="smooth normals by vertex index crease every edge, and displacement tears there",
         make=_split, traits=PLAIN),
    Case(name="duplicate faces", wrong="an edge has four faces, and coincident hits flicker",
         make=lambda: with_faces(cube(), cube().faces)),
    Case(name="duplicate faces turned", wrong="the normals of a face and its back cancel to 0",
         make=lambda: with_faces(cube(), cube().faces[:, ::-1])),
    Case(name="edge of five faces", wrong="half-edge structures hold only two faces per edge",
         make=_edge_of_five),
    Case(name="bow-tie vertex", wrong="a walk around the vertex visits only one of its two fans",
         make=_bow_tie, traits=SOLID | AREAS),
    Case(name="inside out", wrong="rays go the wrong way, and every hit is culled",
         make=lambda: _turned(icosphere(1)), traits=CLOSED | PLAIN),
    Case(name="every third face turned", wrong="the normals of neighboring faces cancel",
         make=lambda: _turned(icosphere(1), 3), traits=AREAS),
    Case(name="coincident shells", wrong="chance decides which of two equal hits is reported",
         make=lambda: joined(icosphere(1), icosphere(1)), traits=CLOSED | PLAIN),
    Case(name="shell in a shell turned",
         wrong="inside and outside are decided by one of the shells alone",
         make=lambda: joined(icosphere(1), _turned(moved(icosphere(1), 0.9))),
         traits=CLOSED | PLAIN),
    Case(name="wall thinner than the cage",
         wrong="rays pass through the wall and bake its other side",
         make=_thin_wall, traits=SOLID | PLAIN | {"thin"}),
    Case(name="faces through one another",
         wrong="no drawing order is right, and a ray hits the other sheet",
         make=lambda: _crossing((0.13, 0.07, 0.11)), traits=PLAIN),
    Case(name="sheets that cross along edges", wrong="an edge has four faces and two normals",
         make=lambda: _crossing((0.0, 0.0, 0.0)), traits=PLAIN),
    Case(name="unused vertex far away", wrong="the bounding box includes a stray vertex",
         make=lambda: with_faces(icosphere(1), [], [[1e9, 1e9, 1e9]]), traits=SOLID | PLAIN),
    Case(name="one triangle",
         wrong="there is nothing to join, no interior edge and no interior vertex",
         make=lambda: mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), traits=PLAIN),
    Case(name="scale 1e-12", wrong="absolute thresholds call every face degenerate",
         make=lambda: moved(icosphere(1), 1e-12), traits=SOLID | PLAIN),
    Case(name="scale 1e12", wrong="absolute thresholds call no face degenerate",
         make=lambda: moved(icosphere(1), 1e12), traits=SOLID | PLAIN),
    Case(name="offset 1e7 sizes",
         wrong="float32 leaves one bit per coordinate, and the surface becomes a staircase",
         make=lambda: moved(icosphere(1), 1.0, (1e7, -1e7, 1e7)), traits=SOLID,
         refused={"stl": MERGED}),
    Case(name="subnormal coordinates", wrong="squares become 0 and 1 / size becomes infinite",
         make=lambda: moved(icosphere(1), 1e-310), traits=SOLID,
         refused={"unwrap": UNMEASURABLE, "atlas": UNMEASURABLE, "bake": BEYOND_MAPS,
                  "stl": MERGED, "glb": MERGED}),
    Case(name="coordinates of 1e300", wrong="squares overflow, and areas become infinite",
         make=lambda: moved(icosphere(1), 1e300), traits=CLOSED,
         refused={"unwrap": UNMEASURABLE, "atlas": UNMEASURABLE, "stl": "beyond float32",
                  "glb": "beyond float32", "preview": "too large to render", "bake": BEYOND_MAPS}),
    Case(name="sizes 1 to 1e-9 in one",
         wrong="an epsilon relative to the whole mesh swallows its small parts",
         make=_spread_of_scales, traits=SOLID),
    Case(name="Möbius strip", wrong="no winding is consistent, and a normal meets its opposite",
         make=lambda: make("mobius", resolution=(24, 2)).replace(
             uvs=None, uv_faces=None, normals=None, normal_faces=None)),
    Case(name="fan of 256",
         wrong="the work grows with the square of the number of faces at a vertex",
         make=lambda: _fan(256), traits=PLAIN),
    Case(name="T-junctions", wrong="a crack opens along the edge as soon as a vertex moves",
         make=_t_junctions, traits=PLAIN),
    Case(name="vertices one step apart",
         wrong="edges of length 1e-16 divide one rounding error by another", make=_one_step_apart),
    Case(name="negative zeros",
         wrong="0.0 and -0.0 have different hashes, and a closed mesh tears open",
         make=_signed_zeros, traits=PLAIN),
    Case(name="zero and opposite normals", wrong="normalizing a zero normal gives NaN",
         make=_zero_normals),
    Case(name="open poles", wrong="the small ring of radius 1e-3 around a pole gives slivers",
         make=lambda: grid_sphere(7, 12)),
    Case(name="torus", wrong="it is no disk, and there is no boundary to start a cut from",
         make=lambda: make("torus", resolution=(12, 8)).replace(
             uvs=None, uv_faces=None, normals=None, normal_faces=None), traits=SOLID | PLAIN),
    Case(name="strip of 1 by 1e6",
         wrong="an atlas scaled by the longest side leaves the strip no texels",
         make=lambda: mesh_of(plane(16, 1).positions * [1e6, 1.0, 1.0], plane(16, 1).faces)),
    Case(name="points on one line",
         wrong="every normal is 0 / 0, and the bounding box has no volume",
         make=lambda: mesh_of([[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]], [[0, 1, 2], [1, 2, 3]]),
         refused=NO_AREA, traits=frozenset({"no area"})),
    Case(name="all in one point",
         wrong="the code divides by the size of the bounding box, which is 0",
         make=lambda: mesh_of([[5, 5, 5]] * 3, [[0, 1, 2], [2, 1, 0]]),
         refused=NO_AREA, traits=frozenset({"no area"})),
    Case(name="one index thrice", wrong="an edge leads from a vertex to itself",
         make=lambda: mesh_of([[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [1, 1, 1]]),
         refused=NO_AREA, traits=frozenset({"no area"})),
    Case(name="a single coarse sphere", wrong="a pole is one point with many longitudes",
         make=lambda: uv_sphere(2, 3), traits=frozenset({"uvs"}) | PLAIN),
)  # fmt: skip
