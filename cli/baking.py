"""What the three bake commands do: check the outputs, bake, write, tell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.options import BakeOptions
from texbake.files import check_folder, check_writable, make_folder
from texbake.jobs.outputs import check_distinct, check_picture, check_report
from texbake.progress import Stages

from .html import command_line
from .terminal import Terminal

if TYPE_CHECKING:
    from texbake import Mesh, WrittenMap
    from texbake.mesh.materials import Materials

# Maps that are made from the materials of the dense mesh.
OF_MATERIALS = {"texture", "material-id"}


def bake_to_files(
    high: Path,
    low: Path,
    files: dict[str, Path],
    terminal: Terminal,
    *,
    folder: Path | None = None,
    cage: Path | None,
    miss_map: Path | None,
    report: Path | None,
    html: Path | None,
    hits: Path | None = None,
    high_texture: Path | None = None,
    skew_mask: Path | None = None,
    offset_map: Path | None = None,
    **choices: Any,
) -> None:
    """Bake maps of two mesh files.

    Parameters
    ----------
    files
        Map name to the file that it is written to.
    folder
        Of the files, where it is to be made if it is missing.
    cage, miss_map, report, html, hits
        Files, where they are asked for.
    high_texture
        Image of the dense mesh; None for what its file names.
    skew_mask, offset_map
        Images that change the rays.
    choices
        Fields of `BakeOptions`, all but `maps` and `keep_hits`.
    """
    options = BakeOptions(maps=tuple(files), keep_hits=hits is not None, **choices)
    outputs = [*files.values(), miss_map, report, html, hits]
    check_distinct(outputs, [high, low, cage, high_texture, skew_mask, offset_map])
    _check_outputs(files, folder, miss_map, (report, html, hits), options)
    import texbake
    from texbake.baking.hits_file import write_hits
    from texbake.jobs.outputs import write_report
    from texbake.pages.page_maps import as_asked, page_options

    with terminal.progress() as progress:
        stages = Stages(progress)
        with stages.part("read meshes"):
            high_mesh, low_mesh = (
                texbake.read_mesh(path, progress=progress) for path in (high, low)
            )
            cage_mesh = None if cage is None else texbake.read_mesh(cage, progress=progress)
            asks = hits is not None or OF_MATERIALS & files.keys()
            materials = materials_of(high, high_mesh, high_texture) if asks else None
        baked = texbake.bake(
            high_mesh,
            low_mesh,
            options if html is None else page_options(options),
            cage=cage_mesh,
            materials=materials,
            **ray_images(skew_mask, offset_map),
            progress=progress,
        )
        result = as_asked(baked, options)
        with stages.stage("write maps"):
            if folder is not None:
                make_folder(folder)
            written = {name: result.maps[name].write(path) for name, path in files.items()}
            if miss_map is not None:
                texbake.write_image(result.miss_map(), miss_map)
            if hits is not None:
                write_hits(result, hits)
        reading, writing = stages.records
        figures = replace(result.report, stages=[reading, *result.report.stages, writing])
        if report is not None:
            coded = {name: asdict(file) for name, file in written.items()}
            write_report(report, {**figures.to_json(), "files": coded})
        warnings = [*figures.warnings, *clipped(written)]
        if html is not None:
            from texbake.pages.bake_page import write_bake_page

            write_bake_page(
                html,
                high_mesh,
                low_mesh,
                baked,
                asked=options.maps,
                stages=figures.stages,
                warnings=warnings,
                command=command_line(),
                progress=progress,
            )
    for warning in warnings:
        terminal.warn(warning)
    terminal.summary(figures.table())
    terminal.wrote(path for path in outputs if path is not None)


def materials_of(path: Path, mesh: Mesh, image: Path | None) -> Materials | None:
    """Materials of the dense mesh: of its file, with an image in place of their colors if given."""
    from texbake.mesh.materials import Materials, read_materials

    return read_materials(path, mesh) if image is None else Materials.of_image(mesh, image)


def ray_images(skew_mask: Path | None, offset_map: Path | None) -> dict[str, Any]:
    """Images that change rays, by the names that `bake` has for them."""
    return {"skew_mask": ray_image(skew_mask), "offset_map": ray_image(offset_map)}


def ray_image(path: Path | None) -> Any:
    """Read an image that changes rays, as data and not as a color; None without a file."""
    if path is None:
        return None
    from texbake.texture.image import read_image

    return read_image(path, color=False).pixels


def clipped(written: Mapping[str, WrittenMap]) -> list[str]:
    """Warnings of files that do not hold all their values."""
    return [
        f"{file.path}: {file.n_clipped:,} values lie outside what --mid and --scale hold and are "
        "clipped; give a greater --scale, or none"
        for file in written.values()
        if file.n_clipped
    ]


def _check_outputs(
    files: dict[str, Path],
    folder: Path | None,
    miss_map: Path | None,
    others: Iterable[Path | None],
    options: BakeOptions,
) -> None:
    check_map_files(files, options)
    if folder is not None:
        check_folder(folder)
    else:
        for path in files.values():
            check_writable(path)
    check_picture(miss_map)
    for other in others:
        check_report(other)


def check_map_files(files: Mapping[str, Path], options: BakeOptions) -> None:
    """Raise if maps could not be written as files of these names."""
    from texbake.baking.codings import file_bits
    from texbake.baking.maps import MAPS

    for name, path in files.items():
        file_bits(MAPS[name], path, options.bits)
