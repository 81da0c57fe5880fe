"""Cube maps in files: six images in a folder, or one image of the unfolded cube.

The unfolded cube has 4 x 3 faces, with the names of `cube_options.FACE_NAMES`:

         py                     py
      nx pz px nz            nx nz px pz
         ny                     ny

on the left as the graphics APIs look faces up ("opengl"), on the right as an eye inside sees them
("inside"), which looks along -z like a camera that has not been turned. Either way neighbors in the
picture are neighbors on the cube, and each face has the name of its direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileError, FileFormatError, OptionError
from texbake.files import PathLike
from texbake.texture.cube_map import CubeMap
from texbake.texture.cube_options import CONVENTIONS, FACE_NAMES
from texbake.texture.image import Image, read_image

# Row and column in the cross of each face.
_PLACES = {
    "opengl": ((1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (1, 3)),
    "inside": ((1, 2), (1, 0), (0, 1), (2, 1), (1, 3), (1, 1)),
}


def in_convention(faces: npt.NDArray[Any], convention: str) -> npt.NDArray[Any]:
    """Faces (6, S, S, C) of a `CubeMap` as a convention has them, or such faces as a `CubeMap`'s.

    Seen from inside, the four sides are mirrored left to right; the top and the bottom are mirrored
    up and down, so that they go on where the side along -z ends.

    Raises
    ------
    OptionError
        The convention is not known.
    """
    if convention not in CONVENTIONS:
        raise OptionError(
            f"convention: {convention!r} is not known; it is one of {', '.join(CONVENTIONS)}"
        )
    if convention == "opengl":
        return faces
    seen = faces[:, :, ::-1].copy()
    seen[2:4] = faces[2:4, ::-1]
    return seen


def cross_picture(cube: CubeMap, *, convention: str = "opengl") -> npt.NDArray[np.float32]:
    """Unfold a cube map into one picture.

    Returns
    -------
    (3 S, 4 S, C) float32
        0 where no face is.
    """
    faces = in_convention(cube.faces, convention)
    size = cube.size
    picture = np.zeros((3 * size, 4 * size, cube.n_channels), np.float32)
    for face, (row, column) in zip(faces, _PLACES[convention], strict=True):
        picture[row * size : (row + 1) * size, column * size : (column + 1) * size] = face
    return picture


def is_cross(picture: npt.NDArray[Any]) -> bool:
    """Whether an image (H, W, C) has the shape of an unfolded cube, 4 x 3 faces."""
    height, width = picture.shape[:2]
    return bool(height % 3 == 0 and height * 4 == width * 3)


def cube_of_cross(
    picture: npt.NDArray[np.float32], *, convention: str = "opengl", name: str = "image"
) -> CubeMap:
    """Fold a picture of 4 x 3 faces into a cube map.

    Raises
    ------
    FileFormatError
        The picture has another shape; `name` is what the message calls it.
    """
    if not is_cross(picture):
        height, width = picture.shape[:2]
        raise FileFormatError(
            f"{name}: {width} x {height} pixels are no cross of 4 x 3 faces; crop it to 4:3"
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
    """Names of the six files of a cube map that is written to a folder."""
    return [Path(folder) / f"{names[0]}{suffix}" for names in FACE_NAMES]


def read_faces(
    folder: PathLike, *, convention: str = "opengl", color: bool = True, threads: int | None = None
) -> tuple[CubeMap, Image]:
    """Read the six images of a cube map.

    Returns
    -------
    cube : CubeMap
    first : Image
        The file of +x, which tells how all were stored.

    Raises
    ------
    FileError
        A face is missing.
    FileFormatError
        There are two files of a face, one is no image, or they are not squares of one size.
    """
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
