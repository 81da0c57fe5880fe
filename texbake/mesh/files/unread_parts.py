"""What a model file has beside its surface: animations, skins, morph targets, cameras, lights."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from texbake.errors import counted, warn_of
from texbake.files import PathLike

if TYPE_CHECKING:
    from texbake.mesh.files.fbx_scene import FbxObject, FbxScene, ModelInstance
    from texbake.mesh.files.gltf_document import Document

_NURBS = "NURBS surface"
# Objects of FBX by the name of their node and their class.
_OF_FBX = {
    ("AnimationStack", ""): "animation",
    ("Deformer", "Skin"): "skin",
    ("Deformer", "BlendShapeChannel"): "morph target",
    ("Geometry", "NurbsSurface"): _NURBS,
    ("Model", "Camera"): "camera",
    ("Model", "Light"): "light",
}
_OF_GLTF = {"animations": "animation", "skins": "skin", "cameras": "camera"}
LIGHTS = "KHR_lights_punctual"
_POSES = ("skin", "morph target")


def unread_parts(source: PathLike | Document | FbxScene) -> tuple[str, ...]:
    """Count what a glTF or FBX file has beside its surface, without what its reader warns of."""
    if not isinstance(source, str | os.PathLike):
        return _named(_counts(source))
    suffix = Path(source).suffix.lower()
    if suffix in (".gltf", ".glb"):
        from texbake.mesh.files.gltf_document import read_document

        return _named(_counts(read_document(source)))
    if suffix != ".fbx":
        return ()
    from texbake.mesh.files.fbx_scene import read_scene

    return _named({noun: n for noun, n in _counts(read_scene(source)).items() if noun != _NURBS})


def warn_of_pose(document: Document) -> None:
    """Warn of skins and morph targets, which would change the surface."""
    counts = _counts(document)
    parts = _named({noun: counts[noun] for noun in _POSES})
    if parts:
        line = f"left out {' and '.join(parts)}; the mesh is read in the pose it is stored in"
        warn_of(document.path, line)


def warn_of_fbx(scene: FbxScene, models: Iterable[ModelInstance]) -> None:
    """Warn of unread parts of a scene that would change the surface of its visible `models`."""
    from texbake.mesh.files.fbx_scene import has_polygons, model_geometry

    if (n := _counts(scene)[_NURBS]) > 0:
        warn_of(scene.path, f"left out {counted(n, _NURBS)}; only polygons are read")
    meshes = set(filter(has_polygons, scene.objects.values()))
    warn_of_cages(scene.path, sum(map(_is_subdivided, meshes)))
    shown = {item for placed in models for item in model_geometry(scene, placed.model)}
    if hidden := len(meshes - shown):
        warn_of(scene.path, f"left out {counted(hidden, 'hidden mesh', 'hidden meshes')}")


def warn_of_cages(path: PathLike, n: int) -> None:
    """Warn of subdivision surfaces that are not subdivided."""
    if n:
        surfaces = counted(
            n,
            "subdivision surface is read as its control mesh",
            "subdivision surfaces are read as their control meshes",
        )
        warn_of(path, f"{surfaces}; subdivide with: texbake convert --subdivide 2")


def _is_subdivided(item: FbxObject) -> bool:
    """Whether programs show a subdivision surface instead of the polygons."""
    levels = item.node.numbers("PreviewDivisionLevels"), item.node.numbers("RenderDivisionLevels")
    return bool(item.node.numbers("Smoothness").any()) and any(level.any() for level in levels)


def _counts(source: Document | FbxScene) -> Mapping[str, int]:
    from texbake.mesh.files.gltf_document import Document

    return _counts_of_gltf(source) if isinstance(source, Document) else _counts_of_fbx(source)


def _counts_of_gltf(document: Document) -> dict[str, int]:
    content = document.content
    extensions = content.get("extensions")
    lights = extensions.get(LIGHTS) if isinstance(extensions, dict) else None
    counts = {noun: _count(content.get(kind)) for kind, noun in _OF_GLTF.items()}
    counts["light"] = _count(lights.get("lights")) if isinstance(lights, dict) else 0
    counts["morph target"] = 0
    for mesh in document.items("meshes"):  # the primitives of a mesh share them
        targets = [_count(each.get("targets")) for each in document.objects(mesh, "primitives")]
        counts["morph target"] += max(targets, default=0)
    return counts


def _count(items: object) -> int:
    return len(items) if isinstance(items, list) else 0


def _counts_of_fbx(scene: FbxScene) -> Counter[str]:
    from texbake.mesh.files.fbx_scene import has_polygons

    counts: Counter[str] = Counter()
    for item in scene.objects.values():
        name = item.node.name
        found = _OF_FBX.get((name, item.kind if name != "AnimationStack" else ""))
        if found is not None:
            counts[found] += 1
        if has_polygons(item):  # before version 7, a mesh holds its morph targets itself
            counts["morph target"] += len(item.node.named("Shape"))
    if all(item.node.name != "AnimationCurve" for item in scene.objects.values()):
        counts["animation"] = 0  # Maya writes an empty one into every file
    return counts


def _named(counts: Mapping[str, int]) -> tuple[str, ...]:
    return tuple(counted(n, noun) for noun, n in counts.items() if n)
