"""Photographs baked into a mesh's own atlas, blended by how well each shows a texel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack

import numpy as np

from texbake.baking.rays import RayField
from texbake.baking.texels import Samples
from texbake.baking.texture.camera import PhotoCamera
from texbake.baking.texture.coverage import TextureCoverage
from texbake.baking.texture.mapped_source import MappedSource
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photo import Photo, Picture
from texbake.baking.texture.photo_sources import PhotoSource, SurfacePoints
from texbake.baking.texture.projected_source import ProjectedSource
from texbake.baking.texture.result import PhotoShare, TextureBake, finished
from texbake.baking.texture.visibility import Visibility
from texbake.errors import OptionError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.progress import ProgressSink, Stages


def bake_photos(
    mesh: MeshLike,
    photos: Sequence[Photo],
    options: PhotoOptions | None = None,
    *,
    progress: ProgressSink | None = None,
) -> TextureBake:
    """Blend photographs into a mesh's texture.

    Parameters
    ----------
    mesh
        With texture coordinates; positions in the space of the cameras.
    photos
        At least one.
    options
        None for `PhotoOptions()`.
    progress
        Is told of the stages.

    Returns
    -------
    TextureBake
        Three channels. A texel has the mean of what its samples show in all photographs, weighted
        as `options` says; one that none shows has no color of its own and is told in the report.
        The same, byte for byte, for any number of threads.

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or they cover nothing.
    OptionError
        There is no photograph, a camera has no picture, or a mesh of coordinates has other faces.
    FileError
        A photograph cannot be read.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> camera = PhotoCamera(position=(0.5, 0.5, 3.0), target=(0.5, 0.5, 0.0))
    >>> red = Photo(image=np.full((4, 4, 3), (0.5, 0.0, 0.0), np.float32), camera=camera)
    >>> bake_photos(plane(), [red], PhotoOptions(size=16)).values[8, 8].tolist()
    [0.5, 0.0, 0.0]
    """
    mesh = as_mesh(mesh)
    options = options or PhotoOptions()
    if not photos:
        raise OptionError("photo: give at least one")
    stages = Stages(progress)
    coverage = TextureCoverage(mesh, options.for_bake)
    frame = LocalFrame.around(mesh)
    # Rays of no length start on the surface and go against its smooth normals.
    field = RayField(mesh, frame, kind="smooth", front=0.0, back=0.0, threads=options.threads)
    with stages.stage("read photographs"):
        pictures = [Picture(photo, i, threads=options.threads) for i, photo in enumerate(photos)]
    values = np.zeros((coverage.grid.height, coverage.grid.width, 3), np.float32)
    has_color = np.zeros(values.shape[:2], np.bool_)
    tally = _Tally([picture.name for picture in pictures])
    with ExitStack() as opened:
        sources = list(_sources(mesh, photos, pictures, frame, coverage, options, opened))
        for band in coverage.bands(stages):
            with stages.part("cast photographs"):
                points = _points(field, band.samples)
                parts = []
                for picture, source in zip(pictures, sources, strict=True):
                    views = source.views(points)
                    parts.append(band.sums(picture.weighted(views), views.ids))
                total = np.sum(parts, axis=0)
                seen = total[:, 3] > 0.0
                rows = slice(band.rows.start, band.rows.stop)
                values[rows].reshape(-1, 3)[seen] = total[seen, :3] / total[seen, 3:]
                has_color[rows] = seen.reshape(-1, band.width)
                tally.add([part[:, 3] for part in parts], total[:, 3])
    return finished(
        mesh,
        options,
        coverage,
        values,
        has_color,
        stages,
        source=f"{len(photos)} photograph{'s' * (len(photos) > 1)}",
        photos=tally.shares(),
    )


def _sources(
    mesh: Mesh,
    photos: Sequence[Photo],
    pictures: Sequence[Picture],
    frame: LocalFrame,
    coverage: TextureCoverage,
    options: PhotoOptions,
    opened: ExitStack,
) -> Iterator[PhotoSource]:
    """Yield what tells how points look in each photograph; `opened` frees it."""
    visibility = None
    if options.occlusion and any(photo.camera is not None for photo in photos):
        visibility = Visibility(mesh, frame, threads=options.threads)
        opened.callback(visibility.close)
    for photo, picture in zip(photos, pictures, strict=True):
        if photo.mapped is not None:
            yield MappedSource(mesh, photo.mapped, coverage.grid, options)
            continue
        camera = photo.camera
        try:
            matrix = (
                camera.matrix(picture.width / picture.height)
                if isinstance(camera, PhotoCamera)
                else np.array(camera, np.float64)
            )
            margins = options.margin / picture.width, options.margin / picture.height
            yield ProjectedSource(mesh, matrix, frame, coverage.grid, options, visibility, margins)
        except OptionError as error:
            raise OptionError(f"{picture.name}: {error}") from error


def _points(field: RayField, samples: Samples) -> SurfacePoints:
    rays = field.rays(samples)
    return SurfacePoints(samples.faces, samples.barycentrics, rays.origins, -rays.directions)


class _Tally:
    """How much each photograph gives, added up band by band."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._seen = [0] * len(names)
        self._shares = [0.0] * len(names)

    def add(self, weights: Sequence[FloatArray], total: FloatArray) -> None:
        """Take in the weights of some texels in each photograph, and their sums."""
        divisors = np.where(total > 0.0, total, 1.0)
        for i, weight in enumerate(weights):
            self._seen[i] += int(np.count_nonzero(weight > 0.0))
            self._shares[i] += float((weight / divisors).sum())

    def shares(self) -> tuple[PhotoShare, ...]:
        """Return the figures of each photograph."""
        whole = sum(self._shares) or 1.0
        rows = zip(self._names, self._seen, self._shares, strict=True)
        return tuple(PhotoShare(name, seen, 100.0 * share / whole) for name, seen, share in rows)
