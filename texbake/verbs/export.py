"""`export`: write an asset folder for another program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.memory import MB, PROCESS
from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.jobs.export.programs import KINDS, ExportOptions
from texbake.verbs.step import READ_FACE, Job, Settings, Sizes, n_bytes, n_faces, step_of
from texbake.verbs.verb import Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.export.export import ExportResult
    from texbake.progress import Progress

# Roles of a step for the files of these maps.
_EXPORTED = {kind.replace("-", "_"): kind for kind in KINDS}


def _with_named_maps(values: dict[str, Any]) -> dict[str, Any]:
    """Return values with the files of `KIND=FILE` by their kind."""
    maps: dict[str, Path] = {}
    for word in values["named_maps"]:
        kind, equals, file = word.partition("=")
        if not (kind and equals and file):
            raise OptionError(f"named_maps: {word!r} is not KIND=FILE, such as normal=n.png")
        if kind in maps:
            raise OptionError(f"named_maps: {kind} is given twice; give each map once")
        maps[kind] = Path(file)
    return {**values, "named_maps": maps}


@verb(
    Reads("mesh"),
    Writes("output", "folder", "Folder for the files, which is made if it is missing."),
    Options(ExportOptions, "to"),
    Extra(
        "--maps",
        "Folder of maps, such as bake wrote: images whose names end in normal, ao, roughness, ...",
        metavar="DIR",
        is_folder=True,
    ),
    Extra(
        "--map named_maps",
        "A map and its kind, in place of that in the folder; KIND:1002 is for UDIM tile 1002.",
        multiple=True,
        metavar="KIND=FILE",
    ),
    Reads(
        "levels",
        "mesh",
        "A coarser level of detail, for a GLB file; repeatable, the finest first.",
        flags=("--level",),
        required=False,
        many=True,
    ),
    Options(ExportOptions, without=("to",)),
    examples="""
      texbake export low_uv.obj --to unreal --maps maps -o unreal
      texbake export low.glb --to unity --map normal=n.png --map roughness=r.png -o unity
      texbake export low.obj --to threejs --maps maps --level lod1.obj --compress -o web
    """,
    table=lambda result: [],
    prepare=_with_named_maps,
)
def export_files(
    mesh: PathLike,
    output: PathLike,
    options: ExportOptions,
    *,
    maps: PathLike | None = None,
    named_maps: Mapping[str, PathLike] | None = None,
    levels: Sequence[PathLike] = (),
    progress: Progress = None,
) -> ExportResult:
    """Write MESH and its maps for another program.

    Green channels, heights, packed channels, names and formats are converted to what the program
    reads. SETTINGS.txt in the folder says what to set where.
    """
    from texbake.jobs.export.export import export_asset
    from texbake.jobs.export.maps import find_maps
    from texbake.mesh.files import read_mesh

    images = dict(named_maps or {}) if maps is None else find_maps(maps, named_maps, mesh=mesh)
    meshes = [read_mesh(path, progress=progress) for path in (mesh, *levels)]
    return export_asset(
        meshes[0],
        images,
        output,
        options,
        levels=meshes[1:],
        inputs=(mesh, *levels),
        progress=progress,
    )


def _asset_parameters(job: Job) -> dict[str, Any]:
    """Return the maps of a step by their kinds, and options with the name of the asset."""
    name = job.settings["name"] or job.asset.rpartition("/")[2]
    maps = {kind: file for role, kind in _EXPORTED.items() if (file := job.input(role))}
    options = EXPORT.made({**job.settings, "name": name}, threads=job.threads)
    return {"output": job.outputs["folder"], "options": options, "named_maps": maps}


def _figures(result: ExportResult) -> dict[str, Any]:
    return {
        "bytes": sum(path.stat().st_size for path in result.files),
        "notes": list(result.warnings),
    }


def _memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate; all roles but `mesh` and `levels` are images, which are decoded and converted."""
    images = [role for role in sizes if role not in ("mesh", "levels")]
    faces = n_faces(sizes, "mesh", "levels")
    return PROCESS + 64 * MB + 80 * n_bytes(sizes, *images) + 2 * READ_FACE * faces


EXPORT = step_of(
    export_files,
    does="writes an asset as another program reads it",
    inputs=(
        Reads("mesh"),
        Reads("levels", required=False, many=True),
        *(Reads(name, required=False) for name in _EXPORTED),
    ),
    outputs=lambda settings: {"folder": "export"},
    prepare=_asset_parameters,
    figures=_figures,
    memory=_memory,
    revision=3,
    names_asset=True,
)
