"""Meshes of the trimesh library and back, and the one rule for what a function takes as a mesh."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import (
    MeshError,
    OptionError,
    counted,
    one_line,
    quoted,
    require_library,
    warn_of,
)
from texbake.files import PathLike
from texbake.mesh.compose import join_parts
from texbake.mesh.files.conversion import linear_colors, srgb_bytes
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray, Mesh
from texbake.mesh.weld import split_vertices, values_of_vertices

if TYPE_CHECKING:
    import trimesh

MeshLike: TypeAlias = "Mesh | PathLike | trimesh.Trimesh | trimesh.Scene"
"""What every public function takes for a mesh: a `Mesh`, the path of a file, or trimesh's own."""

_GROUPS = "group"  # key of the faces' groups among trimesh's face attributes
_GROUP_NAMES = "group_names"  # key of their names in the metadata
_COLORS = "color"  # key of colors beside texture coordinates, as trimesh's glTF reader has it


def as_mesh(value: MeshLike) -> Mesh:
    """Return a mesh as a `Mesh`: itself, read from a file, or converted from trimesh."""
    if isinstance(value, Mesh):
        return value
    if isinstance(value, str | os.PathLike):
        from texbake.mesh.files import read_mesh

        return read_mesh(value)
    return from_trimesh(value)


def plain_array(value: Any, name: str) -> AnyArray:
    """Return numbers of NumPy, torch or a similar library as an array, without a copy if possible.

    >>> plain_array([1.0, 2.0], "values").tolist()
    [1.0, 2.0]
    """
    device = getattr(value, "device", None)
    if getattr(device, "type", "cpu") != "cpu":
        raise OptionError(f"{name}: it is a tensor on {device}; copy it to the CPU with .cpu()")
    try:
        if hasattr(value, "detach"):  # otherwise torch refuses a tensor with a gradient
            value = value.detach()
        if not hasattr(value, "__array__") and hasattr(value, "numpy"):
            value = value.numpy()
        array = np.asarray(value)
    except (TypeError, ValueError, RuntimeError) as error:
        raise OptionError(f"{name}: it is not an array of numbers ({one_line(error)})") from error
    if array.dtype.kind not in "biuf":
        raise OptionError(f"{name}: it is not an array of numbers, but {quoted(value)}")
    return array


def from_trimesh(mesh: trimesh.Trimesh | trimesh.Scene, *, name: str | None = None) -> Mesh:
    """Convert a mesh of trimesh to a `Mesh`.

    Parameters
    ----------
    mesh
        A `trimesh.Trimesh`; or a `trimesh.Scene`, whose meshes are moved to their places and
        joined, one group for each node.
    name
        What messages call the mesh. By default the name of the file that trimesh read, else
        `mesh`.

    Returns
    -------
    Mesh
        Positions bit-equal, faces in their order. Texture coordinates come from
        ``mesh.visual.uv``, vertex colors from the colors of vertices. Normals are those that the
        mesh holds: read from a file, assigned, or computed by an earlier use of
        ``mesh.vertex_normals``; they are not computed here, so that `texbake` shades a mesh
        without any as it shades all others. Groups that `to_trimesh` wrote come back. Face colors
        and materials are dropped. Arrays are copied: a later change to one mesh does not reach the
        other.

    Raises
    ------
    MeshError
        It is not a triangle mesh, has no faces, a number is not finite, or an index is out of
        range.

    Examples
    --------
    >>> import trimesh
    >>> from_trimesh(trimesh.creation.box()).n_faces
    12
    """
    # A caller with a mesh of trimesh has imported trimesh.
    trimesh: Any = sys.modules.get("trimesh")
    if trimesh and isinstance(mesh, trimesh.Scene):
        return _joined_scene(mesh, name)
    if not (trimesh and isinstance(mesh, trimesh.Trimesh)):
        raise MeshError(
            f"mesh: it is of type {type(mesh).__name__}; "
            "give a texbake.Mesh, a trimesh.Trimesh or the path of a mesh file"
        )
    name = name or str(mesh.metadata.get("file_name") or "mesh")
    faces = np.array(mesh.faces)
    fields: dict[str, Any] = {"positions": np.array(mesh.vertices, np.float64), "faces": faces}
    if faces.shape[1:] != (3,) or len(faces) == 0:
        raise MeshError(f"{name}: it has no faces; a mesh needs at least one triangle")
    uvs = getattr(mesh.visual, "uv", None)
    if uvs is not None and len(uvs) == len(mesh.vertices):
        fields |= {"uvs": np.array(uvs, np.float64)[:, :2], "uv_faces": faces}
    if "vertex_normals" in mesh._cache.cache:
        fields |= {"normals": np.array(mesh.vertex_normals, np.float64), "normal_faces": faces}
    fields["colors"] = _vertex_colors(mesh)
    groups = mesh.face_attributes.get(_GROUPS)
    if groups is not None and _GROUP_NAMES in mesh.metadata:
        names = tuple(str(group) for group in mesh.metadata[_GROUP_NAMES])
        fields |= {"face_groups": np.array(groups), "group_names": names}
    return Mesh(name=name, **fields)


def _vertex_colors(mesh: trimesh.Trimesh) -> Float32Array | None:
    """(V, 3) or (V, 4) colors of vertices; None where they were never given."""
    colors = None
    if mesh.visual.kind == "vertex":
        colors = mesh.visual.vertex_colors
    elif mesh.visual.kind == "texture":
        colors = mesh.visual.vertex_attributes.get(_COLORS)
    if colors is None or np.shape(colors)[:-1] != (len(mesh.vertices),):
        return None
    colors = np.array(colors)
    scale = np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else 1.0
    return linear_colors(colors / scale)


def _world_matrix(scene: trimesh.Scene, node: str) -> FloatArray:
    """(4, 4): product of matrices down to a node, since trimesh's own depends on the processor."""
    tree, matrix = scene.graph.transforms, np.eye(4)
    with np.errstate(over="ignore", invalid="ignore"):
        while node != scene.graph.base_frame:
            parent = tree.parents[node]
            local = tree.edge_data[parent, node].get("matrix")
            matrix = matrix if local is None else pm.matmul(local, matrix)
            node = parent
    return matrix


def _joined_scene(scene: trimesh.Scene, name: str | None) -> Mesh:
    """Meshes of a scene at their places, as one."""
    import trimesh

    name = name or str(scene.metadata.get("file_name") or "scene")
    parts, matrices = [], []
    n_projective = 0
    for node in scene.graph.nodes_geometry:
        matrix = _world_matrix(scene, node)
        mesh = scene.geometry[scene.graph.transforms.node_data[node]["geometry"]]
        n_projective += not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0))
        if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
            continue
        part = from_trimesh(mesh, name=name)
        if part.face_groups is None:
            groups = np.zeros(part.n_faces, np.int32)
            part = part.replace(face_groups=groups, group_names=(str(node),))
        parts.append(part)
        matrices.append(matrix)
    if not parts:
        raise MeshError(f"{name}: it has no faces; a mesh needs at least one triangle")
    if n_projective:
        n_left_out = counted(n_projective, "matrix", "matrices")
        warn_of(name, f"left out the projective row of {n_left_out}")
    return join_parts(parts, name, np.array(matrices))


def to_trimesh(mesh: MeshLike) -> trimesh.Trimesh:
    """Convert a mesh to a `trimesh.Trimesh`, which has one index for all attributes of a vertex.

    Parameters
    ----------
    mesh
        A `Mesh`, or whatever else `as_mesh` takes.

    Returns
    -------
    trimesh.Trimesh
        Faces in their order, and the vertices 0 to V - 1 at bit-equal positions. Where corners at
        one position differ in texture coordinates or normals, further vertices follow, one for
        each combination. Texture coordinates are in ``visual.uv``; vertex colors, as sRGB
        bytes, in ``visual.vertex_colors``, or beside texture coordinates in
        ``visual.vertex_attributes["color"]``; groups in ``face_attributes["group"]`` and
        ``metadata["group_names"]``. Nothing is merged or removed, so degenerate faces stay.
        Tangents are dropped.

    Raises
    ------
    MeshError, FileError, FileFormatError
        As `as_mesh` raises them.

    Examples
    --------
    >>> from texbake.mesh.shapes import cube
    >>> to_trimesh(cube()).volume
    np.float64(1.0)
    """
    trimesh = require_library("trimesh", "to_trimesh")
    mesh = as_mesh(mesh)
    vertices, corners, faces = split_vertices(mesh)
    visual = None
    colors = None
    if mesh.colors is not None and mesh.colors.shape[1] in (3, 4):
        colors = srgb_bytes(mesh.colors)[vertices]
    if mesh.uvs is not None and mesh.uv_faces is not None:
        visual = trimesh.visual.TextureVisuals(
            uv=values_of_vertices(mesh.uvs, mesh.uv_faces, corners)
        )
        if colors is not None:
            visual.vertex_attributes[_COLORS] = colors
    normals = None
    if mesh.normals is not None and mesh.normal_faces is not None:
        normals = values_of_vertices(mesh.normals, mesh.normal_faces, corners)
    metadata: dict[str, Any] = {"file_name": mesh.name}
    if mesh.face_groups is not None:
        metadata[_GROUP_NAMES] = list(mesh.group_names)
    return trimesh.Trimesh(
        vertices=mesh.positions[vertices],
        faces=faces,
        vertex_normals=normals,
        vertex_colors=colors if visual is None else None,
        visual=visual,
        face_attributes=None if mesh.face_groups is None else {_GROUPS: np.array(mesh.face_groups)},
        metadata=metadata,
        process=False,
        validate=False,
    )
