"""Environments from file to file: latitude-longitude images, crosses and six faces."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike, check_folder, check_writable
from texbake.texture.cube_files import (
    cross_picture,
    cube_of_cross,
    face_files,
    in_convention,
    is_cross,
    read_faces,
)
from texbake.texture.cube_lookup import resized
from texbake.texture.cube_map import CubeMap
from texbake.texture.cube_options import CubeOptions
from texbake.texture.image import Image, read_image
from texbake.texture.image_files import bits_for, clipped_share, suffix_like, write_images
from texbake.texture.image_formats import check_image_format
from texbake.texture.latitude_longitude import from_latitude_longitude, to_latitude_longitude


@dataclass(frozen=True)
class CubeConversion:
    """What `convert_cube` did.

    Attributes
    ----------
    files : tuple of Path
        That were written.
    source_layout, layout : str
        Of what was read and written: `latlong`, `cross` or `faces`.
    size : int
        Texels along one side of a face, or rows of a latlong.
    clipped : float
        Share of the values that were outside of what the files hold.
    """

    files: tuple[Path, ...]
    source_layout: str
    layout: str
    size: int
    clipped: float


def convert_cube(
    source: PathLike,
    output: PathLike,
    options: CubeOptions | None = None,
    *,
    threads: int | None = None,
) -> CubeConversion:
    """Convert an environment in files.

    Parameters
    ----------
    source
        A latitude-longitude image twice as wide as high, a cross of 4 x 3 faces, or a folder with
        six faces.
    output
        A folder for six faces, or an image.
    options
        None for the defaults of `CubeOptions`.
    threads
        None for every processor.

    Raises
    ------
    OptionError
        Layout, source and output do not fit together.
    FileError
        A file cannot be read, or one cannot be written.
    FileFormatError
        The source is no image of such a shape.
    """
    options = options or CubeOptions()
    source, output = Path(source), Path(output)
    _check_output(output, options)
    source_layout, image, cube = _read(source, options, threads)
    layout = options.layout or _layout_for(output, source_layout)
    if layout == source_layout == "latlong":
        raise OptionError(f"layout: {source} is a latlong already; write a cross or faces of it")
    if cube is None:
        cube = from_latitude_longitude(image.pixels, size=options.size, threads=threads)
    if layout == "latlong":
        picture = to_latitude_longitude(cube, height=options.size, threads=threads)
        images, size = {output: picture}, len(picture)
    else:
        cube = resized(cube, options.size or cube.size, threads=threads)
        size = cube.size
        if layout == "cross":
            images = {output: cross_picture(cube, convention=options.convention)}
        else:
            suffix = f".{options.format}" if options.format else suffix_like(image)
            faces = in_convention(cube.faces, options.convention)
            images = dict(zip(face_files(output, suffix), faces, strict=True))
    first = next(iter(images))
    bits = bits_for(first, cube.faces, image)
    write_images(images, color=options.color, bits=bits, threads=threads)
    clipped = clipped_share(first, cube.faces, bits)
    return CubeConversion(tuple(images), source_layout, layout, size, clipped)


def _check_output(output: Path, options: CubeOptions) -> None:
    """Raise now if the result could not be written later."""
    if options.layout == "faces" or (options.layout is None and not output.suffix):
        if output.suffix and not output.is_dir():
            raise OptionError(f"layout: faces go to a folder, and {output} names a file")
        check_folder(output)
    elif options.layout is None and output.is_dir():
        check_folder(output)
    elif not output.suffix:
        raise OptionError(f"layout: {options.layout} is one image, and {output} names a folder")
    else:
        check_image_format(output, color=options.color)
        check_writable(output)


def _layout_for(output: Path, source_layout: str) -> str:
    if output.is_dir() or not output.suffix:
        return "faces"
    return "cross" if source_layout == "latlong" else "latlong"


def _read(
    source: Path, options: CubeOptions, threads: int | None
) -> tuple[str, Image, CubeMap | None]:
    """Layout of a source, an image of it, and its cube map unless it is a latlong."""
    if source.is_dir():
        cube, image = read_faces(
            source, convention=options.convention, color=options.color, threads=threads
        )
        return "faces", image, cube
    image = read_image(source, color=options.color, threads=threads)
    height, width = image.pixels.shape[:2]
    if is_cross(image.pixels):
        cube = cube_of_cross(image.pixels, convention=options.convention, name=str(source))
        return "cross", image, cube
    # Odd heights are rounded by those who write them.
    if abs(width - 2 * height) > 1:
        raise FileFormatError(
            f"{source}: {width} x {height} pixels are neither a latlong, twice as wide as high, "
            "nor a cross of 4 x 3 faces; crop or resize it"
        )
    return "latlong", image, None
