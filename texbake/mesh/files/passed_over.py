"""What a model file holds that a mesh has no place for: animations, skins, cameras, lights."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from texbake.files import PathLike
from texbake.mesh.files.fbx_scene import FbxScene, read_scene
from texbake.mesh.files.gltf_document import Document, read_document

# Objects of FBX by the name of their node and their class.
_OF_FBX = {
    ("AnimationStack", ""): "animation",
    ("Deformer", "Skin"): "skin",
    ("Deformer", "BlendShape"): "shape key",
    ("Model", "Camera"): "camera",
    ("Model", "Light"): "light",
}
_OF_GLTF = {"animations": "animation", "skins": "skin", "cameras": "camera"}
_LIGHTS = "KHR_lights_punctual"


def passed_over(path: PathLike) -> tuple[str, ...]:
    """Name what of a glTF or FBX file is not read, with its number, such as `2 animations`.

    Empty for other formats.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        It is damaged.
    """
    suffix = Path(path).suffix.lower()
    if suffix in (".gltf", ".glb"):
        return passed_over_in_gltf(read_document(path))
    return passed_over_in_fbx(read_scene(path)) if suffix == ".fbx" else ()


def passed_over_in_gltf(document: Document) -> tuple[str, ...]:
    """Name what of a glTF document is not read."""
    counts = {noun: len(document.items(kind)) for kind, noun in _OF_GLTF.items()}
    extensions = document.mapping(document.content, "extensions")
    lights = document.mapping(extensions, _LIGHTS)
    counts["light"] = len(document.objects(lights, "lights"))
    counts["shape key"] = sum(
        len(document.objects(primitive, "targets"))
        for mesh in document.items("meshes")
        for primitive in document.objects(mesh, "primitives")
        if "targets" in primitive
    )
    return _named(counts)


def passed_over_in_fbx(scene: FbxScene) -> tuple[str, ...]:
    """Name what of an FBX scene is not read."""
    counts: Counter[str] = Counter()
    for item in scene.objects.values():
        name = item.node.name
        found = _OF_FBX.get((name, item.kind if name != "AnimationStack" else ""))
        if found is not None:
            counts[found] += 1
    return _named(counts)


def _named(counts: Mapping[str, int]) -> tuple[str, ...]:
    return tuple(f"{n} {noun}{'s' if n > 1 else ''}" for noun, n in counts.items() if n)
