"""What a glTF file has beside triangles and materials, read as a `Rig` and carried through.

Nodes get the numbers of `scene_nodes`; those outside the scene are left out, with what names them.
A skin, an animation or a camera that is damaged is left out with a warning.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, counted, warn_of
from texbake.files import PathLike
from texbake.mesh.files.conversion import as_text
from texbake.mesh.files.gltf import SceneNodes, indices, scene_nodes
from texbake.mesh.files.gltf_document import Document, read_document
from texbake.mesh.files.source import without_cycle_search
from texbake.mesh.rig import Rig, RigObject

LIGHTS = "KHR_lights_punctual"
_VISIBILITY = "KHR_node_visibility"
_PLACES = {"translation": 3, "rotation": 4, "scale": 3}
_INTERPOLATIONS = {"LINEAR": 1, "STEP": 1, "CUBICSPLINE": 3}


def read_gltf_rig(path: PathLike) -> Rig:
    """Read the nodes of a glTF file and what refers to them."""
    document = read_document(path)
    with without_cycle_search():
        return _RigReader(document, scene_nodes(document)).read()


class _RigReader:
    def __init__(self, document: Document, placed: SceneNodes) -> None:
        self.document, self.placed = document, placed
        self.numbers = {index: place for place, index in enumerate(placed.indices)}
        self.arrays: dict[int, npt.NDArray[np.float32]] = {}
        self.damaged: dict[str, int] = {}

    def read(self) -> Rig:
        """Return the whole."""
        document, placed = self.document, self.placed
        skins, skin_numbers = self._all("skins", self._skin)
        cameras, camera_numbers = self._all("cameras", self._camera)
        lights = document.mapping(document.mapping(document.content, "extensions"), LIGHTS)
        light_items = [sound_json(light) or {} for light in document.objects(lights, "lights")]
        nodes = [
            self._node(node, skin_numbers, camera_numbers, len(light_items))
            for node in placed.nodes
        ]
        for place, parent in enumerate(placed.parents.tolist()):
            if parent >= 0:
                nodes[parent].setdefault("children", []).append(place)
        content: dict[str, Any] = {
            "nodes": nodes,
            "scenes": [{"nodes": np.flatnonzero(placed.parents < 0).tolist()}],
        }
        matrices = placed.mesh_matrices(placed.matrices())
        objects = {
            place: self._object(place, node["mesh"], matrices[place])
            for place, node in enumerate(placed.nodes)
            if "mesh" in node
        }
        self.n_morphs = {place: item.n_morphs for place, item in objects.items()}
        animations, _ = self._all("animations", self._animation)
        lists = {"skins": skins, "cameras": cameras, "animations": animations}
        content |= {kind: items for kind, items in lists.items() if items}
        if light_items:
            content["extensions"] = {LIGHTS: {"lights": light_items}}
        for noun, n in self.damaged.items():
            move = " that move nothing or are damaged" if noun == "animation" else ", damaged"
            warn_of(document.path, f"left out {counted(n, noun)}{move}")
        return Rig(
            content=content,
            arrays=self.arrays,
            objects=objects,
            has_morph_normals=any(map(self._has_morph_normals, document.items("meshes"))),
        )

    def _all(
        self, kind: str, read: Callable[[dict[str, Any]], dict[str, Any]]
    ) -> tuple[list[dict[str, Any]], dict[int, int]]:
        """Read all items of a kind that are sound, and the new numbers of those."""
        found: list[dict[str, Any]] = []
        numbers: dict[int, int] = {}
        for index, item in enumerate(self.document.items(kind)):
            try:
                made = read(item)
            except FileFormatError:
                self.damaged[kind[:-1]] = self.damaged.get(kind[:-1], 0) + 1
                continue
            numbers[index] = len(found)
            found.append({**_named(item), **made})
        return found, numbers

    def _node(
        self,
        node: dict[str, Any],
        skins: Mapping[int, int],
        cameras: Mapping[int, int],
        n_lights: int,
    ) -> dict[str, Any]:
        made = _named(node)
        for key in ("matrix", *_PLACES):
            if node.get(key) is not None:
                made[key] = node[key]
        if "matrix" in made:
            made = {key: value for key, value in made.items() if key not in _PLACES}
        for key, numbers in (("skin", skins), ("camera", cameras)):
            if type(node.get(key)) is int and node[key] in numbers:
                made[key] = numbers[node[key]]
        if "mesh" in node and "weights" in node:
            made["weights"] = sound_json(node["weights"])
        extensions = self.document.mapping(node, "extensions")
        kept = {}
        light = self.document.mapping(extensions, LIGHTS).get("light")
        if type(light) is int and 0 <= light < n_lights:
            kept[LIGHTS] = {"light": light}
        if (visibility := sound_json(extensions.get(_VISIBILITY))) is not None:
            kept[_VISIBILITY] = visibility
        if kept:
            made["extensions"] = kept
        return made

    def _object(self, place: int, index: int, matrix: npt.NDArray[np.float64]) -> RigObject:
        mesh = self.document.item("meshes", index)
        primitives = self.document.objects(mesh, "primitives")
        fields = _named(mesh)
        if isinstance(extras := fields.get("extras"), dict):
            names = {key: text for key, text in extras.items() if not key.startswith("TEXCOORD_")}
            fields["extras"] = names
        if "weights" in mesh:
            fields["weights"] = sound_json(mesh["weights"])
        return RigObject(
            node=place,
            matrix=matrix,
            fields={key: value for key, value in fields.items() if value not in (None, {})},
            n_morphs=max((len(self.document.objects(p, "targets")) for p in primitives), default=0),
        )

    def _has_morph_normals(self, mesh: dict[str, Any]) -> bool:
        primitives = self.document.objects(mesh, "primitives")
        targets = (t for each in primitives for t in self.document.objects(each, "targets"))
        return any("NORMAL" in target for target in targets)

    def _camera(self, camera: dict[str, Any]) -> dict[str, Any]:
        made = sound_json(camera)
        if made is None or made.get("type") not in ("perspective", "orthographic"):
            self.document.fail("a camera has no type")
        return dict(made)

    def _skin(self, skin: dict[str, Any]) -> dict[str, Any]:
        joints = indices(self.document, skin, "joints")
        if not joints or not set(joints) <= self.numbers.keys():
            self.document.fail("a skin names joints that are not in the scene")
        made: dict[str, Any] = {"joints": [self.numbers[joint] for joint in joints]}
        if type(skin.get("skeleton")) is int and skin["skeleton"] in self.numbers:
            made["skeleton"] = self.numbers[skin["skeleton"]]
        if "inverseBindMatrices" in skin:
            rows = self._array(skin["inverseBindMatrices"], 16)
            if len(self.arrays[rows]) < len(joints):
                self.document.fail("a skin has fewer matrices than joints")
            made["inverseBindMatrices"] = rows
        return made

    def _animation(self, animation: dict[str, Any]) -> dict[str, Any]:
        samplers = self.document.objects(animation, "samplers")
        made: list[dict[str, Any]] = []
        channels: list[dict[str, Any]] = []
        for channel in self.document.objects(animation, "channels"):
            target = self.document.mapping(channel, "target")
            node, path = target.get("node"), target.get("path")
            number = channel.get("sampler")
            if type(number) is not int or not 0 <= number < len(samplers):
                self.document.fail("an animation has no such sampler")
            if type(node) is not int or node not in self.numbers:
                continue
            width = _PLACES.get(str(path), 1)
            n_values = 1
            if path == "weights":
                n_values = self.n_morphs.get(self.numbers[node], 0)
            elif path not in _PLACES:
                continue
            if n_values:
                made.append(self._sampler(samplers[number], width, n_values))
                item = {"node": self.numbers[node], "path": path}
                channels.append({"sampler": len(made) - 1, "target": item})
        if not channels:
            self.document.fail("an animation moves nothing in the scene")
        return {"samplers": made, "channels": channels}

    def _sampler(self, sampler: dict[str, Any], width: int, n_values: int) -> dict[str, Any]:
        kind = sampler.get("interpolation", "LINEAR")
        times, values = (
            self._array(sampler.get("input"), 1),
            self._array(sampler.get("output"), width),
        )
        n_times = len(self.arrays[times])
        wanted = _INTERPOLATIONS.get(str(kind), 0) * n_times * n_values
        if not n_times or len(self.arrays[values]) != wanted:
            self.document.fail("an animation has another number of values than of times")
        return {"input": times, "output": values, "interpolation": kind}

    def _array(self, index: Any, width: int) -> int:
        """Read an accessor as float32, and return its number."""
        if type(index) is not int or index not in self.arrays:
            with np.errstate(over="ignore"):
                values = self.document.accessor(index).astype(np.float32)
            self.arrays[index] = values
        if self.arrays[index].shape[1] != width or not np.isfinite(self.arrays[index]).all():
            self.document.fail(f"accessors[{index}] has other values than are needed")
        return int(index)


def sound_json(value: Any) -> Any:
    """Return a value of JSON; None for one that holds numbers that JSON does not have."""
    try:
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError):
        return None
    return value


def _named(item: dict[str, Any]) -> dict[str, Any]:
    """Name and extras of an object."""
    made: dict[str, Any] = {}
    if isinstance(item.get("name"), str):
        made["name"] = as_text(item["name"])
    if (extras := sound_json(item.get("extras"))) is not None:
        made["extras"] = extras
    return made
