"""Ten models as people make them: quads, n-gons, mirrored halves, objects, hard edges, thin walls.

Each is the text of an OBJ file. `write_model` writes one, and `bumpy` makes a high-poly mesh of it.
"""

import itertools
from dataclasses import dataclass, field

import numpy as np

from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import smooth_normals

L_SHAPE = [(0, 0), (2, 0), (2, 0.7), (0.8, 0.7), (0.8, 2), (0, 2)]
HEXAGON = [(np.cos(a), np.sin(a)) for a in np.arange(6) * np.pi / 3]


@dataclass
class Part:
    """An object: polygons of points, with a smoothing group each; 0 is flat."""

    points: np.ndarray
    polygons: list
    groups: list
    uvs: np.ndarray | None = None  # of the points
    normals: np.ndarray | None = field(default=None)  # of the points, in place of the groups

    def moved(self, by, scale=1.0):
        return Part(np.asarray(self.points) * scale + by, self.polygons, self.groups, self.uvs)


def prism(outline, low, high, side_group=0):
    """A prism along z: two n-gons and a quad for each side."""
    n = len(outline)
    points = [(*point, z) for z in (low, high) for point in outline]
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    caps = [list(range(n))[::-1], list(range(n, 2 * n))]
    return Part(np.array(points), caps + sides, [0, 0] + [side_group] * n)


def circle(n, radius=1.0):
    angles = np.arange(n) / n * 2.0 * np.pi
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * radius


def box(size=(1.0, 1.0, 1.0), at=(0.0, 0.0, 0.0)):
    x, y, z = np.array(size) / 2.0
    return prism([(-x, -y), (x, -y), (x, y), (-x, y)], -z, z).moved(at)


def beveled_crate(bevel=0.1):
    """A chamfered cube with face-weighted normals: those of its six sides."""
    corners = list(itertools.product((-1, 1), repeat=3))
    points, normals, number = [], [], {}
    for corner, axis in itertools.product(corners, range(3)):
        number[*corner, axis] = len(points)
        points.append([c * (1 if i == axis else 1 - bevel) for i, c in enumerate(corner)])
        normals.append([c * (i == axis) for i, c in enumerate(corner)])
    polygons = [[number[*corner, axis] for axis in range(3)] for corner in corners]
    for axis, sign in itertools.product(range(3), (-1, 1)):
        around = [corner for corner in corners if corner[axis] == sign]
        polygons.append([number[*around[i], axis] for i in (0, 1, 3, 2)])
    for one, other in itertools.combinations(corners, 2):
        differing = [i for i in range(3) if one[i] != other[i]]
        if len(differing) == 1:
            u, v = (i for i in range(3) if i != differing[0])
            polygons.append(
                [number[*one, u], number[*other, u], number[*other, v], number[*one, v]]
            )
    points = np.array(points, float)
    for polygon in polygons:
        a, b, c = points[polygon[:3]]
        if np.cross(b - a, c - a) @ points[polygon].mean(axis=0) < 0:
            polygon.reverse()
    return Part(points, polygons, [1] * len(polygons), normals=np.array(normals, float))


def grid(at, n_u, n_v, group=1):
    """A patch of quads; `at` takes u and v in [0, 1]. Its texture coordinates are (u, v)."""
    v, u = np.meshgrid(np.linspace(0, 1, n_v + 1), np.linspace(0, 1, n_u + 1), indexing="ij")
    first = (np.arange(n_v)[:, None] * (n_u + 1) + np.arange(n_u)).ravel()
    quads = np.stack([first, first + 1, first + n_u + 2, first + n_u + 1], axis=1).tolist()
    uvs = np.stack([u.ravel(), v.ravel()], axis=1)
    return Part(np.stack(at(u.ravel(), v.ravel()), axis=1), quads, [group] * len(quads), uvs)


def joined(*parts):
    """Join objects into one, and merge points at the same place."""
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    points = np.concatenate([part.points for part in parts]).round(12) + 0.0
    unique, ids = np.unique(points, axis=0, return_inverse=True)
    polygons, groups = [], []
    for part, start in zip(parts, starts, strict=False):
        for polygon, group in zip(part.polygons, part.groups, strict=True):
            around = [
                i for i, _ in itertools.groupby(ids.ravel()[start + np.array(polygon)].tolist())
            ]
            around = around[:-1] if around[0] == around[-1] else around
            if len(around) > 2:
                polygons.append(around)
                groups.append(group)
    return Part(unique, polygons, groups)


def head():
    """Half a head, and its mirror image with the same texture coordinates."""

    def half(u, v):
        longitude, latitude = np.pi * (u - 0.5), np.pi * (0.1 + 0.8 * v) - np.pi / 2
        depth = 1.0 + 0.25 * np.exp(-20.0 * ((u - 1.0) ** 2 + (v - 0.45) ** 2))  # a nose
        across = np.cos(latitude) * np.cos(longitude)
        return 0.8 * across, 1.2 * np.sin(latitude), depth * np.cos(latitude) * np.sin(longitude)

    one = grid(half, 6, 8)
    other = Part(one.points * (-1, 1, 1), list(one.polygons), one.groups, one.uvs)
    one.polygons = [polygon[::-1] for polygon in one.polygons]
    return one, other


def dome():
    """A thin hemisphere: two walls, closed at the rim."""

    def wall(radius):
        return lambda u, v: (
            radius * np.cos(v * 1.5) * np.cos(2 * np.pi * u),
            radius * np.sin(v * 1.5),
            -radius * np.cos(v * 1.5) * np.sin(2 * np.pi * u),
        )

    outer, inner = grid(wall(1.0), 12, 4), grid(wall(0.97), 12, 4)
    inner.polygons = [polygon[::-1] for polygon in inner.polygons]
    rim = grid(lambda u, v: [(0.97 + 0.03 * v) * x for x in wall(1.0)(u, 0 * u)], 12, 1, group=0)
    top = grid(
        lambda u, v: [(0.97 + 0.03 * (1 - v)) * x for x in wall(1.0)(u, 1 + 0 * u)], 12, 1, 0
    )
    return joined(outer, inner, rim, top)


def chest():
    """A box that is open at the top, with an inside and a rim."""
    outer, inner = box(), box((0.8, 0.8, 0.9), (0, 0, 0.05))
    for part in (outer, inner):
        del part.polygons[1], part.groups[1]
    inner.polygons = [polygon[::-1] for polygon in inner.polygons]
    ends = np.concatenate([outer.points[4:], inner.points[4:]])
    rim = Part(ends, [[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)], [0] * 4)
    return joined(outer, inner, rim)


def creature():
    """A ball of quads with two lobes, and a crease where its upper and its lower half meet."""
    sides = []
    for axis, sign in itertools.product(range(3), (-1, 1)):

        def at(u, v, axis=axis, sign=sign):
            flat = [2 * u - 1, (2 * v - 1) * sign]
            cube = np.stack([np.full_like(u, sign), *flat])
            ball = np.roll(cube / np.sqrt((cube**2).sum(axis=0)), axis, axis=0)
            return tuple(ball * (1.0 + 0.3 * ball[0] ** 2 - 0.4 * np.abs(ball[1])))

        side = grid(at, 4, 4)
        heights = [side.points[polygon, 1].mean() for polygon in side.polygons]
        side.groups = [1 if height > 0 else 2 for height in heights]
        sides.append(side)
    return joined(*sides)


def leaf():
    """An open card of an n-gon and four quads, bent."""
    stem = grid(lambda u, v: (v * 1.0, 0.2 * np.sin(3 * v), 0.4 * (u - 0.5) * (1 + v)), 2, 2)
    tip = [(1.0, -0.4), (1.0, 0.0), (1.0, 0.4), (1.5, 0.3), (1.8, 0.0), (1.5, -0.3)]
    points = np.array([(x, 0.2 * np.sin(3) + 0.5 * (1.0 - x), z) for x, z in tip])
    return joined(stem, Part(points, [list(range(6))], [1]))


def models():
    """Return models by name, each a dict of its objects by name."""
    hole = prism(circle(24, 0.25), 0.0, 0.3, side_group=1)
    left, right = head()
    return {
        "bracket": {"bracket": prism(L_SHAPE, 0.0, 0.5)},
        "crate": {"crate": beveled_crate()},
        "head": {"left": left, "right": right},
        "wall": {f"brick.{i:03d}": box((2, 1, 1), (x, y, 0))
                 for i, (x, y) in enumerate([(-1, 0), (1, 0), (0, 1)])},
        "screw": {"plate": box((2, 2, 0.2)), "screw": hole.moved((0, 0, 0.1)),
                  "screw head": prism(HEXAGON, 0.0, 0.5).moved((0, 0, 0.4), 0.5)},
        "dome": {"dome": dome()},
        "leaf": {"leaf": leaf()},
        "can": {"can": prism(circle(16), -1.0, 1.0, side_group=1)},
        "creature": {"creature": creature()},
        "chest": {"chest": chest(), "lid": box((1.1, 1.1, 0.2), (0, 0, 0.6))},
    }  # fmt: skip


MODELS = tuple(models())
WITH_UVS = ("head",)  # their texture coordinates are kept


def write_model(name, path):
    """Write a model as an OBJ file."""
    lines, n_points, n_normals = [], 0, 0
    for title, part in models()[name].items():
        lines.append(f"o {title}")
        lines += ["v {:.6f} {:.6f} {:.6f}".format(*point) for point in part.points]
        if name in WITH_UVS:
            lines += ["vt {:.6f} {:.6f}".format(*uv) for uv in part.uvs]
        if part.normals is not None:
            lines += ["vn {:g} {:g} {:g}".format(*normal) for normal in part.normals]
        for polygon, group in zip(part.polygons, part.groups, strict=True):
            words = []
            for point in polygon:
                uv = point + n_points + 1 if name in WITH_UVS else ""
                normal = f"/{point + n_normals + 1}" if part.normals is not None else ""
                words.append(f"{point + n_points + 1}/{uv}{normal}".rstrip("/"))
            lines += [f"s {group or 'off'}", "f " + " ".join(words)]
        n_points += len(part.points)
        n_normals += 0 if part.normals is None else len(part.normals)
    path.write_text("\n".join(lines) + "\n")
    return path


def bumpy(mesh, levels=4, height=0.004):
    """A high-poly mesh: each face cut into 4^levels, with waves, hard where nothing is smooth."""
    positions, faces, objects = mesh.positions, mesh.faces, mesh.face_groups
    for _ in range(levels):
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        pairs, ids = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        a, b, c = faces.T
        ab, bc, ca = (len(positions) + ids.reshape(-1, 3)).T
        positions = np.concatenate([positions, positions[pairs].mean(axis=1)])
        faces = np.concatenate([np.stack(f, axis=1) for f in
                                ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])  # fmt: skip
        objects = None if objects is None else np.tile(objects, 4)
    fine = Mesh(positions=positions, faces=faces, face_groups=objects,
                group_names=mesh.group_names, group_objects=mesh.group_objects)  # fmt: skip
    wave = height * np.sin(14.0 * positions).sum(axis=1, keepdims=True)
    return fine.replace(positions=positions + wave * smooth_normals(fine))
