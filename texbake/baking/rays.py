"""Where a sample becomes a ray: where the ray starts, which direction it has, and how far it goes.

A ray starts outside the low-poly mesh, at the point of the sample moved along the direction there,
and goes inward through the low-poly surface: first the front distance, then the back distance. With
a cage it starts at the point of the cage with the same barycentrics.

Two images over the texture coordinates of the low-poly mesh can change its rays (`RayMaps`). A skew
mask blends the direction of each ray between that of the bake (0: smooth, without gaps, but with
detail beside hard edges skewed) and the normal of the face (1: straight, with gaps at hard edges).
An offset map scales how far out a ray starts: 1 keeps the front distance, or that of the cage; 0
starts on the low-poly surface. Both are looked up bilinearly at the samples.

A ray that found nothing is cast again, as far as the greatest distance of the bake, but starts no
farther out than the first face of the low-poly mesh that faces it from there, and ends where it
leaves its own part at the back (`UnobstructedRays`): it must not hit the next finger of a hand.
What the low-poly mesh leaves out, like a stud on a plate, limits nothing.

Kernel: `core/sample_rays.c`.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from texbake.baking.texels import SampleGrid, Samples
from texbake.core import core, portable_math as pm
from texbake.errors import CageError, OptionError
from texbake.mapping.seams import chart_ids
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import flat_normals, shading_normals, smooth_normals
from texbake.mesh.polygons import outlines
from texbake.parallel import run_bands
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayPlaces, RayScene, rows_of
from texbake.records import dataclass
from texbake.texture.lookup import lookup


@dataclass(frozen=True, eq=False)
class RayMaps:
    """Images that change the rays of a bake."""

    # (H, W, 1) float32: 0 for the direction of the bake to 1 for that of the face; and a factor of
    # the front distance, 0 or more
    skew: Float32Array | None = None
    offset: Float32Array | None = None

    @classmethod
    def of(
        cls, skew_mask: npt.ArrayLike | None = None, offset_map: npt.ArrayLike | None = None
    ) -> RayMaps | None:
        """Check the images, of which the first channel is used; None if there are none."""
        if skew_mask is None and offset_map is None:
            return None
        return cls(
            _first_channel("skew_mask", skew_mask, 1.0),
            _first_channel("offset_map", offset_map, np.inf),
        )

    def check(self, rays: str) -> None:
        """Raise `OptionError` if a mask would blend the normals of faces with themselves."""
        if self.skew is not None and rays == "face":
            raise OptionError(
                "skew_mask, rays: rays along face normals are straight already; use `rays=smooth` "
                "or `rays=vertex`"
            )


def _first_channel(name: str, image: npt.ArrayLike | None, most: float) -> Float32Array | None:
    if image is None:
        return None
    pixels = np.asarray(image, dtype=np.float32)
    if pixels.ndim == 2:
        pixels = pixels[:, :, np.newaxis]
    if pixels.ndim != 3 or pixels.size == 0:
        raise OptionError(f"{name}: the shape {pixels.shape} is not (height, width)")
    pixels = np.ascontiguousarray(pixels[:, :, :1])
    if not np.isfinite(pixels).all() or pixels.min() < 0.0 or pixels.max() > most:
        allowed = "0 to 1" if most == 1.0 else "0 or more"
        raise OptionError(
            f"{name}: its values go from {pixels.min():g} to {pixels.max():g}; "
            f"they must be {allowed}"
        )
    return pixels


def _look_up(
    image: Float32Array | None, uvs: FloatArray, without: float, threads: int | None
) -> Float32Array:
    """(n,) float32: an image at (n, 2) texture coordinates; `without` if there is none."""
    if image is None:
        return np.full(len(uvs), without, dtype=np.float32)
    return lookup(image, uvs, wrap="clamp", threads=threads)[:, 0]


class RayField:
    """The rays of a low-poly mesh; `front` and `back` are in model units."""

    def __init__(
        self,
        low: Mesh,
        frame: LocalFrame,
        *,
        kind: str,
        front: float,
        back: float,
        cage: Mesh | None = None,
        maps: RayMaps | None = None,
        threads: int | None = None,
    ) -> None:
        self.reaches: FloatArray | None = None
        self.front = float(frame.length_to_local(front))
        self.back = float(frame.length_to_local(back))
        self.positions = frozen(frame.to_local(low.positions))
        self.faces = low.faces
        self.starts = None if cage is None else frozen(frame.to_local(cage.positions))
        normals, corners = ray_normals(low, kind)
        self.normals, self.normal_faces = frozen(normals), frozen(corners)
        self._low = low
        self._threads = threads
        self._maps = maps
        self._straight = None
        if maps is not None and maps.skew is not None:
            self._straight = RayField(
                low, frame, kind="face", front=front, back=back, threads=threads
            )

    def with_reaches(self, reaches: FloatArray) -> RayField:
        """Return the rays with distances of their own at each corner, (F, 3, 2) in the frame."""
        field = copy(self)
        field.reaches = frozen(reaches)
        return field

    def rays(self, samples: Samples, *, threads: int | None = None) -> Rays:
        """Return the rays of some samples, in their order; `threads` are those given, for None."""
        threads = self._threads if threads is None else threads
        n = len(samples)
        rays = Rays(np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n))

        def fill(start: int, stop: int) -> None:
            band = slice(start, stop)
            core.cast_from_samples(
                samples.faces[band],
                samples.barycentrics[band],
                self.positions,
                self.starts,
                self.faces,
                self.normals,
                self.normal_faces,
                self.reaches,
                self.front,
                self.back,
                *rays.where(band).arrays(),
            )

        run_bands(fill, n, band=1 << 15, threads=threads)
        if self._maps is not None:
            self._reshape(rays, samples, self._maps, threads)
        return rays

    @cached_property
    def layout(self) -> tuple[FloatArray, IntArray]:
        """(F, 3, 2) texture coordinates of the corners, and (F,) int32 charts of the faces."""
        return self._low.corner_uvs(), chart_ids(self._low).astype(np.int32, copy=False)

    def places(self, samples: Samples, grid: SampleGrid) -> RayPlaces:
        """Return where the rays of samples stand in a grid over the texture."""
        corner_uvs, charts = self.layout
        n = len(samples)
        places = RayPlaces(np.empty(n, dtype=np.int32), np.empty((n, 2), dtype=np.int32))
        core.place_samples(
            samples.faces,
            samples.barycentrics,
            corner_uvs,
            charts,
            grid.n_columns,
            grid.n_rows,
            places.cells,
            places.charts,
        )
        return places

    def _reshape(self, rays: Rays, samples: Samples, maps: RayMaps, threads: int | None) -> None:
        """Change rays, in place, according to the images."""
        corner_uvs = self.layout[0][samples.faces]
        b, c = samples.barycentrics[:, :1], samples.barycentrics[:, 1:]
        uvs = (1.0 - b - c) * corner_uvs[:, 0] + b * corner_uvs[:, 1] + c * corner_uvs[:, 2]
        skew = _look_up(maps.skew, uvs, 0.0, threads)
        offset = _look_up(maps.offset, uvs, 1.0, threads)
        straight = rays if self._straight is None else self._straight.rays(samples, threads=threads)

        def reshape(start: int, stop: int) -> None:
            band = slice(start, stop)
            core.reshape_rays(
                samples.faces[band],
                samples.barycentrics[band],
                self.positions,
                self.faces,
                skew[band],
                offset[band],
                straight.directions[band],
                self.back,
                *rays.where(band).arrays(),
            )

        run_bands(reshape, len(samples), band=1 << 15, threads=threads)


def ray_normals(low: Mesh, kind: str) -> tuple[FloatArray, IntArray]:
    """Outward unit directions (N, 3) of rays, and the index (F, 3) of the one at each corner."""
    if kind == "smooth":
        return smooth_normals(low), low.faces
    if kind == "vertex":
        return shading_normals(low)
    return flat_normals(low)


# Shares of the area of the low-poly mesh; cages that fold in dents stay far below them.
_MOST_TURNED = 0.25
_MOST_BEHIND = 0.5


def checked_cage(cage: Mesh, low: Mesh) -> Mesh:
    """Return a cage with the triangles of the low-poly mesh, whose polygons it must have.

    Raises `CageError` if over a quarter of its area faces against `low`, or over half lies behind
    it.
    """
    if np.array_equal(_polygons(cage), _polygons(low)):
        cage = Mesh(positions=cage.positions, faces=low.faces, name=cage.name)
    if cage.n_vertices != low.n_vertices or not np.array_equal(cage.faces, low.faces):
        raise CageError(
            f"{cage.name}: a cage must have the faces of the low-poly mesh, in the same order; it "
            f"has {cage.n_polygons} faces on {cage.n_vertices} vertices and {low.name} has "
            f"{low.n_polygons} on {low.n_vertices}; make the cage by moving the vertices of "
            f"{low.name}"
        )
    frame = LocalFrame.around(low, cage)
    inner, outer = (frame.to_local(mesh.positions)[mesh.faces] for mesh in (low, cage))
    normals, turned = (
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        for corners in (inner, outer)
    )
    areas = pm.norm(normals, axis=1)
    against = areas[pm.vecdot(normals, turned) < 0.0].sum()
    behind = areas[pm.vecdot(normals, (outer - inner).sum(axis=1)) < 0.0].sum()
    for area, most, what in (
        (
            against,
            _MOST_TURNED,
            f"faces against {low.name}; its vertices are probably in another order; export it with "
            "the order of vertices kept",
        ),
        (
            behind,
            _MOST_BEHIND,
            f"lies behind the surface of {low.name}, which a cage must enclose; move its vertices "
            "outward",
        ),
    ):
        if area > most * areas.sum():
            raise CageError(
                f"{cage.name}: {100.0 * area / areas.sum():.0f} % of it {what}, or make it with: "
                f"texbake cage HIGH {low.name} -o OUT"
            )
    return cage


def _polygons(mesh: Mesh) -> IntArray:
    """(C,) int: vertices of all polygons, each after the negative number of its corners."""
    polygons = outlines(mesh)
    starts = np.cumsum(polygons.sizes) - polygons.sizes
    return np.insert(mesh.faces.ravel()[polygons.slots], starts, -polygons.sizes)


# Where a ray leaves the face it starts from, in the local frame: ten float32 roundings.
_LEAVES = 1e-6


@dataclass(frozen=True, eq=False)
class UnobstructedRays:
    """Rays of a field, made shorter where another part of the low-poly mesh is in the way."""

    field: RayField
    low: RayScene  # the low-poly mesh

    def rays(self, samples: Samples, *, threads: int | None = None) -> Rays:
        """Return the rays of some samples, in their order."""
        rays = self.field.rays(samples, threads=threads)
        points = rays.origins + rays.fronts[:, None] * rays.directions
        backs = rays.lengths - rays.fronts
        fronts = np.minimum(rays.fronts, self._free(points, -rays.directions, rays.fronts, False))
        backs = np.minimum(backs, self._free(points, rays.directions, backs, True))
        return replace(
            rays,
            origins=points - fronts[:, None] * rays.directions,
            lengths=np.where(rays.lengths > 0.0, fronts + backs, 0.0),
            fronts=fronts,
        )

    def _free(
        self, points: FloatArray, directions: FloatArray, lengths: FloatArray, behind: bool
    ) -> FloatArray:
        """(n,) float64: how far it is to the first face if `behind` is its side; else infinite."""
        starts = points + _LEAVES * directions
        probes = Rays(starts, directions, np.maximum(lengths - _LEAVES, 0.0), np.zeros(len(points)))
        make = rows_of(probes)  # in the order of the texels, each alone
        met = self.low.cast_in_order(len(probes), make, cull_back_faces=False, threads=1)
        limits = (met.faces != NO_HIT) & (met.passed_back == behind)
        return np.where(limits, met.distances + _LEAVES, np.inf)
