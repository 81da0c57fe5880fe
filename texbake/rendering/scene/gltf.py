"""Reading glTF 2.0 files as scenes: objects with their materials, lights, and the first camera.

In glTF, a light's intensity is in candela (lux for directional lights), and a diffuse surface
reflects 1 / pi of it in each direction. Here the intensity is what a white surface reflects, so it
is divided by pi. The `range` of a light is ignored; it only lets renderers skip distant lights.

Based on: Khronos Group, KHR_lights_punctual, 2020; glTF 2.0 Specification, section 3.10.
"""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileError, MeshError, OptionError, first_few, quoted, shortened, warn_of
from texbake.files import PathLike, is_file
from texbake.limits import file_beside
from texbake.mesh.compose import MeshPart
from texbake.mesh.files.conversion import check_corner_count
from texbake.mesh.files.gltf import SceneNodes, check_instance_count, scene_nodes
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_materials import material_index
from texbake.mesh.files.gltf_primitives import PrimitiveRequest, read_primitives
from texbake.mesh.files.source import short_name
from texbake.mesh.files.unread_parts import warn_of_pose
from texbake.mesh.mesh import FloatArray, Mesh, UvSet
from texbake.mesh.normals import with_flat_normals
from texbake.progress import Progress, Stages
from texbake.rendering.scene.gltf_materials import MaterialReader, SceneMaterial, set_name
from texbake.rendering.scene.lights import Light, Lighting, Vector
from texbake.rendering.scene.scene import CameraView, Scene, SceneObject

# Extensions that are supported, or do not affect how a scene looks.
SHOWN = (
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "MSFT_lod",
)


def read_gltf_scene(path: PathLike, *, at_rest: bool = False, progress: Progress = None) -> Scene:
    """Read a .glb or .gltf file as a scene; without a warning of skins if it shall be `at_rest`."""
    with Stages(progress).stage(f"read {Path(path).name}"):
        document = read_document(path)
        placed = scene_nodes(document)
        check_instance_count(placed)
        if not at_rest:
            warn_of_pose(document)
        return _Reader(document).scene(placed)


class _Reader:
    """Collects the parts of a scene, node by node."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.materials = MaterialReader(document)
        self.objects: list[SceneObject] = []
        self.lights: list[Light] = []
        self.view: CameraView | None = None
        self.n_corners = 0
        self.meshes: dict[tuple[int, int], Mesh | None] = {}
        self.shown: dict[int, list[int]] = {}  # primitives of a mesh that have triangles
        self.notes = [
            f"it uses {shortened(name)}, which the renderer does not support"
            for name in dict.fromkeys(
                [*document.texts("extensionsUsed"), *document.texts("extensionsRequired")]
            )
            if name not in SHOWN
        ]

    def scene(self, placed: SceneNodes) -> Scene:
        """Everything that the file's scene holds."""
        matrices = placed.matrices()
        of_meshes = placed.mesh_matrices(matrices)
        for node, matrix, of_mesh in zip(placed.nodes, matrices, of_meshes, strict=True):
            if "mesh" in node:
                self._add_mesh(node, of_mesh)
            light = light_of(self.document, node, matrix)
            if light is not None:
                self.lights.append(light)
            self._add_view(view_of(self.document, node, matrix))
        path = self.document.path
        for line in first_few(self.materials.missing):
            warn_of(path, line)
        if not self.objects:
            raise MeshError(f"{path}: it has no faces; a mesh needs at least one triangle")
        return Scene(
            objects=tuple(self.objects),
            lighting=Lighting(lights=tuple(self.lights)),
            view=self.view,
            name=path.name,
            notes=first_few(self.notes),
            files=self._files(),
        )

    def _files(self) -> tuple[Path, ...]:
        """Buffers and images that lie beside the file."""
        document = self.document
        owners = [*document.objects(document.content, "buffers"),
                  *document.objects(document.content, "images")]  # fmt: skip
        uris = [item.get("uri") for item in owners]
        found = []
        for uri in uris:
            if isinstance(uri, str) and not uri.startswith("data:"):
                with suppress(FileError):  # the image counts as missing
                    found.append(file_beside(document.path, unquote(uri)))
        return tuple(filter(is_file, found))

    def _add_view(self, view: CameraView | str | None) -> None:
        if isinstance(view, str):
            self.notes.append(view)
        elif self.view is None:
            self.view = view

    def _add_mesh(self, node: dict[str, Any], matrix: FloatArray) -> None:
        index = node["mesh"]
        source = self.document.item("meshes", index)
        name = short_name(node.get("name") or source.get("name") or f"mesh {index}")
        primitives = self.document.objects(source, "primitives")
        for i in self.shown.get(index, range(len(primitives))):
            primitive = primitives[i]
            attributes = self.document.mapping(primitive, "attributes")
            found = self.materials.material(
                material_index(self.document, primitive), vertex_colors="COLOR_0" in attributes
            )
            if (index, i) not in self.meshes:
                request = PrimitiveRequest(primitive, found.uv_set, tuple(found.further))
                (piece,) = read_primitives(self.document, [request], keeps_colors=True)
                self.meshes[index, i] = self._mesh(piece, name, found)
            mesh = self.meshes[index, i]
            if mesh is None:
                continue
            self.n_corners += max(mesh.faces.size, mesh.n_vertices)
            check_corner_count(self.n_corners, self.document.path)
            try:
                item = SceneObject(
                    mesh=mesh,
                    material=found.material,
                    transform=None if np.array_equal(matrix, np.eye(4)) else matrix,
                    name=name if len(primitives) == 1 else f"{name} {i}",
                )
            except OptionError:
                # The specification allows this as a way to hide a node's content.
                self.notes.append(f"the node {quoted(name)} is scaled flat; it is left out")
                continue
            self.objects.append(item)
        if index not in self.shown:
            numbers = range(len(primitives))
            self.shown[index] = [i for i in numbers if self.meshes[index, i] is not None]

    def _mesh(self, piece: MeshPart | None, name: str, of: SceneMaterial) -> Mesh | None:
        if piece is None:
            return None
        has_normals = piece.normals is not None
        tangents = None
        if piece.tangents is not None and has_normals:
            tangents = piece.tangents[piece.corners].astype(np.float32)
        uvs, uv_faces = piece.uvs, piece.corners
        corner_of_image = UvSet(np.array([[0.0, 1.0]]), 0 * piece.corners)
        if uvs is None and of.has_textures:
            self.notes.append(
                f"{quoted(name)} has textures but no texture coordinates; (0, 0) is used"
            )
            uvs, uv_faces = corner_of_image.uvs, corner_of_image.faces
        uv_sets = {}
        for number in of.further:
            if set_name(number) in piece.uv_sets:
                uv_sets[set_name(number)] = piece.uv_sets[set_name(number)]
            else:
                self.notes.append(f"{quoted(name)} has no {set_name(number)}; (0, 0) is used")
                uv_sets[set_name(number)] = corner_of_image
        mesh = Mesh(
            positions=piece.positions,
            faces=piece.faces,
            uvs=uvs,
            uv_faces=None if uvs is None else uv_faces,
            uv_sets=uv_sets,
            normals=piece.normals,
            normal_faces=piece.corners if has_normals else None,
            tangents=tangents,
            colors=piece.colors,
            name=name,
        )
        return mesh if has_normals else with_flat_normals(mesh)


# glTF allows a cone of 180 degrees; a slightly narrower one looks the same.
_WIDEST = 179.9


def light_of(document: Document, node: dict[str, Any], matrix: FloatArray) -> Light | None:
    """Return the light of a node, which shines along the node's -z axis; None if it has none."""
    extension = document.mapping(document.mapping(node, "extensions"), "KHR_lights_punctual")
    if "light" not in extension:
        return None
    owner = document.mapping(
        document.mapping(document.content, "extensions"), "KHR_lights_punctual"
    )
    index, lights = extension["light"], document.objects(owner, "lights")
    if not isinstance(index, int) or not 0 <= index < len(lights):
        document.fail(f"it has no light {quoted(index)}")
    light = lights[index]
    kind = light.get("type")
    if kind not in ("directional", "point", "spot"):
        document.fail(f"the light type {quoted(kind)} is not known")
    color = document.numbers(light, "color", 3)
    red, green, blue = (1.0, 1.0, 1.0) if color is None else np.maximum(color, 0.0).tolist()
    return Light(
        name=str(light.get("name") or node.get("name") or f"light {index}"),
        kind=kind,
        color=(red, green, blue),
        intensity=document.number(light, "intensity", 1.0) / math.pi,
        position=_vector(matrix[:3, 3]),
        direction=_vector(-_unit(document, matrix[:3, 2])),
        up=_vector(_unit(document, matrix[:3, 1])),
        **(_cone(document, light) if kind == "spot" else {}),
    )


def _cone(document: Document, light: dict[str, Any]) -> dict[str, Any]:
    spot = document.mapping(light, "spot")
    outer = document.number(spot, "outerConeAngle", math.pi / 4)
    inner = document.number(spot, "innerConeAngle", 0.0)
    if not 0.0 <= inner < outer <= math.pi / 2 + 1e-6:
        document.fail(f"a cone from {inner:g} to {outer:g} radians is not valid")
    return {"angle": min(math.degrees(2.0 * outer), _WIDEST), "blend": 1.0 - inner / outer}


def view_of(
    document: Document, node: dict[str, Any], matrix: FloatArray
) -> CameraView | str | None:
    """Return the view of a node's camera, why it is not supported, or None without a camera."""
    if "camera" not in node:
        return None
    camera = document.item("cameras", node["camera"])
    name = camera.get("name") or node.get("name") or node["camera"]
    if camera.get("type") != "perspective":
        kind = quoted(camera.get("type"))
        return f"the camera {quoted(name)} is {kind}; the renderer supports only perspective"
    lens = document.mapping(camera, "perspective")
    fov = math.degrees(document.number(lens, "yfov", 0.0))
    near = document.number(lens, "znear", 0.0)
    if not (0.0 < fov < 180.0 and near > 0.0):
        document.fail(f"the camera {quoted(name)} has no field of view, or no near plane")
    position = matrix[:3, 3]
    return CameraView(
        position=_vector(position),
        # Far enough from the camera that rounding does not change the direction.
        target=_vector(position - _unit(document, matrix[:3, 2]) * (1.0 + np.abs(position).max())),
        up=_vector(_unit(document, matrix[:3, 1])),
        fov=fov,
        near=near,
    )


def _vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _unit(document: Document, direction: FloatArray) -> FloatArray:
    length = float(pm.norm(direction))
    if not 0.0 < length < math.inf:
        document.fail("a node with a light or a camera is scaled to nothing")
    return np.asarray(direction / length)
