"""Photographs baked into the texture of a mesh, blended by how well each shows a texel.

World space is right-handed. A camera matrix takes (x, y, z, 1) in model space to (s, t, r, q) as in
`texbake.mapping.classical.projector`: (s / q, t / q) is (0, 0) at the lower left and (1, 1) at the
upper right corner of the picture, and q, like r, is the depth along the view.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.rays import RayField
from texbake.baking.texels import SampleGrid
from texbake.baking.texture.canvas import PhotoShare, TextureBake, TextureCanvas
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photo_mappings import CameraMapping, PhotoLookups, UvMapping
from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, OptionError, counted, quoted
from texbake.files import PathLike, read_bytes
from texbake.limits import toml_content
from texbake.mapping.classical.projector import projector_matrix, read_matrix
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.shared import Matrix, Vector, check_direction, check_numbers
from texbake.mesh.frame import LocalFrame, unit_scale
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.progress import Progress
from texbake.raycast.scene import RayScene
from texbake.records import dataclass
from texbake.texture.image import Image, read_image
from texbake.texture.mipmaps import mip_chain
from texbake.texture.sample import sample

# Least component of `up` across the view, relative to its length: with less, rounding alone could
# turn the picture.
_LEAST_UP = 1e-9


@dataclass(frozen=True, kw_only=True)
class PhotoCamera:
    """A perspective camera."""

    # position of the camera, and the point in the middle of its picture; model space
    position: Vector
    target: Vector
    # direction that is up in the picture; of any length, but not along the view
    up: Vector = (0.0, 1.0, 0.0)
    fov: float = 35.0  # vertical field of view in degrees, above 0 and below 180
    # width of the picture divided by its height; None takes it from the photograph's pixels
    aspect: float | None = None

    def __post_init__(self) -> None:
        check_numbers("position", self.position, 3)
        check_numbers("target", self.target, 3)
        check_direction("up", self.up)
        if not _is_number(self.fov) or not 0.0 < self.fov < 180.0:
            raise OptionError(f"fov: {quoted(self.fov)} degrees must be above 0 and below 180")
        if self.aspect is not None and not (
            _is_number(self.aspect) and 0.0 < self.aspect < math.inf
        ):
            raise OptionError(f"aspect: {quoted(self.aspect)} must be above 0, such as 1.5")
        self.axes()

    def axes(self) -> FloatArray:
        """(3, 3) float64: the unit vectors right, up and back (against the view) as rows."""
        with np.errstate(over="ignore"):  # which the distance then shows
            back = np.subtract(self.position, self.target)
        longest = float(np.abs(back).max())
        if not 0.0 < longest < math.inf:
            raise OptionError(
                "target: it is the position of the camera; give a point that it looks at"
            )
        back = back * unit_scale(longest)  # so that squares neither overflow nor vanish
        back = back / pm.norm(back)
        right = np.cross(np.divide(self.up, np.abs(self.up).max()), back)
        across = pm.norm(right)
        if across < _LEAST_UP:
            raise OptionError(f"up: {self.up} is along the view; give a direction across it")
        right = right / across
        return np.stack([right, np.cross(back, right), back])

    def matrix(self, aspect: float = 1.0, frame: LocalFrame | None = None) -> FloatArray:
        """(4, 4) float64: model space, or that of a frame, to (s, t, r, q); see `aspect`."""
        right, up, back = self.axes()
        focal = 1.0 / pm.tan(math.radians(self.fov) / 2.0)
        across = focal / (self.aspect or aspect)
        rows = np.stack([0.5 * (across * right - back), 0.5 * (focal * up - back), -back, -back])
        place = np.asarray(self.position, np.float64)
        if frame is None:
            return np.column_stack([rows, pm.matmul(-rows, place)])
        return np.column_stack([rows, pm.matmul(rows, (frame.center - place) * frame.scale)])


def read_camera(path: PathLike) -> PhotoCamera | Matrix:
    """Read the camera of a photograph."""
    if Path(path).suffix.lower() != ".toml":
        return read_matrix(path)
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: it is not TOML: {error}") from error
    return _camera_of(path, toml_content(path, text))


def _camera_of(path: PathLike, keys: Mapping[str, Any]) -> PhotoCamera:
    known = tuple(PhotoCamera.__dataclass_fields__)
    for key in keys:
        if key not in known:
            raise FileFormatError(f"{path}: {key}: unknown key; a camera has {', '.join(known)}")
    for key in "position", "target":
        if key not in keys:
            raise FileFormatError(f"{path}: {key}: it is missing; give {key} = [x, y, z]")
    values: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in keys.items()
    }
    try:
        return PhotoCamera(**values)
    except OptionError as error:
        raise FileFormatError(f"{path}: {error}") from error


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True, kw_only=True, eq=False)
class Photo:
    """A photograph, with its camera or with a mesh that is unwrapped onto it."""

    # path, Image or (H, W, C) float32: an array holds linear colors, gray or RGB. The second
    # channel of two and the fourth of four is opacity, by which pixels are weighted; a pixel that
    # is not finite has none.
    image: PathLike | Image | Float32Array
    camera: PhotoCamera | Matrix | None = None  # A camera, or a matrix as in `read_camera`
    # Instead of a camera: the faces of the baked mesh, in the same order, with texture coordinates
    # in the photograph. Whatever lies outside the unit square is not in it.
    mapped: Mesh | None = None
    name: str | None = None  # name in messages and reports; None takes the name of the file

    def __post_init__(self) -> None:
        if (self.camera is None) == (self.mapped is None):
            raise OptionError("camera, mapped: give each photograph exactly one of the two")


class PhotoPixels:
    """The pixels of a photograph with their opacity, as a mipmap chain that can be filtered."""

    def __init__(self, photo: Photo, number: int, *, threads: int | None = None) -> None:
        if isinstance(photo.image, str | os.PathLike):
            image = read_image(photo.image, color=True, threads=threads)
        elif isinstance(photo.image, Image):
            image = photo.image
        else:
            image = Image(np.asarray(photo.image, np.float32), name=f"photograph {number + 1}")
        self.name = photo.name or Path(image.name).name
        pixels = image.pixels
        if pixels.ndim != 3 or pixels.size == 0 or pixels.shape[2] > 4:
            raise OptionError(
                f"{self.name}: its shape {pixels.shape} is not that of an image; give (height, "
                "width, channels) with 1 to 4 channels"
            )
        self.height, self.width = pixels.shape[:2]
        self._threads = threads
        self._mipmaps = mip_chain(
            _premultiplied(pixels), kind="color", wrap="clamp", threads=threads
        )

    def weighted_colors(self, lookups: PhotoLookups) -> FloatArray:
        """(m, 4) float64: filtered colors times weight and opacity, and that product itself."""
        colors = sample(
            self._mipmaps,
            lookups.coordinates,
            lookups.derivatives,
            filter="ewa",
            wrap="clamp",
            threads=self._threads,
        )
        return colors * lookups.weights[:, None]


def _premultiplied(pixels: Float32Array) -> Float32Array:
    """(H, W, 4) float32: colors times opacity, and opacity."""
    n_colors = 1 if pixels.shape[2] < 3 else 3
    weighted = np.ones((*pixels.shape[:2], 4), np.float32)
    weighted[..., :3] = pixels[..., :n_colors]
    if pixels.shape[2] > n_colors:
        weighted[..., 3] = np.clip(pixels[..., n_colors], 0.0, 1.0)
        with np.errstate(invalid="ignore"):  # infinite, and 0
            weighted[..., :3] *= weighted[..., 3:]
    weighted[~np.isfinite(weighted).all(axis=2)] = 0.0
    return weighted


def bake_photos(
    mesh: MeshLike,
    photos: Sequence[Photo],
    options: PhotoOptions | None = None,
    *,
    progress: Progress = None,
) -> TextureBake:
    """Blend photographs into the texture of a mesh."""
    mesh = as_mesh(mesh)
    options = options or PhotoOptions()
    if not photos:
        raise OptionError("photos: there are none; give at least one")
    canvas = TextureCanvas(mesh, options, 3, progress)
    stages = canvas.stages
    frame = LocalFrame.around(mesh)
    # Rays of length 0 start on the surface; their directions are its smooth normals, reversed.
    field = RayField(mesh, frame, kind="smooth", front=0.0, back=0.0, threads=options.threads)
    with stages.stage("read photographs"):
        pixels = [PhotoPixels(photo, i, threads=options.threads) for i, photo in enumerate(photos)]
    n_seen, shares = np.zeros(len(pixels), dtype=int), np.zeros(len(pixels))
    mappings = list(_mappings(mesh, photos, pixels, frame, canvas.grid, options))
    for band in canvas.bands():
        with stages.part("project photographs"):
            rays = field.rays(band.samples)
            sums = []
            for photo, mapping in zip(pixels, mappings, strict=True):
                lookups = mapping.look_up(band.samples, rays)
                sums.append(band.sums(photo.weighted_colors(lookups), lookups.ids))
            total = np.sum(sums, axis=0)
            seen = total[:, 3] > 0.0
            divisors = np.where(seen, total[:, 3], 1.0)
            canvas.put(band, total[:, :3] / divisors[:, None], seen)
            for i, weighted in enumerate(sums):
                n_seen[i] += np.count_nonzero(weighted[:, 3] > 0.0)
                shares[i] += (weighted[:, 3] / divisors).sum()
    percents = 100.0 * shares / (sum(shares.tolist()) or 1.0)
    rows = zip([photo.name for photo in pixels], n_seen.tolist(), percents.tolist(), strict=True)
    return canvas.finish(
        counted(len(photos), "photograph"), photos=tuple(PhotoShare(*row) for row in rows)
    )


def _mappings(
    mesh: Mesh,
    photos: Sequence[Photo],
    pixels: Sequence[PhotoPixels],
    frame: LocalFrame,
    grid: SampleGrid,
    options: PhotoOptions,
) -> Iterator[CameraMapping | UvMapping]:
    """Yield the mapping into each photograph."""
    occluders = None
    if options.occlusion and any(photo.camera is not None for photo in photos):
        occluders = RayScene.build(mesh, frame, threads=options.threads)
    for photo, image in zip(photos, pixels, strict=True):
        if photo.mapped is not None:
            yield UvMapping(mesh, photo.mapped, grid, options)
            continue
        camera = photo.camera
        try:
            matrix = (
                camera.matrix(image.width / image.height, frame)
                if isinstance(camera, PhotoCamera)
                else _local_matrix(mesh, camera, frame)
            )
            margins = options.margin / image.width, options.margin / image.height
            yield CameraMapping(mesh, matrix, frame, grid, options, occluders, margins)
        except OptionError as error:
            raise OptionError(f"{image.name}: {error}") from error


def _local_matrix(mesh: Mesh, camera: Matrix | None, frame: LocalFrame) -> FloatArray:
    """(4, 4) float64: local space to (s, t, r, q), by a camera's matrix."""
    a, b, c, d = (tuple(float(value) for value in row) for row in np.array(camera, np.float64))
    given = UnwrapOptions(method="projector", matrix=(a, b, c, d))  # type: ignore[arg-type]
    return projector_matrix(mesh, given, frame)
