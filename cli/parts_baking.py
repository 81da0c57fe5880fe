"""What `texbake bake` does with assets of many parts: read, match, bake, write, tell."""

from __future__ import annotations

from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from texbake.baking.file_names import DEFAULT_PATTERN, map_file_names
from texbake.baking.options import BakeOptions
from texbake.errors import OptionError
from texbake.files import check_folder, make_folder
from texbake.jobs.outputs import check_distinct, check_picture, check_report
from texbake.progress import Stages

from .baking import OF_MATERIALS, check_map_files, clipped, materials_of, ray_image
from .map_options import FORMATS
from .parts_options import Asked
from .terminal import Terminal

if TYPE_CHECKING:
    from collections.abc import Callable

    from texbake import Mesh
    from texbake.baking.parts.light import Canvas
    from texbake.baking.parts.matching import Matching
    from texbake.baking.parts.result import PartsResult
    from texbake.baking.parts.work import RayMapsOf
    from texbake.mesh.materials import Materials

# Of the files that a bake of one mesh can write as well.
_OF_ONE_MESH = ("html", "hits")
_SET_PATTERN = "{set}_{map}.{ext}"


def bake_parts_to_files(
    asked: Asked,
    folder: Path,
    maps: tuple[str, ...],
    terminal: Terminal,
    *,
    suffix: str | None,
    name_pattern: str,
    cage: Path | None,
    miss_map: Path | None,
    report: Path | None,
    high_texture: Path | None = None,
    skew_mask: Path | None = None,
    offset_map: Path | None = None,
    **choices: Any,
) -> None:
    """Bake an asset of many parts, or print who would be baked from whom.

    Parameters
    ----------
    folder
        Of the maps; made if it is missing.
    choices
        Fields of `BakeOptions`, all but `maps` and `keep_hits`, and files that only a bake of one
        mesh can write.
    """
    for name in _OF_ONE_MESH:
        if choices.pop(name) is not None:
            raise OptionError(f"{name}: is for the bake of one mesh onto one set of maps")
    options = BakeOptions(maps=maps, **choices)
    name_files = _namer(asked, folder, maps, suffix, name_pattern)
    inputs = [*asked.high, *asked.low, cage, high_texture]
    check_distinct([miss_map, report], inputs)
    check_map_files({name: Path(f"{name}.{suffix or FORMATS[0]}") for name in maps}, options)
    check_folder(folder)
    check_picture(miss_map)
    check_report(report)
    import texbake
    from texbake.baking.parts.bake_parts import bake_parts

    # Where open files cannot be removed, the system clears its own folder for them.
    done_maps = TemporaryDirectory(prefix="texbake-", ignore_cleanup_errors=True)
    with terminal.progress() as progress, done_maps as waiting:
        stages = Stages(progress)
        with stages.part("read meshes"):
            high = [texbake.read_mesh(path, progress=progress) for path in asked.high]
            low = [texbake.read_mesh(path, progress=progress) for path in asked.low]
            cage_mesh = None if cage is None else texbake.read_mesh(cage, progress=progress)
        if asked.dry_run:
            _tell_matching(asked, high, low, report, terminal)
            return
        result = bake_parts(
            high,
            low,
            options,
            asked.options,
            cage=cage_mesh,
            high_materials=_high_materials(asked, high, maps, high_texture),
            low_materials=_low_materials(asked, low),
            ray_maps=_ray_maps(skew_mask, offset_map, asked.name),
            folder=Path(waiting),
            progress=progress,
        )
        files = {canvas: name_files(canvas) for canvas in result.canvases}
        outputs = [path for of_canvas in files.values() for path in of_canvas.values()]
        misses = {} if miss_map is None else _miss_maps(miss_map, result)
        _check_names(outputs, name_pattern)
        check_distinct([*outputs, *misses.values(), report], inputs)
        with stages.stage("write maps"):
            make_folder(folder)
            written = result.write(files)
            for canvas, path in misses.items():
                texbake.write_image(result.canvases[canvas].miss_map(), path)
    if report is not None:
        from texbake.jobs.outputs import write_report

        coded = [asdict(file) for file in written]
        write_report(report, {**result.report.to_json(), "bake": asdict(options), "files": coded})
    for warning in [*result.report.warnings, *clipped({str(f.path): f for f in written})]:
        terminal.warn(warning)
    terminal.summary(result.report.table())
    terminal.wrote(path for path in (*outputs, *misses.values(), report) if path is not None)


def _namer(
    asked: Asked, folder: Path, maps: tuple[str, ...], suffix: str | None, pattern: str
) -> Callable[[Canvas], dict[str, Path]]:
    """What gives the files of a set of maps; the pattern must tell sets apart."""
    if asked.options.texture_sets != "none":
        if pattern == DEFAULT_PATTERN:
            pattern = _SET_PATTERN
        elif "{set}" not in pattern:
            raise OptionError(
                f"name-pattern: {pattern!r} gives all texture sets one name; put {{set}} in it"
            )

    def files(canvas: Canvas) -> dict[str, Path]:
        names = map_file_names(
            pattern,
            asset=asked.name,
            maps=maps,
            ext=suffix or FORMATS[0],
            udim=canvas.udim,
            texture_set=canvas.texture_set or None,
        )
        return {name: folder / file for name, file in names.items()}

    from texbake.baking.parts.light import Canvas

    files(Canvas("", 1001))  # what is wrong with a pattern is told before the work
    return files


def _check_names(paths: list[Path], pattern: str) -> None:
    """Raise where two sets of maps would have one file, also where case makes no difference."""
    lower = [str(path).lower() for path in paths]
    for i, name in enumerate(lower):
        if name in lower[:i]:
            raise OptionError(
                f"{paths[i]}: two sets of maps have this name by {pattern!r}; rename one of them"
            )


def _tell_matching(
    asked: Asked, high: list[Mesh], low: list[Mesh], report: Path | None, terminal: Terminal
) -> None:
    """Print who would be baked from whom; a report has it as JSON."""
    from texbake.baking.parts.bake_parts import match_parts
    from texbake.baking.parts.matching import Match, Matching
    from texbake.jobs.outputs import write_report

    matching: Matching
    if asked.options.match_by_name:
        matching = match_parts(high, low, asked.options)[0]
    else:
        everything = tuple(range(len(high)))
        matching = Matching(
            tuple(mesh.name for mesh in high),
            tuple(mesh.name for mesh in low),
            tuple(Match(mesh.name, i, everything) for i, mesh in enumerate(low)),
        )
    if report is not None:
        write_report(report, {"matching": matching.to_json(), "warnings": matching.warnings})
    for warning in matching.warnings:
        terminal.warn(warning)
    terminal.summary(matching.table())
    terminal.wrote([] if report is None else [report])


def _high_materials(
    asked: Asked, meshes: list[Mesh], maps: tuple[str, ...], image: Path | None
) -> list[Materials | None] | None:
    if not OF_MATERIALS & {*maps}:
        return None
    return [materials_of(path, mesh, image) for path, mesh in zip(asked.high, meshes, strict=True)]


def _low_materials(asked: Asked, meshes: list[Mesh]) -> list[Materials | None] | None:
    if asked.options.texture_sets != "materials":
        return None
    return [materials_of(path, mesh, None) for path, mesh in zip(asked.low, meshes, strict=True)]


def _ray_maps(skew_mask: Path | None, offset_map: Path | None, asset: str) -> RayMapsOf:
    """What gives the images of a set of maps; `{set}` and `{udim}` in their names are filled in."""
    from texbake.baking.ray_maps import RayMaps

    read = lru_cache(maxsize=2)(ray_image)

    def named(path: Path | None, canvas: Canvas) -> Path | None:
        if path is None:
            return None
        name = str(path).replace("{udim}", str(canvas.udim))
        return Path(name.replace("{set}", canvas.texture_set or asset))

    def images(canvas: Canvas) -> RayMaps | None:
        return RayMaps.of(read(named(skew_mask, canvas)), read(named(offset_map, canvas)))

    return images


def _miss_maps(path: Path, result: PartsResult) -> dict[Canvas, Path]:
    """Files of the miss maps: the path, with set and tile put before its suffix if several."""
    if len(result.canvases) == 1:
        return dict.fromkeys(result.canvases, path)
    found = {}
    for canvas in result.canvases:
        pattern = "{map}_{set}_{udim}.{ext}" if canvas.texture_set else "{map}_{udim}.{ext}"
        (name,) = map_file_names(
            pattern,
            asset="",
            maps=[path.stem],
            ext=path.suffix[1:],
            udim=canvas.udim,
            texture_set=canvas.texture_set,
        ).values()
        found[canvas] = path.with_name(name)
    return found
