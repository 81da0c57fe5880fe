"""What a glTF file has beside triangles and materials, read as a `Rig` and carried through.

Nodes are numbered as `scene_nodes`. Nodes outside the scene, and what refers to them, are left out.
A damaged skin, animation, camera or light is left out with a warning.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from texbake.errors import FileFormatError, counted, quoted, warn_of
from texbake.files import PathLike
from texbake.mesh.files.conversion import as_text
from texbake.mesh.files.gltf import SceneNodes, indices, moving_nodes, scene_nodes
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.gltf_primitives import morph_targets
from texbake.mesh.files.source import without_cycle_search
from texbake.mesh.files.unread_parts import LIGHTS
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.mesh.rig import Rig, RigObject, node_fields, node_matrix

_VISIBILITY = "KHR_node_visibility"
_PLACES = {"translation": 3, "rotation": 4, "scale": 3}
_INTERPOLATIONS = {"LINEAR": 1, "STEP": 1, "CUBICSPLINE": 3}
_CAMERAS = ("perspective", "orthographic")
_LIGHT_TYPES = ("directional", "point", "spot")
_ROUNDING = 1e-6  # of a matrix composed again, by its largest number; files may have float32
# Accessors can share bytes, and nodes a mesh. Limits: bytes of arrays per byte of the file, or this
# many in any file, and bytes of the extras of meshes that nodes repeat.
_BYTES_PER_BYTE, _LEAST_BYTES, _MOST_EXTRAS = 8, 1 << 26, 1 << 24


def read_gltf_rig(path: PathLike) -> Rig:
    """Read the nodes of a glTF file and what refers to them."""
    document = read_document(path)
    with without_cycle_search():
        return _RigReader(document, scene_nodes(document)).read()


class _RigReader:
    def __init__(self, document: Document, placed: SceneNodes) -> None:
        self.document, self.placed = document, placed
        self.numbers = {index: place for place, index in enumerate(placed.indices)}
        self.arrays: dict[int, Float32Array] = {}
        self.n_bytes = 0  # of the arrays
        self.meshes: dict[int, tuple[dict[str, Any], int]] = {}  # fields and targets of each
        self.n_extras = 0
        self.moving = moving_nodes(document)

    def read(self) -> Rig:
        """Return the rig of the scene."""
        document, placed = self.document, self.placed
        matrices = placed.mesh_matrices(placed.matrices())
        skins, skin_numbers = self._all("skin", document.content.get("skins"), self._skin)
        cameras, camera_numbers = self._all("camera", document.content.get("cameras"), self._camera)
        lists = _mapping(_mapping(document.content, "extensions"), LIGHTS).get("lights")
        lights, light_numbers = self._all("light", lists, self._light)
        numbers = {"skin": skin_numbers, "camera": camera_numbers, "light": light_numbers}
        nodes = [
            self._node(index, node, numbers)
            for index, node in zip(placed.indices, placed.nodes, strict=True)
        ]
        for place, parent in enumerate(placed.parents.tolist()):
            if parent >= 0:
                nodes[parent].setdefault("children", []).append(place)
        content: dict[str, Any] = {
            "nodes": nodes,
            "scenes": [{"nodes": np.flatnonzero(placed.parents < 0).tolist()}],
        }
        objects = {
            place: self._object(place, node, nodes[place], matrices[place])
            for place, node in enumerate(placed.nodes)
            if "mesh" in node
        }
        if self.n_extras > _MOST_EXTRAS:
            line = "left out extras of meshes that nodes repeat; remove them to keep the others"
            warn_of(document.path, line)
        self.nodes = nodes
        self.n_morphs = {place: item.n_morphs for place, item in objects.items()}
        animations, _ = self._all("animation", document.content.get("animations"), self._animation)
        found = {"skins": skins, "cameras": cameras, "animations": animations}
        content |= {kind: items for kind, items in found.items() if items}
        if lights:
            content["extensions"] = {LIGHTS: {"lights": lights}}
        return Rig(
            content=content,
            arrays=self.arrays,
            objects=objects,
            has_morph_normals=any(map(self._has_morph_normals, document.items("meshes"))),
        )

    def _all(
        self, noun: str, items: Any, read: Callable[[dict[str, Any]], dict[str, Any]]
    ) -> tuple[list[dict[str, Any]], dict[int, int]]:
        """Sound items of a list, and the new number of each by its number in the file."""
        found: list[dict[str, Any]] = []
        numbers: dict[int, int] = {}
        reasons: list[str] = []
        for index, item in enumerate(items if isinstance(items, list) else ()):
            try:
                if not isinstance(item, dict):
                    self.document.fail("it is not an object")
                content = read(item)
            except FileFormatError as error:
                why = str(error).removeprefix(f"{self.document.path}: ")
                reasons.append(f"{noun} {index}: {why}")
                continue
            numbers[index] = len(found)
            found.append({**_named(item), **content})
        if reasons:
            warn_of(self.document.path, f"left out {counted(len(reasons), noun)}: {reasons[0]}")
        return found, numbers

    def _node(
        self, index: int, node: dict[str, Any], numbers: Mapping[str, Mapping[int, int]]
    ) -> dict[str, Any]:
        content = _named(node)
        if node.get("matrix") is not None:
            content["matrix"] = node["matrix"]
            if index in self.moving:  # the node of a channel has no matrix
                matrix = node_matrix(content)
                fields = node_fields(matrix)
                if np.abs(node_matrix(fields) - matrix).max() <= _ROUNDING * np.abs(matrix).max():
                    del content["matrix"]
                    content |= fields
        else:
            content |= {key: node[key] for key in _PLACES if node.get(key) is not None}
        for key in ("skin", "camera"):
            if type(node.get(key)) is int and node[key] in numbers[key]:
                content[key] = numbers[key][node[key]]
        extensions = _mapping(node, "extensions")
        kept: dict[str, Any] = {}
        light = _mapping(extensions, LIGHTS).get("light")
        if type(light) is int and light in numbers["light"]:
            kept[LIGHTS] = {"light": numbers["light"][light]}
        visible = _mapping(extensions, _VISIBILITY).get("visible")
        if type(visible) is bool:
            kept[_VISIBILITY] = {"visible": visible}
        if kept:
            content["extensions"] = kept
        return content

    def _object(
        self, place: int, node: dict[str, Any], content: dict[str, Any], matrix: FloatArray
    ) -> RigObject:
        is_first = node["mesh"] not in self.meshes
        if is_first:
            self.meshes[node["mesh"]] = self._mesh(node["mesh"])
        fields, n_morphs = self.meshes[node["mesh"]]
        if not is_first and "extras" in fields and self.n_extras <= _MOST_EXTRAS:
            self.n_extras += len(json.dumps(fields["extras"]))
        if not is_first and self.n_extras > _MOST_EXTRAS:
            fields = {key: value for key, value in fields.items() if key != "extras"}
        if (weights := _weights(node, n_morphs)) is not None:
            content["weights"] = weights
        return RigObject(
            node=place, matrix=matrix, fields=fields, n_morphs=n_morphs, ignores_node="skin" in node
        )

    def _mesh(self, index: int) -> tuple[dict[str, Any], int]:
        """Fields of a mesh, and the number of its morph targets."""
        mesh = self.document.item("meshes", index)
        primitives = self.document.objects(mesh, "primitives")
        n_morphs = max((len(morph_targets(each)) for each in primitives), default=0)
        fields = _named(mesh)
        if isinstance(extras := fields.get("extras"), dict):
            names = {key: text for key, text in extras.items() if not key.startswith("TEXCOORD_")}
            fields["extras"] = names
        if (weights := _weights(mesh, n_morphs)) is not None:
            fields["weights"] = weights
        return {key: value for key, value in fields.items() if value not in (None, {})}, n_morphs

    def _has_morph_normals(self, mesh: dict[str, Any]) -> bool:
        primitives = self.document.objects(mesh, "primitives")
        targets = (target for each in primitives for target in morph_targets(each))
        return any("NORMAL" in target for target in targets)

    def _camera(self, camera: dict[str, Any]) -> dict[str, Any]:
        kind = camera.get("type")
        if kind not in _CAMERAS or not isinstance(camera.get(kind), dict):
            self.document.fail("it has neither a perspective nor an orthographic view")
        lens = {key: value for key, value in camera[kind].items() if key != "extensions"}
        if sound_json(lens) is None:
            self.document.fail("a number is not finite")
        return {"type": kind, kind: lens}

    def _light(self, light: dict[str, Any]) -> dict[str, Any]:
        if light.get("type") not in _LIGHT_TYPES:
            self.document.fail(f"its type is none of {', '.join(_LIGHT_TYPES)}")
        content = {key: value for key, value in light.items() if key not in ("extensions", "name")}
        if sound_json(content) is None:
            self.document.fail("a number is not finite")
        return content

    def _skin(self, skin: dict[str, Any]) -> dict[str, Any]:
        joints = indices(self.document, skin, "joints")
        if not joints or not set(joints) <= self.numbers.keys():
            self.document.fail("not all its joints are nodes of the scene")
        content: dict[str, Any] = {"joints": [self.numbers[joint] for joint in joints]}
        if type(skin.get("skeleton")) is int and skin["skeleton"] in self.numbers:
            content["skeleton"] = self.numbers[skin["skeleton"]]
        if "inverseBindMatrices" in skin:
            rows = self._array(skin["inverseBindMatrices"], 16)
            if len(self.arrays[rows]) < len(joints):
                self.document.fail("it has fewer inverse bind matrices than joints")
            content["inverseBindMatrices"] = rows
        return content

    def _animation(self, animation: dict[str, Any]) -> dict[str, Any]:
        samplers = self.document.objects(animation, "samplers")
        used: list[dict[str, Any]] = []
        channels: list[dict[str, Any]] = []
        for channel in self.document.objects(animation, "channels"):
            target = self.document.mapping(channel, "target")
            node, path = target.get("node"), target.get("path")
            number = channel.get("sampler")
            if type(number) is not int or not 0 <= number < len(samplers):
                self.document.fail(f"a channel names a missing sampler {quoted(number)}")
            if type(node) is not int or node not in self.numbers or not isinstance(path, str):
                continue
            place = self.numbers[node]
            n_values = 1
            if path == "weights":
                n_values = self.n_morphs.get(place, 0)
            elif path not in _PLACES or "matrix" in self.nodes[place]:
                continue
            if n_values:
                used.append(self._sampler(samplers[number], _PLACES.get(path, 1), n_values))
                channels.append({"sampler": len(used) - 1, "target": {"node": place, "path": path}})
        if not channels:
            self.document.fail("it moves no node of the scene")
        return {"samplers": used, "channels": channels}

    def _sampler(self, sampler: dict[str, Any], width: int, n_values: int) -> dict[str, Any]:
        kind = sampler.get("interpolation", "LINEAR")
        if not isinstance(kind, str) or kind not in _INTERPOLATIONS:
            self.document.fail(f"a sampler has the unknown interpolation {quoted(kind)}")
        times = self._array(sampler.get("input"), 1)
        values = self._array(sampler.get("output"), width)
        n_times, n_found = len(self.arrays[times]), len(self.arrays[values])
        wanted = _INTERPOLATIONS[kind] * n_times * n_values
        if kind == "CUBICSPLINE" and n_times == 1:
            self.document.fail("a spline has a single time")
        if not n_times or n_found != wanted:
            self.document.fail(f"a sampler has {n_found} values, but {n_times} times need {wanted}")
        return {"input": times, "output": values, "interpolation": kind}

    def _array(self, index: Any, width: int) -> int:
        """Read an accessor as float32, and return its number."""
        if type(index) is not int or index not in self.arrays:
            values = self.document.accessor(index)
            self.n_bytes += 4 * values.size
            if self.n_bytes > max(_LEAST_BYTES, _BYTES_PER_BYTE * self.document.n_bytes):
                self.document.fail("accessors read the same bytes too often")
            with np.errstate(over="ignore"):
                self.arrays[index] = values.astype(np.float32)
        if self.arrays[index].shape[1] != width or not np.isfinite(self.arrays[index]).all():
            self.document.fail(f"accessors[{index}] does not have {width} finite numbers per row")
        return int(index)


def _mapping(owner: dict[str, Any], key: str) -> dict[str, Any]:
    """An object that an object holds; empty where there is none or anything else."""
    value = owner.get(key)
    return value if isinstance(value, dict) else {}


def _weights(owner: dict[str, Any], n_morphs: int) -> list[float] | None:
    """Weights of morph targets; None where they are not that many finite numbers."""
    values = owner.get("weights")
    if not n_morphs or not isinstance(values, list) or len(values) != n_morphs:
        return None
    is_sound = all(type(value) in (int, float) and abs(value) < 1e38 for value in values)
    return values if is_sound else None


def sound_json(value: Any) -> Any:
    """Return a value of JSON; None for one that holds numbers that JSON does not have."""
    try:
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError):
        return None
    return value


def _named(item: dict[str, Any]) -> dict[str, Any]:
    """Name and extras of an object."""
    content: dict[str, Any] = {}
    if isinstance(item.get("name"), str):
        content["name"] = as_text(item["name"])
    if (extras := sound_json(item.get("extras"))) is not None:
        content["extras"] = extras
    return content
