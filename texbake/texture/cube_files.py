"""Environment maps in files: six faces in a folder, a cross, or a latitude-longitude image.

A cross is an unfolded cube of 4 x 3 faces, with the names of `texbake.texture.options.FACE_NAMES`:

         py                     py
      nx pz px nz            nx nz px pz
         ny                     ny

On the left, the faces as graphics APIs look them up ("opengl"); on the right, as seen from inside
the cube ("inside"), by a camera that looks along -z. In both, neighbors in the picture are
neighbors on the cube, and each face is named after its direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texbake.errors import FileError, FileFormatError, OptionError, require_known
from texbake.files import PathLike, check_folder, check_writable, is_folder
from texbake.mesh.mesh import AnyArray, Float32Array
from texbake.records import dataclass
from texbake.texture.cube_map import (
    CubeMap,
    from_latitude_longitude,
    resize_cube,
    to_latitude_longitude,
)
from texbake.texture.image import Image, read_image
from texbake.texture.image_files import bits_for, clipped_share, suffix_like, write_images
from texbake.texture.image_formats import check_image_format
from texbake.texture.options import CONVENTIONS, FACE_NAMES, CubeOptions

# Row and column in the cross of each face.
_PLACES = {
    "opengl": ((1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (1, 3)),
    "inside": ((1, 2), (1, 0), (0, 1), (2, 1), (1, 3), (1, 1)),
}


def in_convention(faces: AnyArray, convention: str) -> AnyArray:
    """Mirror faces (6, S, S, C) of a `CubeMap` into a convention, or back."""
    require_known("convention", convention, CONVENTIONS)
    if convention == "opengl":
        return faces
    seen = faces[:, :, ::-1].copy()
    seen[2:4] = faces[2:4, ::-1]
    return seen


def cross_picture(cube: CubeMap, *, convention: str = "opengl") -> Float32Array:
    """(3 S, 4 S, C) cross of an unfolded cube map, 0 outside the faces."""
    faces = in_convention(cube.faces, convention)
    size = cube.size
    picture = np.zeros((3 * size, 4 * size, cube.n_channels), np.float32)
    for face, (row, column) in zip(faces, _PLACES[convention], strict=True):
        picture[row * size : (row + 1) * size, column * size : (column + 1) * size] = face
    return picture


def is_cross(picture: AnyArray) -> bool:
    """Whether an image (H, W, C) has the proportions of a cross, 4:3."""
    height, width = picture.shape[:2]
    return bool(height % 3 == 0 and height * 4 == width * 3)


def cube_of_cross(
    picture: Float32Array, *, convention: str = "opengl", name: str = "image"
) -> CubeMap:
    """Fold a picture of 4 x 3 faces into a cube map."""
    if not is_cross(picture):
        height, width = picture.shape[:2]
        raise FileFormatError(
            f"{name}: {width} x {height} pixels are not a cross of 4 x 3 faces; crop them to 4:3"
        )
    size = picture.shape[0] // 3
    faces = np.stack(
        [
            picture[row * size : (row + 1) * size, column * size : (column + 1) * size]
            for row, column in _PLACES[convention]
        ]
    )
    return CubeMap(in_convention(faces, convention))


def face_files(folder: PathLike, suffix: str) -> list[Path]:
    """Return the paths of the six faces that are written to a folder."""
    return [Path(folder) / f"{names[0]}{suffix}" for names in FACE_NAMES]


def read_faces(
    folder: PathLike, *, convention: str = "opengl", color: bool = True, threads: int | None = None
) -> tuple[CubeMap, Image]:
    """Read the six images of a cube map."""
    images = [
        read_image(_find_face(Path(folder), names), color=color, threads=threads)
        for names in FACE_NAMES
    ]
    first = images[0]
    for image in images:
        height, width, _ = image.pixels.shape
        if height != width:
            raise FileFormatError(
                f"{folder}: {image.name} has {width} x {height} pixels; a face is a square"
            )
        if image.pixels.shape != first.pixels.shape:
            raise FileFormatError(
                f"{folder}: {image.name} has {width} x {height} pixels of "
                f"{image.pixels.shape[2]} channels and {first.name} has {first.pixels.shape[1]} x "
                f"{first.pixels.shape[0]} of {first.pixels.shape[2]}; make them alike"
            )
    return CubeMap(in_convention(np.stack([image.pixels for image in images]), convention)), first


def _find_face(folder: Path, names: Sequence[str]) -> Path:
    try:
        found = sorted(path for path in folder.iterdir() if path.stem.lower() in names)
    except OSError as error:
        raise FileError(f"{folder}: cannot be read: {error.strerror or error}") from error
    if not found:
        raise FileError(
            f"{folder}: the face {names[0]} is missing; name its file {' or '.join(names)}, "
            "with the suffix of an image"
        )
    if len(found) > 1:
        raise FileFormatError(
            f"{folder}: {found[0].name} and {found[1].name} are the same face; leave one there"
        )
    return found[0]


@dataclass(frozen=True)
class CubeConversion:
    """Result of `convert_cube`."""

    files: tuple[Path, ...]  # the files written
    source_layout: str  # `latlong`, `cross` or `faces`
    layout: str  # that of the output, likewise
    size: int  # side of a face, or height of a latlong, in texels
    clipped: float  # share of the values that were clipped to the range of the file format


def convert_cube(
    source: PathLike,
    output: PathLike,
    options: CubeOptions | None = None,
    *,
    threads: int | None = None,
) -> CubeConversion:
    """Convert an environment map between layouts."""
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
        cube = resize_cube(cube, options.size or cube.size, threads=threads)
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
    """Raise if the result cannot be written, before any work is done."""
    if options.layout == "faces" or (options.layout is None and not output.suffix):
        if output.suffix and not is_folder(output):
            raise OptionError(f"layout: faces go to a folder, and {output} names a file")
        check_folder(output)
    elif options.layout is None and is_folder(output):
        check_folder(output)
    elif not output.suffix:
        raise OptionError(f"layout: {options.layout} is one image, and {output} names a folder")
    else:
        check_image_format(output)
        check_writable(output)


def _layout_for(output: Path, source_layout: str) -> str:
    if is_folder(output) or not output.suffix:
        return "faces"
    return "cross" if source_layout == "latlong" else "latlong"


def _read(
    source: Path, options: CubeOptions, threads: int | None
) -> tuple[str, Image, CubeMap | None]:
    """Return the layout of a source, one image of it, and its cube map unless it is a latlong."""
    if is_folder(source):
        cube, image = read_faces(
            source, convention=options.convention, color=options.color, threads=threads
        )
        return "faces", image, cube
    image = read_image(source, color=options.color, threads=threads)
    height, width = image.pixels.shape[:2]
    if is_cross(image.pixels):
        cube = cube_of_cross(image.pixels, convention=options.convention, name=str(source))
        return "cross", image, cube
    # Programs that write images of an odd height round it either way.
    if abs(width - 2 * height) > 1:
        raise FileFormatError(
            f"{source}: {width} x {height} pixels are neither a latlong, twice as wide as high, "
            "nor a cross of 4 x 3 faces; crop or resize it"
        )
    return "latlong", image, None
