"""What moves a mesh and stands beside it in its file: nodes, skins, animations, cameras, lights.

A `Mesh` is one list of triangles where its file has nodes with meshes. A `Rig` says which node each
object of the mesh came from, and where the node stands, so that a writer can put the triangles
back. All else is glTF's own JSON, which texbake carries along. Readers of other formats build that
JSON from their files.

Simplification adds the errors in poses of the mesh, so that joints keep the edges at which they
bend. A skin without animation is posed by rotating all its joints. Poses are approximate, which is
enough for that: rotations are interpolated linearly, and so are splines.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.files import PathLike
from texbake.mesh.deformation import Deformation
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.records import dataclass

# Least determinant of a map with columns of length 1 that is inverted: float64 leaves four digits.
_LEAST_DETERMINANT = 1e-12


def rotation_matrices(quaternions: FloatArray) -> FloatArray:
    """(n, 3, 3) matrices of quaternions; one of length 0 is the identity."""
    lengths = np.sqrt(pm.matmul(quaternions[:, None], quaternions[:, :, None]))[:, :, 0]
    units = np.tile([0.0, 0.0, 0.0, 1.0], (len(quaternions), 1))
    np.divide(quaternions, lengths, out=units, where=lengths > 0.0)
    x, y, z, w = units.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).reshape(3, 3, -1).transpose(2, 0, 1)


def decomposed(matrices: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Translations, rotations and scales; each quaternion has the sign nearer to the one before."""
    linear = matrices[:, :3, :3]
    scales = np.sqrt((linear * linear).sum(axis=1))
    scales[pm.det(linear) < 0.0, 0] *= -1.0
    units = np.divide(linear, scales[:, None], out=np.tile(np.eye(3), (len(linear), 1, 1)),
                      where=scales[:, None] != 0.0)  # fmt: skip
    trace = units[:, 0, 0] + units[:, 1, 1] + units[:, 2, 2]
    table = np.empty((len(units), 4, 4))  # each row a multiple of the quaternion
    m = units
    table[:, 3, 3] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        table[:, i, i] = 1.0 + 2.0 * m[:, i, i] - trace
        table[:, i, j] = table[:, j, i] = m[:, i, j] + m[:, j, i]
        table[:, i, 3] = table[:, 3, i] = m[:, k, j] - m[:, j, k]
    rows = table[np.arange(len(table)), np.argmax(table[:, range(4), range(4)], axis=1)]
    rows /= np.sqrt((rows * rows).sum(axis=1, keepdims=True))
    signs = np.sign((rows[1:] * rows[:-1]).sum(axis=1))
    rows[1:] *= np.cumprod(np.where(signs < 0.0, -1.0, 1.0))[:, None]
    return matrices[:, :3, 3], rows, scales


def node_fields(matrix: FloatArray) -> dict[str, list[float]]:
    """Translation, rotation and scale of a node with a (4, 4) matrix; shear is lost."""
    rows = (values[0].tolist() for values in decomposed(matrix[None]))
    return dict(zip(("translation", "rotation", "scale"), rows, strict=True))


def matrix_field(matrix: FloatArray) -> dict[str, list[float]]:
    """A (4, 4) matrix as a field of a node, column after column."""
    return {"matrix": matrix.T.ravel().tolist()}


def node_matrix(node: Mapping[str, Any]) -> FloatArray:
    """(4, 4) matrix of a node in its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    rotation = np.array([node.get("rotation", (0.0, 0.0, 0.0, 1.0))], np.float64)
    matrix[:3, :3] = rotation_matrices(rotation)[0] * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def inverse(matrix: FloatArray) -> FloatArray | None:
    """Inverse of a (4, 4) matrix; None where it flattens what it moves."""
    with np.errstate(all="ignore"):
        lengths = pm.norm(matrix[:3, :3], axis=0)
        if not ((lengths > 0.0) & np.isfinite(lengths)).all():
            return None
        if not abs(pm.det(matrix[:3, :3] / lengths)) > _LEAST_DETERMINANT:
            return None
        found = np.asarray(pm.inv(matrix), np.float64)
    return found if np.isfinite(found).all() else None


def inverse_or_identity(matrix: FloatArray) -> FloatArray:
    """Inverse of a (4, 4) matrix; the identity where it has none."""
    found = inverse(matrix)
    return np.eye(4) if found is None else found


@dataclass(frozen=True, kw_only=True, eq=False)
class RigObject:
    """An object of a mesh, and the node that carries it."""

    node: int  # number of the node
    matrix: FloatArray  # (4, 4) float64; from the mesh of the node to the positions of `Mesh`
    fields: Mapping[str, Any] = field(default_factory=dict)  # glTF's fields of its mesh
    n_morphs: int = 0
    ignores_node: bool = False  # whether a skin moves the object, or did, instead of its node


@dataclass(frozen=True, kw_only=True, eq=False)
class Rig:
    """Nodes of a file and what refers to them, as in glTF; accessors are numbers of `arrays`."""

    content: Mapping[str, Any]
    arrays: Mapping[int, Float32Array] = field(default_factory=dict)  # each (n, width)
    objects: Mapping[int, RigObject]  # by the numbers of `Mesh.group_objects`
    has_morph_normals: bool = False
    passed_over: tuple[str, ...] = ()  # what else is in the file, such as `2 cameras`

    @property
    def nodes(self) -> list[dict[str, Any]]:
        """JSON of the nodes."""
        return self.content["nodes"]  # type: ignore[no-any-return]

    @property
    def moving_nodes(self) -> set[int]:
        """Nodes that an animation moves."""
        channels = (
            channel["target"]
            for animation in self.content.get("animations", ())
            for channel in animation["channels"]
        )
        return {target["node"] for target in channels if target["path"] != "weights"}

    @property
    def bends(self) -> bool:
        """Whether objects have skins or morph targets."""
        skinned = ("skin" in self.nodes[item.node] for item in self.objects.values())
        return self.has_morphs or any(skinned)

    @property
    def has_morphs(self) -> bool:
        """Whether objects have morph targets."""
        return any(item.n_morphs for item in self.objects.values())

    def object_of(self, group: int, mesh: Mesh) -> RigObject | None:
        """Return the object that a group of a mesh belongs to; None where objects were joined."""
        if mesh.group_objects:
            return self.objects.get(mesh.group_objects[group])
        return next(iter(self.objects.values())) if len(self.objects) == 1 else None

    def fits(self, mesh: Mesh) -> bool:
        """Whether each group of a mesh belongs to an object of the rig."""
        groups = range(len(mesh.group_names)) if mesh.face_groups is not None else [0]
        return all(self.object_of(group, mesh) is not None for group in groups)

    def transformed(self, matrix: FloatArray) -> Rig:
        """Return the rig of a mesh whose positions a (4, 4) matrix has transformed."""
        if (matrix == np.eye(4)).all():
            return self
        number = len(self.nodes)
        scenes = [dict(scene) for scene in self.content["scenes"]]
        first = scenes[self.content.get("scene", 0)]
        root = {"name": "transform", **matrix_field(matrix), "children": first.get("nodes", [])}
        first["nodes"] = [number]
        objects = {
            key: replace(item, matrix=pm.matmul(matrix, item.matrix))
            for key, item in self.objects.items()
        }
        content = {**self.content, "nodes": [*self.nodes, root], "scenes": scenes}
        return replace(self, content=content, objects=objects)


def read_rig(path: PathLike) -> Rig | None:
    """Read the rig of a file; None for formats without one."""
    place = _READERS.get(Path(path).suffix.lower())
    if place is None:
        return None
    module, name = place
    found: Rig = getattr(import_module(f"texbake.mesh.files.{module}"), name)(path)
    return found


_READERS = {
    ".glb": ("gltf_rig", "read_gltf_rig"),
    ".gltf": ("gltf_rig", "read_gltf_rig"),
    ".fbx": ("fbx_rig", "read_fbx_rig"),
}


def moving_ancestors(
    places: Iterable[int], parents: Sequence[int], moving: set[int]
) -> dict[int, int]:
    """Nearest moving node of each node: itself or an ancestor; absent where none moves."""
    known: dict[int, int] = {}
    for place in places:
        at = place
        while at >= 0 and at not in moving:
            at = parents[at]
        if at >= 0:
            known[place] = at
    return known


_N_POSES = 4
_BEND = 0.35  # sine of half the angle by which joints rotate: 41 degrees

Values = Mapping[tuple[int, str], FloatArray]  # by the number of a node and the animated property


def with_poses(mesh: Mesh, rig: Rig | None) -> Mesh:
    """Return a mesh with a few poses for simplification, if it has a skin or morph targets."""
    deformation = mesh.deformation
    if deformation is None or rig is None or not rig.bends:
        return mesh
    poser = _Poser(rig, mesh)
    poses = np.stack([poser.pose(values) for values in _samples(rig, deformation)])
    finite = poses[[bool(np.isfinite(pose).all()) for pose in poses]]
    return mesh.replace(deformation=replace(deformation, poses=finite))


def _samples(rig: Rig, deformation: Deformation) -> Iterator[Values]:
    """Yield animated values at some times, and trial values of joints and morph targets."""
    animations = rig.content.get("animations", ())
    for i in range(_N_POSES if animations else 0):
        animation = animations[i * len(animations) // _N_POSES]
        yield _sampled(rig, animation, (i + 1) / _N_POSES)
    joints = {joint for skin in rig.content.get("skins", ()) for joint in skin["joints"]}
    if joints and not joints & rig.moving_nodes:
        for axis in range(3):
            turn = np.zeros(4)
            turn[axis], turn[3] = _BEND, math.sqrt(1.0 - _BEND * _BEND)
            yield {(joint, "turn"): turn for joint in joints}
    n_morphs = len(deformation.morphs)
    for first in range(min(n_morphs, 2)):
        weights = np.zeros(n_morphs)
        weights[first::2] = 1.0
        yield {(item.node, "weights"): weights for item in rig.objects.values()}


def _sampled(rig: Rig, animation: Mapping[str, Any], share: float) -> Values:
    """Values at a share of the length of an animation."""
    samplers = animation["samplers"]
    end = max(float(rig.arrays[sampler["input"]].max()) for sampler in samplers)
    start = min(float(rig.arrays[sampler["input"]].min()) for sampler in samplers)
    time = start + share * (end - start)
    found = {}
    for channel in animation["channels"]:
        sampler, target = samplers[channel["sampler"]], channel["target"]
        times = rig.arrays[sampler["input"]][:, 0].astype(np.float64)
        values = rig.arrays[sampler["output"]].astype(np.float64).reshape(len(times), -1)
        if sampler["interpolation"] == "CUBICSPLINE":
            values = np.split(values, 3, axis=1)[1]
        after = int(np.searchsorted(times, time, side="right"))
        before = max(after - 1, 0)
        after = min(after, len(times) - 1)
        span = times[after] - times[before]
        part = (time - times[before]) / span if span > 0.0 else 0.0
        a, b = values[before], values[after]
        if target["path"] == "rotation" and pm.vecdot(a, b) < 0.0:
            b = -b
        found[target["node"], target["path"]] = a + part * (b - a)
    return found


class _Poser:
    """Poses the vertices of a mesh."""

    def __init__(self, rig: Rig, mesh: Mesh) -> None:
        self.rig, self.mesh = rig, mesh
        self._order: list[tuple[int, int]] = []  # nodes with their parents, parents first
        pending = [(root, -1) for root in rig.content["scenes"][0]["nodes"]]
        while pending:
            node, parent = pending.pop()
            self._order.append((node, parent))
            pending += [(child, node) for child in rig.nodes[node].get("children", ())]
        rest = self._world({})
        self._to_nodes = {node: inverse_or_identity(matrix) for node, matrix in rest.items()}
        # From the world back to where a skinned object is stored, by its first joint.
        self._back: dict[int, FloatArray] = {}
        stored = {rig.nodes[item.node].get("skin"): item.matrix for item in rig.objects.values()}
        for number, skin in enumerate(rig.content.get("skins", ())):
            matrix = stored.get(number, np.eye(4))
            binds = rig.arrays.get(skin.get("inverseBindMatrices", -1))
            for row, joint in enumerate(skin["joints"]):
                bind = np.eye(4) if binds is None else binds[row].reshape(4, 4).T.astype(float)
                if row == 0:
                    back = pm.matmul(matrix, inverse_or_identity(pm.matmul(rest[joint], bind)))
                self._to_nodes[joint] = pm.matmul(bind, inverse_or_identity(matrix))
                self._back[joint] = back

    def pose(self, values: Values) -> FloatArray:
        """(V, 3) positions for some values of nodes."""
        mesh, deformation = self.mesh, self.mesh.deformation
        assert deformation is not None
        points = mesh.positions.copy()
        weights = [value for (_, path), value in values.items() if path == "weights"]
        for i, morph in enumerate(deformation.morphs):
            factor = max((float(row[i]) for row in weights if i < len(row)), default=0.0)
            points[morph.vertices] += factor * morph.displacements
        world = self._world(values)
        matrices = np.tile(np.eye(4)[:3], (len(self.rig.nodes), 1, 1))
        for node in np.unique(deformation.joints[deformation.weights > 0.0]).tolist():
            moved = pm.matmul(world[node], self._to_nodes[node])
            matrices[node] = pm.matmul(self._back.get(node, np.eye(4)), moved)[:3]
        rows = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        posed = np.zeros_like(points)
        for joint, weight in zip(deformation.joints.T, deformation.weights.T, strict=True):
            posed += weight[:, None] * pm.matvec(matrices[joint], rows)
        is_bound = (deformation.weights > 0.0).any(axis=1, keepdims=True)
        return np.where(is_bound, posed, points)

    def _world(self, values: Values) -> dict[int, FloatArray]:
        """(4, 4) matrix of each node to the world."""
        world = {-1: np.eye(4)}
        for node, parent in self._order:
            found = self.rig.nodes[node]
            changed = {
                path: values[node, path]
                for path in ("translation", "rotation", "scale")
                if (node, path) in values
            }
            if changed:
                found = {key: value for key, value in found.items() if key != "matrix"} | changed
            matrix = node_matrix(found)
            if (node, "turn") in values:
                matrix = pm.matmul(matrix, node_matrix({"rotation": values[node, "turn"]}))
            world[node] = pm.matmul(world[parent], matrix)
        return world
