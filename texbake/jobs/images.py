"""Image files made from other image files: mip levels, cube maps, atlases, heights and normals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from texbake.errors import OptionError
from texbake.files import PathLike, appearing_together, check_folder, check_writable, make_folder
from texbake.jobs.outputs import JobResult, check_distinct, check_mesh, given
from texbake.mesh.files import read_mesh, write_mesh
from texbake.progress import ProgressSink
from texbake.texture.cube_files import CubeConversion, convert_cube
from texbake.texture.height_options import HeightToNormalOptions, NormalToHeightOptions
from texbake.texture.heights_and_normals import (
    HeightField,
    height_scale,
    height_to_normal,
    normal_to_height,
)
from texbake.texture.image import read_image, write_image
from texbake.texture.image_files import bits_for, write_heights, write_normals
from texbake.texture.image_formats import check_image_format
from texbake.texture.mip_files import write_mip_levels
from texbake.texture.options import CubeOptions, MipOptions, PackOptions
from texbake.texture.pack import PackedTextures, pack_textures


@dataclass(frozen=True)
class NormalMapReport:
    """The normal map that `height_to_normal_file` made.

    Attributes
    ----------
    width, height : int
        Texels.
    scale : float
        Height that a change of 1 in the image stood for.
    """

    width: int
    height: int
    scale: float


@dataclass(frozen=True, eq=False)
class HeightMapReport:
    """The heights that `normal_to_height_file` made.

    Attributes
    ----------
    mid, scale : float
        Of the file: a value v means the height (v - mid) * scale.
    """

    field: HeightField
    mid: float
    scale: float

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a figure."""
        low, high = float(self.field.heights.min()), float(self.field.heights.max())
        return [
            ("heights", f"{low:.6g} to {high:.6g}"),
            ("in the file", f"mid {self.mid:g}, scale {self.scale:g}"),
            ("slope error, RMS", f"{self.field.rms_slope_error:.4g}  (0 for a true surface)"),
        ]


@appearing_together()
def mipmap_files(
    image: PathLike,
    output: PathLike,
    options: MipOptions | None = None,
    *,
    roughness: PathLike | None = None,
    threads: int | None = None,
) -> JobResult[int]:
    """Write the mip levels of an image file, down to one texel.

    Parameters
    ----------
    image
    output
        A folder for one file per level, made if it is missing; or one picture of all levels.
    options
        None for the defaults.
    roughness
        A folder or a picture for the roughness that averaged normals have lost as detail.
    threads
        None for every processor.

    Returns
    -------
    JobResult of int
        The report is the number of files.
    """
    check_distinct([output, roughness], [image])
    files = write_mip_levels(image, output, options, roughness=roughness, threads=threads)
    return JobResult(files=files, report=len(files))


@appearing_together()
def cubemap_files(
    source: PathLike,
    output: PathLike,
    options: CubeOptions | None = None,
    *,
    threads: int | None = None,
) -> JobResult[CubeConversion]:
    """Convert an environment between a latitude-longitude image, a cross and six faces.

    Parameters
    ----------
    source
        An image file, or a folder of six faces.
    output
        An image file, or a folder for six faces.
    options
        None for the defaults.
    threads
        None for every processor.
    """
    check_distinct([output], [source])
    done = convert_cube(source, output, options, threads=threads)
    warnings = []
    if done.clipped:
        warnings.append(
            f"{output}: {done.clipped:.2%} of the values lie outside of 0 to 1 and were clipped; "
            "EXR and HDR files keep them"
        )
    return JobResult(files=done.files, report=done, warnings=tuple(warnings))


@appearing_together()
def pack_texture_files(
    images: Sequence[PathLike],
    output: PathLike,
    options: PackOptions | None = None,
    *,
    meshes: Sequence[PathLike] = (),
    mesh_outputs: PathLike | Sequence[PathLike] | None = None,
    data: bool = False,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[PackedTextures]:
    """Put several image files into one, and move the texture coordinates of their meshes with them.

    Parameters
    ----------
    images
    output
        The image of all images.
    options
        None for the defaults.
    meshes, mesh_outputs
        A mesh file for each image, in their order, and where the moved meshes go: a folder, made
        if it is missing, in which they keep their names; or a file for each.
    data
        The images hold data, such as roughness, and not colors.
    threads
        None for every processor.
    progress
        Receives the stages.

    Raises
    ------
    OptionError
        There is not one mesh per image.
    TexbakeError
        As `read_image`, `read_mesh` and `pack_textures` do.
    """
    targets = _mesh_targets(images, meshes, mesh_outputs)
    check_distinct([output, *targets], [*images, *meshes])
    check_writable(output)
    check_image_format(output, color=not data)
    read = [read_image(path, color=not data, threads=threads) for path in images]
    packed = pack_textures([image.pixels for image in read], options)
    moved = [
        packed.remapped(read_mesh(path, progress=progress), i) for i, path in enumerate(meshes)
    ]
    bits = bits_for(Path(output), packed.pixels, max(read, key=lambda image: image.bits))
    if targets:
        make_folder(targets[0].parent)
    for mesh, path in zip(moved, targets, strict=True):
        write_mesh(mesh, path)
    write_image(packed.pixels, output, color=not data, bits=bits, threads=threads)
    warnings = []
    if packed.scale < 1.0:
        warnings.append(
            f"{output}: the images were scaled down to {100 * packed.scale:.1f} % of their sides; "
            "give a larger `size` to keep them as they are"
        )
    return JobResult(files=(Path(output), *targets), report=packed, warnings=tuple(warnings))


def _mesh_targets(
    images: Sequence[PathLike],
    meshes: Sequence[PathLike],
    outputs: PathLike | Sequence[PathLike] | None,
) -> list[Path]:
    """Return a file for each moved mesh; raise if one could not be written."""
    if (outputs is None) != (not meshes):
        raise OptionError(
            "meshes, mesh_outputs: give both, a mesh for each image and a folder for them"
        )
    if outputs is None:
        return []
    if len(meshes) != len(images):
        raise OptionError(
            f"meshes: {len(meshes)} are given for {len(images)} images; give one for each, in order"
        )
    if isinstance(outputs, Sequence) and not isinstance(outputs, str):
        targets = [Path(path) for path in outputs]
    else:
        check_folder(outputs)
        targets = [Path(outputs) / Path(path).name for path in meshes]
    for target in targets:
        check_mesh(target, folder_is_made=True)
    return targets


@appearing_together()
def height_to_normal_file(
    height: PathLike,
    output: PathLike,
    options: HeightToNormalOptions | None = None,
    *,
    convention: str = "opengl",
    bits: int | None = None,
    threads: int | None = None,
) -> JobResult[NormalMapReport]:
    """Make the tangent-space normal map of a height map file.

    Parameters
    ----------
    height
        An image of which the first channel counts.
    output
        The normal map.
    options
        None for the defaults.
    convention
        Green channel: `opengl` or `directx`.
    bits
        Bits per channel: 8, 16, or 32 for floats. None for the most that the format holds.
    threads
        None for every processor.
    """
    options = options or HeightToNormalOptions()
    check_distinct([output], [height])
    check_writable(output)
    check_image_format(output, bits, channels=3, lossless=True)
    image = read_image(height, color=False, threads=threads)
    normals = height_to_normal(image, options)
    write_normals(normals, output, convention=convention, bits=bits, threads=threads)
    report = NormalMapReport(normals.shape[1], normals.shape[0], height_scale(image, options))
    return JobResult(files=given(output), report=report)


@appearing_together()
def normal_to_height_file(
    normal: PathLike,
    output: PathLike,
    options: NormalToHeightOptions | None = None,
    *,
    bits: int | None = None,
    threads: int | None = None,
) -> JobResult[HeightMapReport]:
    """Recover the height map of a tangent-space normal map file.

    Parameters
    ----------
    normal, output
        Image files.
    options
        None for the defaults.
    bits
        Bits per channel: 8, 16, or 32 for floats. None for the most that the format holds.
    threads
        None for every processor.
    """
    options = options or NormalToHeightOptions()
    check_distinct([output], [normal])
    check_writable(output)
    check_image_format(output, bits, channels=1, lossless=True)
    image = read_image(normal, color=False, threads=threads)
    field = normal_to_height(image, options)
    mid, scale = write_heights(field.heights, output, bits=bits, threads=threads)
    warnings = []
    if field.n_steep:
        warnings.append(
            f"{normal}: {field.n_steep:,} normals are too steep for heights and were limited to a "
            "slope of 100"
        )
    return JobResult(
        files=given(output), report=HeightMapReport(field, mid, scale), warnings=tuple(warnings)
    )
