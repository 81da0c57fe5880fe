"""What `texbake bake --maps lightmap` does: read a scene, bake, write a file for each object."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.options import BakeOptions
from texbake.files import check_folder, make_folder
from texbake.jobs.outputs import check_distinct
from texbake.progress import Stages

from .terminal import Terminal

if TYPE_CHECKING:
    from texbake.jobs.light_maps import LightMaps
    from texbake.rendering.scene.scene import Scene

SCENE_SUFFIXES = (".toml", ".glb", ".gltf")


def bake_light_to_files(
    scene: Path, folder: Path, suffix: str, terminal: Terminal, **choices: Any
) -> None:
    """Bake the light maps of a scene file.

    Parameters
    ----------
    folder
        Of the files, which are named as the objects; made if it is missing.
    suffix
        Kind of file.
    choices
        `size`, `samples`, `bits`, `padding`, `fill` and `threads` of `BakeOptions`.
    """
    options = BakeOptions(**choices)
    from texbake.texture.image_formats import check_image_format

    check_image_format(folder / f"map.{suffix}", options.bits, color=True, channels=3)
    check_folder(folder)
    from texbake.jobs.light_maps import bake_light_maps
    from texbake.rendering.scene.read import read_scene

    with terminal.progress() as progress:
        stages = Stages(progress)
        with stages.part("read scene"):
            read = read_scene(scene, progress=progress)
        baked = bake_light_maps(read, options, progress=progress)
        with stages.stage("write maps"):
            make_folder(folder)
            names = file_names([item.name for item in baked.maps])
            paths = [folder / f"{name}.{suffix}" for name in names]
            check_distinct(paths, [path for path in read.files if path not in _light_maps(read)])
            for item, path in zip(baked.maps, paths, strict=True):
                item.write(path, bits=options.bits, threads=options.threads)
    for warning in baked.warnings:
        terminal.warn(warning)
    terminal.summary(_table(baked))
    terminal.wrote(paths)


def _light_maps(scene: Scene) -> set[Path]:
    """Files that the scene's light maps are read from, which may be baked again."""
    slots = [item.material.light_map for item in scene.objects]
    images = [getattr(slot, "image", None) for slot in slots]
    return {Path(image) for image in images if isinstance(image, str | os.PathLike)}


def file_names(names: list[str]) -> list[str]:
    """Names of files, each once, for names of objects, which may be any and several times.

    >>> file_names(["lamp", "lamp", "a/b"])
    ['lamp', 'lamp_2', 'a_b']
    """
    taken: set[str] = set()
    found = []
    for name in names:
        plain = re.sub(r"[^\w.-]+", "_", name).strip(".") or "object"
        candidate, count = plain, 1
        while candidate.lower() in taken:
            count += 1
            candidate = f"{plain}_{count}"
        taken.add(candidate.lower())
        found.append(candidate)
    return found


def _table(baked: LightMaps) -> list[tuple[str, str]]:
    rows = []
    for item in baked.maps:
        covered = item.values[item.has_data]
        brightest = float(covered.max()) if len(covered) else 0.0
        rows.append((item.name, f"{len(covered):,} texels, brightest {brightest:.3g}"))
    return rows
