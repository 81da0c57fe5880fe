"""A texture over a mesh's own atlas, from a solid procedure or from photographs, as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from texbake.baking.texture.options import PhotoOptions, SolidOptions
from texbake.baking.texture.photo import Photo, read_camera
from texbake.baking.texture.photos import bake_photos
from texbake.baking.texture.result import TextureBake, TextureReport
from texbake.baking.texture.solid import bake_solid
from texbake.errors import OptionError
from texbake.files import PathLike, appearing_together, check_writable
from texbake.jobs.outputs import (
    JobResult,
    check_distinct,
    check_picture,
    check_report,
    given,
    write_report,
)
from texbake.mesh.files import read_mesh
from texbake.progress import ProgressSink
from texbake.texture.image import write_image
from texbake.texture.image_formats import check_image_format

_CAMERA_SUFFIXES = (".toml", ".txt")


@appearing_together()
def bake_texture_files(
    mesh: PathLike,
    output: PathLike,
    options: SolidOptions | PhotoOptions,
    *,
    photos: Sequence[PathLike] = (),
    cameras: Sequence[PathLike] = (),
    data: bool = False,
    bits: int | None = None,
    unseen_map: PathLike | None = None,
    report: PathLike | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[TextureReport]:
    """Bake a procedure, or photographs, into a texture for a mesh file, and write it.

    Parameters
    ----------
    mesh
        With texture coordinates.
    output
        The texture.
    options
        `SolidOptions` for a procedure, `PhotoOptions` for photographs.
    photos, cameras
        Image files, and for each where it was taken from: a file that `read_camera` reads, or a
        mesh file of the same faces whose texture coordinates are places in the photograph.
    data
        The values are data, such as roughness, and not colors.
    bits
        Bits per channel of the file: 8, 16, or 32 for floats. None for the most that the format
        holds.
    unseen_map, report
        Further files: a picture of the texels that no photograph shows, and the figures as JSON.
    progress
        Receives the stages.

    Raises
    ------
    OptionError
        Photographs and options do not go together, or there is not one camera per photograph.
    TexbakeError
        As `read_mesh`, `bake_solid` and `bake_photos` do.
    """
    check_distinct([output, unseen_map, report], [mesh, *photos, *cameras])
    _check_sources(options, photos, cameras)
    check_writable(output)
    check_picture(unseen_map)
    check_report(report)
    check_image_format(output, bits, color=not data)
    result = _baked(mesh, options, photos, cameras, progress)
    result.write(output, color=not data, bits=bits)
    if unseen_map is not None:
        write_image(result.unseen_map(), unseen_map)
    if report is not None:
        write_report(report, result.report.to_json())
    return JobResult(
        files=given(output, unseen_map, report),
        report=result.report,
        warnings=tuple(result.report.warnings),
    )


def _check_sources(
    options: SolidOptions | PhotoOptions, photos: Sequence[PathLike], cameras: Sequence[PathLike]
) -> None:
    if isinstance(options, SolidOptions):
        if photos or cameras:
            raise OptionError("photos, cameras: a procedure has none; give PhotoOptions with them")
    elif not photos:
        raise OptionError("photos: there are none; give at least one, or SolidOptions")
    elif len(photos) != len(cameras):
        raise OptionError(
            f"cameras: {len(cameras)} are given for {len(photos)} photographs; give one for each, "
            "in their order"
        )


def _baked(
    mesh: PathLike,
    options: SolidOptions | PhotoOptions,
    photos: Sequence[PathLike],
    cameras: Sequence[PathLike],
    progress: ProgressSink | None,
) -> TextureBake:
    target = read_mesh(mesh, progress=progress)
    if isinstance(options, SolidOptions):
        return bake_solid(target, options, progress=progress)
    sources = []
    for image, file in zip(photos, cameras, strict=True):
        if Path(file).suffix.lower() in _CAMERA_SUFFIXES:
            sources.append(Photo(image=image, camera=read_camera(file)))
        else:
            sources.append(Photo(image=image, mapped=read_mesh(file, progress=progress)))
    return bake_photos(target, sources, options, progress=progress)
