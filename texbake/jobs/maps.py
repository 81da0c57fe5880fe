"""Maps of one low-poly mesh: baked from a high-poly mesh, or made from hits of an earlier bake."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.codings import file_bits
from texbake.baking.hits_file import write_hits
from texbake.baking.maps import DEFAULT_PATTERN, MAPS, MATERIAL_MAPS, map_file_names
from texbake.baking.options import BakeOptions
from texbake.baking.parts.bake_parts import bake_objects
from texbake.baking.report import BakeReport
from texbake.baking.result import BakedMap, BakeResult, WrittenMap, redundant_maps
from texbake.errors import OptionError, counted
from texbake.files import PathLike, appearing_together, make_folder, scratch_folder
from texbake.jobs.fit import check_fit, with_diagnosis
from texbake.jobs.outputs import JobResult, check_distinct, present_paths
from texbake.mesh.files import read_mesh
from texbake.mesh.hard_edges import SHARP_ANGLE, with_sharp_edges
from texbake.mesh.materials import CHANNELS, Materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.objects import joined_objects
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.mesh.streamed.source import open_source
from texbake.progress import Progress, StageRecord, Stages
from texbake.records import dataclass
from texbake.sampling.rounds import BudgetClock, with_actual_time
from texbake.texture.image import read_image, write_image
from texbake.texture.model_materials import read_materials

DEFAULT_FORMAT = "png"
_MOST_CAD_FACES = 1_000_000  # larger meshes are scans: the search takes long and finds none


@dataclass(frozen=True, kw_only=True, eq=False)
class MapFiles(JobResult[BakeReport]):
    """The files that `bake_files` or `remap_files` wrote."""

    maps: Mapping[str, WrittenMap]  # each map's file, and how its values are coded in it

    def to_json(self) -> dict[str, Any]:
        """Return the report and the coding of each file as plain values."""
        return {
            **self.report.to_json(),
            "files": {name: asdict(written) for name, written in self.maps.items()},
        }


@dataclass(frozen=True, kw_only=True)
class BakeFiles:
    """What a bake reads and writes besides its meshes and maps."""

    cage: PathLike | None = None
    high_texture: PathLike | None = None
    skew_mask: PathLike | None = None
    offset_map: PathLike | None = None
    miss_map: PathLike | None = None
    hits: PathLike | None = None
    html: PathLike | None = None
    command: str = ""  # which the page shows

    @property
    def inputs(self) -> tuple[PathLike | None, ...]:
        """What is read."""
        return self.cage, self.high_texture, self.skew_mask, self.offset_map

    @property
    def outputs(self) -> tuple[Path, ...]:
        """What is written."""
        return present_paths(self.miss_map, self.html, self.hits)


@appearing_together()
def bake_files(
    high: PathLike,
    low: PathLike,
    output: PathLike | Mapping[str, PathLike],
    options: BakeOptions | None = None,
    files: BakeFiles | None = None,
    *,
    format: str | None = None,  # noqa: A002
    name_pattern: str = DEFAULT_PATTERN,
    join_objects: bool = False,
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> MapFiles:
    """Bake maps of a high-poly mesh file for a low-poly mesh file, and write them."""
    clock, options, files = clock or BudgetClock(), options or BakeOptions(), files or BakeFiles()
    if files.html is not None:  # pages load the renderer
        from texbake.pages.asset_page import as_asked, page_options, write_bake_page
    folder = None if isinstance(output, Mapping) else Path(output)
    if isinstance(output, Mapping):
        maps = {name: Path(path) for name, path in output.items()}
        options = replace(options, maps=tuple(maps))
    else:
        maps = named_maps(Path(output), name_pattern, Path(low).stem, options.maps, format)
    if files.hits is not None:
        options = replace(options, keep_hits=True)
    else:  # other maps can be made from hits
        check_high_texture(files.high_texture, maps)
    check_distinct([*maps.values(), *files.outputs], [high, low, *files.inputs])
    check_map_files(maps, options)
    stages = Stages(progress)
    with stages.part("read meshes"):
        low_mesh = _read_whole(low, join_objects, progress)
        cage = None if files.cage is None else read_mesh(files.cage, progress=progress)
        n_low = low_mesh.n_faces * (1 if cage is None else 2)
        high_mesh = _read_high(high, n_low, options, progress, join_objects)
        if isinstance(high_mesh, Mesh):
            check_fit(high_mesh, low_mesh, threads=options.threads)
        materials = _materials(high, high_mesh, maps, options, files)
    baked = bake_objects(
        high_mesh,
        low_mesh,
        options if files.html is None else page_options(options),
        pair=files.html is None,
        cage=cage,
        materials=materials,
        skew_mask=read_ray_image(files.skew_mask),
        offset_map=read_ray_image(files.offset_map),
        progress=progress,
        clock=replace(clock, finish=partial(_write_for_time, maps)),
    )
    baked = with_diagnosis(high_mesh, low_mesh, baked, join_objects=join_objects)
    result = baked if files.html is None else as_asked(baked, options)
    with stages.stage("write maps"):
        written = written_maps(result, maps, folder)
        if files.miss_map is not None:
            write_image(result.miss_map(), files.miss_map)
        if files.hits is not None:
            write_hits(result, files.hits)
    figures = result.report
    if figures.budget is not None:
        figures = replace(figures, budget=with_actual_time(figures.budget, clock))
    size = float(np.ptp(low_mesh.bounds, axis=0).max())
    redundant = redundant_maps({name: result.maps[name] for name in maps}, size)
    notes = [*_rounded_edges(high_mesh, options), *redundant]
    done = map_files(figures, stages.records, written, files.outputs, notes)
    if files.html is not None and isinstance(high_mesh, Mesh):
        write_bake_page(
            files.html, high_mesh, low_mesh, baked, asked=options.maps, stages=done.report.stages,
            warnings=done.warnings, command=files.command, progress=progress,
        )  # fmt: skip
    return done


def _read_whole(path: PathLike, join_objects: bool, progress: Progress) -> Mesh:
    mesh = read_mesh(path, progress=progress)
    return joined_objects(mesh) if join_objects else mesh


def _read_high(
    path: PathLike, n_low_faces: int, options: BakeOptions, progress: Progress, join_objects: bool
) -> Mesh | StreamedMesh:
    """Read the high-poly mesh; one that is too large for `max_memory` stays in its file."""
    source = None if options.max_memory is None else open_source(path)
    if source is None or not options.must_stream(source.n_rows, n_low_faces):
        return _read_whole(path, join_objects, progress)
    with Stages(progress).stage(f"read {Path(path).name}"):
        return StreamedMesh.open(source, threads=options.threads)


def _rounded_edges(high: Mesh | StreamedMesh, options: BakeOptions) -> Iterator[str]:
    """Yield a warning if a high-poly mesh without normals seems to have hard edges."""
    if not (
        isinstance(high, Mesh)
        and high.normals is None
        and high.n_faces <= _MOST_CAD_FACES
        and "normal" in options.maps
        and options.high_shading == "smooth"
    ):
        return
    if with_sharp_edges(high, threads=options.threads) is not high:
        yield (
            f"{high.name}: the file has no normals, so the normal map shows sharp edges rounded; "
            "set `high_shading` to flat, or make hard normals with: texbake transform "
            f"{high.name} -o OUT.obj --normals angle --angle {SHARP_ANGLE:g}"
        )


def _materials(
    path: PathLike,
    high: Mesh | StreamedMesh,
    maps: Iterable[str],
    options: BakeOptions,
    files: BakeFiles,
) -> Materials | None:
    """Return the materials that maps are made from; raise if a mesh in chunks would need them."""
    if isinstance(high, StreamedMesh):
        for name in ("high_texture", "html"):
            if getattr(files, name) is not None:
                raise OptionError(
                    f"max_memory, {name}: {high.name} would be read in chunks, and `{name}` needs "
                    "all of it at once; leave one of the two out"
                )
        return None
    if files.hits is None and not needs_materials(maps, options):
        return None
    return materials_of(path, high, files.high_texture, maps)


def _write_for_time(files: Mapping[str, Path], maps: Mapping[str, BakedMap]) -> None:
    """Write maps to a scratch folder, only to time it."""
    with scratch_folder() as folder:
        for name, path in files.items():
            maps[name].write(folder / f"{name}{path.suffix}")


def named_maps(
    folder: Path, pattern: str, asset: str, maps: Sequence[str], suffix: str | None, **of_set: Any
) -> dict[str, Path]:
    """Return a file in a folder for each map; `of_set` is the `udim` and the `texture_set`."""
    names = map_file_names(pattern, asset=asset, maps=maps, ext=suffix or DEFAULT_FORMAT, **of_set)
    return {name: folder / file for name, file in names.items()}


def written_maps(
    result: BakeResult, files: Mapping[str, Path], folder: Path | None
) -> dict[str, WrittenMap]:
    """Write maps to their files, in a folder that is made."""
    if folder is not None:
        make_folder(folder)
    return {name: result.maps[name].write(path) for name, path in files.items()}


def map_files(
    report: BakeReport,
    around: Sequence[StageRecord],
    written: Mapping[str, WrittenMap],
    others: Sequence[Path] = (),
    notes: Iterable[str] = (),
) -> MapFiles:
    """Return the result of a job: the report with the stages before and after its own."""
    reading, writing = around
    figures = replace(report, stages=[reading, *report.stages, writing])
    return MapFiles(
        files=(*(file.path for file in written.values()), *others),
        maps=written,
        report=figures,
        warnings=(*figures.warnings, *clipping_warnings(written.values()), *notes),
    )


def clipping_warnings(written: Iterable[WrittenMap]) -> tuple[str, ...]:
    """Return a warning for each file that does not hold all of its values."""
    return tuple(
        f"{file.path}: {counted(file.n_clipped, 'value was', 'values were')} clipped to the range "
        "that `mid` and `scale` give; set a greater `scale`, or none"
        for file in written
        if file.n_clipped
    )


def read_ray_image(path: PathLike | None) -> Any:
    """Read an image that changes rays: data, not color; None without a file."""
    return None if path is None else read_image(path, color=False).pixels


def check_map_files(files: Mapping[str, Path], options: BakeOptions) -> None:
    """Raise if a map has no coding in the format of its file."""
    for name, path in files.items():
        file_bits(MAPS[name], path, options.bits)


def check_high_texture(image: PathLike | None, maps: Iterable[str]) -> None:
    """Raise if an image is given for the materials, and none of the maps is read from one."""
    if image is not None and not _channels(maps):
        raise OptionError(
            f"high_texture, maps: {Path(image).name} is for a map of the materials, such as "
            "base-color or roughness, and none is asked for; name it in `maps`"
        )


def _channels(maps: Iterable[str]) -> list[str]:
    return [name for name in maps if name in CHANNELS and name != "normal"]


def needs_materials(maps: Iterable[str], options: BakeOptions) -> bool:
    """Return whether maps are made from the materials of the high-poly mesh."""
    of_materials = {*MATERIAL_MAPS, *(("normal",) if options.high_normal_maps else ())}
    return not of_materials.isdisjoint(maps)


def materials_of(
    path: PathLike, mesh: Mesh, image: PathLike | None, maps: Iterable[str] = ()
) -> Materials | None:
    """Return the materials of a mesh file if it has any, or one with an image for one of `maps`."""
    if image is None:
        return read_materials(path, mesh)
    channels = _channels(maps)
    if len(channels) > 1:
        raise OptionError(
            f"high_texture, maps: {Path(image).name} is the image of one map, and "
            f"{', '.join(channels)} are asked for; bake them one after the other"
        )
    if channels and len(CHANNELS[channels[0]].default) == 1:
        from texbake.texture.material_images import check_gray

        check_gray(read_image(image, color=False), channels[0])
    return Materials.of_image(mesh, image, *channels)
