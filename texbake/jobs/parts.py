"""Maps of an asset of several meshes: which parts are baked from which, and one file per map.

Low-poly meshes that share an atlas share maps. With texture sets or UDIM tiles there is a set of
maps for each of them, and the pattern of the file names has to hold `{set}` or `{udim}`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

from texbake.baking.maps import DEFAULT_PATTERN, FIRST_TILE, map_file_names
from texbake.baking.options import BakeOptions
from texbake.baking.parts.bake_parts import RayMapsOf, bake_parts
from texbake.baking.parts.high_parts import match_objects, match_parts
from texbake.baking.parts.low_parts import BakeTarget, Tiles
from texbake.baking.parts.matching import Match, Matching, PartsOptions
from texbake.baking.parts.result import PartsReport, PartsResult
from texbake.baking.rays import RayMaps
from texbake.baking.result import WrittenMap
from texbake.errors import OptionError, quoted
from texbake.files import PathLike, appearing_together, make_folder, scratch_folder
from texbake.jobs.fit import check_fit, diagnose_misses
from texbake.jobs.maps import (
    BakeFiles,
    check_high_texture,
    check_map_files,
    clipping_warnings,
    materials_of,
    named_maps,
    needs_materials,
    read_ray_image,
)
from texbake.jobs.outputs import JobResult, check_distinct
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import read_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.objects import joined_objects
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.texture.image import write_image

_SET_PATTERN = "{set}_{map}.{ext}"

NameFiles = Callable[[BakeTarget], dict[str, Path]]


@dataclass(frozen=True, kw_only=True, eq=False)
class PartsFiles(JobResult[PartsReport]):
    """The files that `bake_parts_files` wrote."""

    maps: tuple[WrittenMap, ...]  # the files of all sets of maps, and how values are coded in them
    options: BakeOptions

    def to_json(self) -> dict[str, Any]:
        """Return the report, the options and the coding of each file as plain values."""
        coded = [asdict(written) for written in self.maps]
        return {**self.report.to_json(), "bake": asdict(self.options), "files": coded}


@dataclass(frozen=True, kw_only=True, eq=False)
class MatchedParts(JobResult[Matching]):
    """Which parts would be baked from which."""

    def to_json(self) -> dict[str, Any]:
        """Return the matching and its warnings as plain values."""
        return {"matching": self.report.to_json(), "warnings": list(self.warnings)}


def needs_parts(
    high: Sequence[PathLike], low: Sequence[PathLike], parts: PartsOptions, *, pair: bool = True
) -> bool:
    """Whether meshes need `bake_parts_files`: several per side, matched names, or several sets."""
    several = len(high) != 1 or len(low) != 1 or parts.texture_sets != "none"
    if several or parts.match_by_name or parts.occluders != PartsOptions.occluders:
        return True
    if not parts.udim and not pair:
        return False
    mesh = read_mesh(low[0])
    tiles = [FIRST_TILE]
    if parts.udim and mesh.uvs is not None:
        tiles = Tiles.of(mesh.corner_uvs()).numbers
    if tiles != [FIRST_TILE]:
        return True
    has_objects = pair and len(mesh.group_objects) > 1
    return has_objects and match_objects([read_mesh(high[0])], [mesh], parts) is not None


@appearing_together()
def bake_parts_files(
    high: Sequence[PathLike],
    low: Sequence[PathLike],
    folder: PathLike,
    options: BakeOptions | None = None,
    parts: PartsOptions | None = None,
    files: BakeFiles | None = None,
    *,
    name: str | None = None,
    format: str | None = None,  # noqa: A002
    name_pattern: str = DEFAULT_PATTERN,
    progress: Progress = None,
) -> PartsFiles:
    """Bake the maps of an asset of several mesh files, and write them."""
    options, parts, files = options or BakeOptions(), parts or PartsOptions(), files or BakeFiles()
    asset = name or Path(low[0]).stem
    name_pattern = _pattern_of_sets(name_pattern, parts)
    name_files = _namer(asset, Path(folder), options.maps, format, name_pattern)
    check_high_texture(files.high_texture, options.maps)
    check_map_files(name_files(BakeTarget("", FIRST_TILE)), options)
    stages = Stages(progress)
    with scratch_folder() as done_maps:
        with stages.part("read meshes"):
            highs, lows = _read(high, progress), _read(low, progress)
            cage_mesh = None if files.cage is None else read_mesh(files.cage, progress=progress)
            check_fit(_whole(highs), _whole(lows), threads=options.threads)
        result = bake_parts(
            highs,
            lows,
            options,
            parts,
            cage=cage_mesh,
            high_materials=_high_materials(high, highs, options, files.high_texture),
            low_materials=_low_materials(low, lows, parts),
            ray_maps=_ray_maps(files.skew_mask, files.offset_map, asset),
            folder=done_maps,
            progress=progress,
        )
        why = _why_missed(highs, lows, result.report)
        maps = {target: name_files(target) for target in result.targets}
        outputs = [path for of_target in maps.values() for path in of_target.values()]
        misses = {} if files.miss_map is None else _miss_maps(Path(files.miss_map), result)
        _check_names(outputs, name_pattern)
        check_distinct([*outputs, *misses.values()], [*high, *low, *files.inputs])
        with stages.stage("write maps"):
            make_folder(folder)
            written = result.write(maps)
            for target, path in misses.items():
                write_image(result.targets[target].miss_map(), path)
    return PartsFiles(
        files=(*outputs, *misses.values()),
        report=result.report,
        warnings=(*result.report.warnings, *why, *clipping_warnings(written)),
        maps=tuple(written),
        options=options,
    )


def match_parts_files(
    high: Sequence[PathLike],
    low: Sequence[PathLike],
    parts: PartsOptions | None = None,
    *,
    progress: Progress = None,
) -> MatchedParts:
    """Find out which parts `bake_parts_files` would bake from which, without baking."""
    parts = parts or PartsOptions()
    highs, lows = _read(high, progress), _read(low, progress)
    if parts.match_by_name:
        matching: Matching = match_parts(highs, lows, parts)[0]
    elif paired := match_objects(highs, lows, parts):
        matching = paired[0]
    else:
        everything = tuple(range(len(highs)))
        matching = Matching(
            tuple(mesh.name for mesh in highs),
            tuple(mesh.name for mesh in lows),
            tuple(Match(mesh.name, i, everything) for i, mesh in enumerate(lows)),
        )
    return MatchedParts(files=(), report=matching, warnings=tuple(matching.warnings))


def _read(paths: Iterable[PathLike], progress: Progress) -> list[Mesh]:
    return [read_mesh(path, progress=progress) for path in paths]


def _whole(meshes: Sequence[Mesh]) -> Mesh:
    """Return the shape of all meshes as one."""
    name = meshes[0].name if len(meshes) == 1 else f"{meshes[0].name} and {len(meshes) - 1} more"
    shapes = [Mesh(positions=mesh.positions, faces=mesh.faces) for mesh in meshes]
    return join_meshes(shapes).replace(name=name)


def _pattern_of_sets(pattern: str, parts: PartsOptions) -> str:
    """Return a pattern that gives each texture set names of its own."""
    if parts.texture_sets == "none":
        return pattern
    if pattern == DEFAULT_PATTERN:
        return _SET_PATTERN
    if "{set}" not in pattern:
        raise OptionError(
            f"name_pattern: {quoted(pattern)} gives all texture sets one name; put {{set}} in it"
        )
    return pattern


def _namer(
    asset: str, folder: Path, maps: Sequence[str], suffix: str | None, pattern: str
) -> NameFiles:
    """Return a function that names the files of a set of maps."""

    def files(target: BakeTarget) -> dict[str, Path]:
        udim, texture_set = target.udim, target.texture_set or None
        return named_maps(folder, pattern, asset, maps, suffix, udim=udim, texture_set=texture_set)

    return files


def _check_names(paths: Sequence[Path], pattern: str) -> None:
    """Raise where two sets of maps would have one file, also where case makes no difference."""
    lower = [str(path).lower() for path in paths]
    for i, name in enumerate(lower):
        if name in lower[:i]:
            raise OptionError(
                f"{paths[i]}: two sets of maps have this name by {quoted(pattern)}; "
                "rename one of them"
            )


def _why_missed(
    highs: Sequence[Mesh], lows: Sequence[Mesh], report: PartsReport
) -> tuple[str, ...]:
    """Say why rays of the worst set of maps missed; raise if all meshes face opposite ways."""
    worst = max(report.targets.values(), key=lambda figures: figures.miss_percent)
    return diagnose_misses(_whole(highs), joined_objects(_whole(lows)), worst)


def _high_materials(
    files: Sequence[PathLike], meshes: Sequence[Mesh], options: BakeOptions, image: PathLike | None
) -> list[Materials | None] | None:
    if not needs_materials(options.maps, options):
        return None
    return [
        materials_of(path, mesh, image, options.maps)
        for path, mesh in zip(files, meshes, strict=True)
    ]


def _low_materials(
    files: Sequence[PathLike], meshes: Sequence[Mesh], parts: PartsOptions
) -> list[Materials | None] | None:
    if parts.texture_sets != "materials":
        return None
    return [materials_of(path, mesh, None) for path, mesh in zip(files, meshes, strict=True)]


def _ray_maps(skew_mask: PathLike | None, offset_map: PathLike | None, asset: str) -> RayMapsOf:
    """Return a function that reads the images of a set of maps, their names filled in."""
    read = lru_cache(maxsize=2)(read_ray_image)

    def named(path: PathLike | None, target: BakeTarget) -> Path | None:
        if path is None:
            return None
        name = str(path).replace("{udim}", str(target.udim))
        return Path(name.replace("{set}", target.texture_set or asset))

    def images(target: BakeTarget) -> RayMaps | None:
        return RayMaps.of(read(named(skew_mask, target)), read(named(offset_map, target)))

    return images


def _miss_maps(path: Path, result: PartsResult) -> Mapping[BakeTarget, Path]:
    """Files of the miss maps: the path; of several, set and tile stand before its suffix."""
    if len(result.targets) == 1:
        return dict.fromkeys(result.targets, path)
    files = {}
    for target in result.targets:
        pattern = "{map}_{set}_{udim}.{ext}" if target.texture_set else "{map}_{udim}.{ext}"
        (name,) = map_file_names(
            pattern,
            asset="",
            maps=[path.stem],
            ext=path.suffix[1:],
            udim=target.udim,
            texture_set=target.texture_set,
        ).values()
        files[target] = path.with_name(name)
    return files
