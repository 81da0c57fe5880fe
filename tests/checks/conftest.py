"""Small meshes with one fault each, and clean ones."""

from typing import NamedTuple

import numpy as np
import pytest

from tests.models import moved
from texbake.checks.kinds import BUDGET_KINDS, KINDS, CheckOptions
from texbake.mesh.compose import used_rows
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import smooth_normals, with_flat_normals
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.weld import weld_rows


class Case(NamedTuple):
    """A mesh, or a high-poly and a low-poly mesh, with one fault: how often, and at which faces."""

    mesh: Mesh
    low: Mesh | None
    count: int
    faces: set[int]
    options: CheckOptions = CheckOptions(size=128)


def flat(mesh):
    return with_flat_normals(mesh)


def smooth(mesh):
    """A sphere about the origin with its normals."""
    return mesh.replace(normals=mesh.positions, normal_faces=mesh.faces)


def soup(points, faces):
    return flat(Mesh(positions=np.array(points, float), faces=faces))


def squares(*places):
    """Upright unit squares ((x, y, z), (u, v), (width, height)), each a chart of two faces."""
    positions, uvs, faces = [], [], []
    for (x, y, z), (u, v), (width, height) in places:
        first = len(positions)
        for i, j in (0, 0), (1, 0), (1, 1), (0, 1):
            positions.append((x + i, y + j, z))
            uvs.append((u + i * width, v + j * height))
        faces += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    uvs = np.array(uvs, float)
    return flat(Mesh(positions=np.array(positions), faces=faces, uvs=uvs, uv_faces=faces))


def cuboid(x, y, z):
    """A box with six charts of its own, of one texel density."""
    box = cube()
    corners = box.positions[box.faces]
    uvs = np.empty((12, 3, 2))
    for pair in range(6):
        rows = [2 * pair, 2 * pair + 1]
        normal = np.cross(*(corners[rows[0], 1:] - corners[rows[0], 0]))
        axis = int(np.abs(normal).argmax())
        a, b = (axis + 1) % 3, (axis + 2) % 3
        sides = np.array([x, y, z])
        local = (corners[rows][..., [a, b]] + 0.5) * sides[[a, b]]
        if normal[axis] < 0.0:
            local = local[..., ::-1]
        uvs[rows] = local * 0.05 + [0.05 + 0.3 * (pair % 3), 0.05 + 0.45 * (pair // 3)]
    ids = np.arange(36).reshape(12, 3)
    return flat(
        box.replace(positions=box.positions * [x, y, z], uvs=uvs.reshape(-1, 2), uv_faces=ids)
    )


ROOMY = ((0, 0, 0), (0.1, 0.1), (0.2, 0.2))
SHEET, FINE_SHEET = flat(plane(2, 2)), flat(plane(8, 8))
FAR_SQUARE = ((2, 0, 0), (0.6, 0.1), (0.2, 0.2))


def no_surface():
    return Case(soup([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [[0, 1, 2]]), None, 1, set())


def zero_area_faces():
    return Case(soup([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.5, 0, 0)], [[0, 1, 2], [1, 0, 3]]),
                None, 1, {1})  # fmt: skip


def duplicate_faces():
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
    return Case(soup(points, [[0, 1, 2], [1, 3, 2], [2, 0, 1], [1, 2, 0]]), None, 2, {2, 3})


def duplicate_vertices():
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)]
    mesh = soup(points, [[0, 1, 2], [4, 3, 2]])
    return Case(mesh.replace(normals=[[0, 0, 1]], normal_faces=[[0] * 3] * 2), None, 1, {1})


def unused_vertices():
    return Case(soup([(0, 0, 0), (1, 0, 0), (0, 1, 0), (9, 9, 9)], [[0, 1, 2]]), None, 1, set())


def non_manifold_edges():
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)]
    return Case(soup(points, [[0, 1, 2], [1, 0, 3], [0, 1, 4]]), None, 1, {0, 1, 2})


def pinched_vertices():
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)]
    return Case(soup(points, [[0, 1, 2], [0, 3, 4]]), None, 1, {0, 1})


def cracks():
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1 + 1e-8, 0, 0), (1, 1, 0), (0, 1 + 1e-8, 0)]
    return Case(soup(points, [[0, 1, 2], [3, 4, 5]]), None, 4, {0, 1})


def self_intersections():
    points = [(0, 0, 0), (2, 0, 0), (0, 2, 0), (0.5, 0.5, -1), (0.5, 0.5, 1), (3, 3, 0.3)]
    return Case(soup(points, [[0, 1, 2], [3, 4, 5]]), None, 2, {0, 1})


def inconsistent_winding():
    faces = icosphere(0).faces.copy()
    faces[7] = faces[7][::-1]
    return Case(flat(icosphere(0).replace(faces=faces)), None, 3, {7})


def inside_out_shells():
    return Case(flat(cube().replace(faces=cube().faces[:, ::-1])), None, 1, set(range(12)))


def far_from_origin():
    return Case(moved(smooth(icosphere(1)), by=1e5), None, 1, set())


def extreme_size():
    sphere = smooth(icosphere(1))
    return Case(sphere.replace(positions=sphere.positions * 1e-7), None, 1, set())


def unmeasurable_size():
    sphere = smooth(icosphere(1))
    return Case(sphere.replace(positions=sphere.positions * 1e90), None, 1, set())


def no_normals():
    return Case(icosphere(1), None, 1, set())


def zero_normals():
    normals = SHEET.normals.copy()
    normals[5] = 0.0
    return Case(SHEET.replace(normals=normals), None, 1, {5})


def turned_normals():
    normals = SHEET.normals.copy()
    normals[2] *= -1.0
    mesh = SHEET.replace(normals=normals, uvs=None, uv_faces=None)
    return Case(mesh, None, 1, {2})


def hard_edges_without_seam():
    folded = plane(2, 1)
    bent = np.where(folded.positions[:, :1] > 0.75, [[0.5, 0, 0.5]], folded.positions)
    bent[:, 1] = folded.positions[:, 1]
    mesh = flat(folded.replace(positions=bent))
    at = {int(i) for i in np.flatnonzero((mesh.faces % 3 == 1).sum(axis=1) == 2)}
    return Case(mesh, None, 1, at)


def other_diagonals():
    """Three quadrilaterals: bent and cut from their first corner, bent and not, and flat."""
    square = 0.2 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    places = np.add(square, [[[0.1, 0.1]], [[0.4, 0.1]], [[0.7, 0.1]]])
    positions = np.concatenate([places, np.zeros((3, 4, 1))], axis=2)
    positions[:2, 2, 2] = 0.1
    fan, other = [[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]
    faces = np.concatenate([fan, np.add(other, 4), np.add(other, 8)])
    mesh = Mesh(
        positions=positions.reshape(-1, 3), faces=faces, uvs=places.reshape(-1, 2), uv_faces=faces,
        polygon_of=[0, 0, 1, 1, 2, 2],
    )  # fmt: skip
    mesh = mesh.replace(normals=smooth_normals(mesh), normal_faces=mesh.faces)
    return Case(mesh, None, 1, {2, 3})


def no_coordinates():
    return Case(FINE_SHEET, SHEET.replace(uvs=None, uv_faces=None), 1, set())


def nothing_covered():
    uvs = SHEET.uvs * 1e-3
    return Case(SHEET.replace(uvs=uvs), None, 1, set())


def outside_tile():
    return Case(squares(ROOMY, ((2, 0, 0), (0.9, 0.1), (0.2, 0.2))), None, 2, {2, 3})


def overlapping_coordinates():
    return Case(squares(ROOMY, ((4, 0, 0), (0.2, 0.2), (0.2, 0.2)), FAR_SQUARE), None, 4,
                {0, 1, 2, 3})  # fmt: skip


def shared_coordinates():
    """The second square of a group of its own lies on the first; a third lies apart."""
    mesh = squares(ROOMY, ((4, 0, 0), (0.2, 0.2), (0.2, 0.2)), FAR_SQUARE)
    groups = np.array([0, 0, 1, 1, 1, 1], dtype=np.int32)
    return Case(mesh.replace(face_groups=groups, group_names=("one", "two")), None, 4, {0, 1, 2, 3})


def stacked_coordinates():
    """The second square lies exactly on the first, mirrored; a third lies two tiles away."""
    on_others = ((4, 0, 0), (0.3, 0.1), (-0.2, 0.2)), ((8, 0, 0), (2.1, 0.1), (0.2, 0.2))
    return Case(squares(ROOMY, *on_others), None, 2, {2, 3, 4, 5})


def mirrored_coordinates():
    return Case(squares(ROOMY, ((2, 0, 0), (0.8, 0.1), (-0.2, 0.2))), None, 2, {2, 3})


def collapsed_coordinates():
    return Case(squares(ROOMY, ((2, 0, 0), (0.6, 0.1), (0.2, 0.0))), None, 2, {2, 3})


def thin_charts():
    # 3 texels wide, of the density of the other.
    strip = squares(ROOMY, FAR_SQUARE)
    positions, uvs = strip.positions.copy(), strip.uvs.copy()
    positions[4:, 0] = 2 + (positions[4:, 0] - 2) * 3 / 25.6
    uvs[4:, 0] = 0.6 + (uvs[4:, 0] - 0.6) * 3 / 25.6
    return Case(strip.replace(positions=positions, uvs=uvs), None, 1, {2, 3})


def close_charts():
    gap = 7 / 128  # twice the padding, less a texel
    side = 24 / 128
    near = squares(((0, 0, 0), (0.125, 0.125), (side, side)),
                   ((2, 0, 0), (0.125 + side + gap, 0.125), (side, side)))  # fmt: skip
    return Case(near, None, 1, {0, 2, 3})  # face 1 is at the other side


def faces_without_texel():
    mesh = squares(ROOMY, FAR_SQUARE)
    positions, uvs = mesh.positions.copy(), mesh.uvs.copy()
    positions[4:] = [2, 0, 0] + (positions[4:] - [2, 0, 0]) * 0.01
    uvs[4:] = [80.7 / 128, 12.7 / 128] + (uvs[4:] - [0.6, 0.1]) * 0.01
    options = CheckOptions(size=128, padding=0)
    return Case(mesh.replace(positions=positions, uvs=uvs), None, 2, {2, 3}, options)


def low_texel_density():
    return Case(squares(ROOMY, ((2, 0, 0), (0.6, 0.1), (0.3, 0.035))), None, 2, {2, 3})


def differing_scale():
    box = cuboid(1, 2, 4)
    return Case(box.replace(positions=box.positions * 100.0), box, 1, set())


def differing_place():
    return Case(moved(FINE_SHEET, by=(0, 0, 3)), SHEET, 1, set())


def differing_axes():
    box = cuboid(1, 2, 4)
    # A quarter turn about x: y becomes z.
    lying = box.replace(positions=box.positions @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))
    return Case(flat(lying), cuboid(1, 2, 4), 1, set())


def far_from_high():
    low = squares(*(((i, 0, 0), (0.02 + 0.24 * i, 0.1), (0.16, 0.16)) for i in range(3)),
                  ((3, 0, 2), (0.75, 0.1), (0.16, 0.16)))  # fmt: skip
    high = flat(plane(6, 2))
    return Case(high.replace(positions=high.positions * [3, 1, 1]), low, 2, {6, 7})


def far_from_low():
    high = squares(ROOMY, ((0, 0, 2), (0, 0), (1, 1)))
    return Case(high, squares(ROOMY), 2, {2, 3})


def sheets(*heights):
    """Unit squares at (x, z), a chart each; those of negative sign face down."""
    places = []
    for i, (x, z, sign) in enumerate(heights):
        u = 0.02 + 0.24 * i + (0.16 if sign < 0 else 0.0)
        places.append(((x, 0, z), (u, 0.1), (sign * 0.16, 0.16)))
    mesh = squares(*places)
    faces = mesh.faces.copy()
    for i, (_, _, sign) in enumerate(heights):
        if sign < 0:
            faces[2 * i : 2 * i + 2] = faces[2 * i : 2 * i + 2, ::-1]
    return flat(mesh.replace(faces=faces, uv_faces=faces))


def joined_along_edges(mesh):
    """Mesh with one vertex for each position."""
    vertices, faces = used_rows(weld_rows(mesh.positions)[mesh.faces], mesh.n_vertices)
    return mesh.replace(positions=mesh.positions[vertices], faces=faces)


def thin_walls():
    """A wall of 0.05 that goes on as a sheet, whose high-poly surface lies 0.06 behind it."""
    low, high = (sheets((0, 0, 1), (0, -0.05, -1), (1, z, 1)) for z in (0.0, -0.06))
    return Case(high, joined_along_edges(low), 2, {0, 1})


def other_parts():
    """A gap of 0.03 below a slab of 0.02; beside it the sheet is 0.06 below the high-poly one."""
    slab = ((0, 0, 1), (0, 0.03, -1), (0, 0.05, 1))
    low, high = (sheets(*slab, (1, z, 1)) for z in (0.0, 0.06))
    return Case(high, joined_along_edges(low), 2, {0, 1})


def opposite_sides():
    low = SHEET.replace(faces=SHEET.faces[:, ::-1], uv_faces=SHEET.uv_faces[:, ::-1])
    low = flat(low.replace(uvs=[1, 0] + low.uvs * [-1, 1]))
    return Case(FINE_SHEET, low, 8, set(range(8)))


def high_is_coarser():
    return Case(SHEET, FINE_SHEET, 1, set())


def detail_below_texels():
    return Case(flat(plane(50, 50)), SHEET, 1, set(), CheckOptions(size=32))


# Each is the function of its name.
CASES = {
    kind: globals()[kind.replace("-", "_")]
    for kind in KINDS
    if kind not in ("unreadable", "undecided-intersections")
    and KINDS[kind] not in BUDGET_KINDS  # see test_budget.py
}


@pytest.fixture(params=sorted(CASES))
def faulty(request):
    """Each fault by its name, with the mesh that has it."""
    return request.param, CASES[request.param]()


@pytest.fixture(
    params=sorted(CASES.keys() - {"extreme-size", "unmeasurable-size", "far-from-origin"})
)
def faulty_anywhere(request):
    """Each fault that does not depend on the size and place of a mesh, with its name."""
    return request.param, CASES[request.param]()


def hollow():
    """A cube with a cubic hole inside, whose wall is wound to face the hole."""
    outer, inner = cube(), cube()
    faces = np.concatenate([outer.faces, inner.faces[:, ::-1] + 8])
    return flat(Mesh(positions=[*outer.positions, *(inner.positions * 0.5)], faces=faces))


def solid_in_hollow():
    outer, inner = hollow(), cube()
    faces = np.concatenate([outer.faces, inner.faces + 16])
    return flat(Mesh(positions=[*outer.positions, *(inner.positions * 0.25)], faces=faces))


CLEAN = {
    "sheet": lambda: (SHEET, None),
    "pair of sheets": lambda: (FINE_SHEET, SHEET),
    "sphere": lambda: (smooth(icosphere(3)), None),
    "cuboid with charts": lambda: (cuboid(1, 2, 4), None),
    "pair of cuboids": lambda: (cuboid(1, 2, 4), cuboid(1, 2, 4)),
    "charts twice the padding apart": lambda: (
        squares(((0, 0, 0), (0.125, 0.125), (0.1875, 0.1875)),
                ((2, 0, 0), (0.375, 0.125), (0.1875, 0.1875))), None),
    "hollow": lambda: (hollow(), None),
    "solid in a hollow": lambda: (solid_in_hollow(), None),
    "one triangle": lambda: (
        soup([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[0, 1, 2]]), None),
}  # fmt: skip


@pytest.fixture(params=sorted(CLEAN))
def clean(request):
    """Meshes without a fault."""
    return CLEAN[request.param]()


@pytest.fixture
def case_of():
    return lambda name: CASES[name]()
