"""Where the ray of a sample starts, which way it goes, and how far: a texel becomes a ray.

A ray starts outside the light mesh, at the sample's point moved along the direction of its corners,
and goes inward through the light surface: first the front distance, then the back distance. With a
cage it starts at the point of the cage that has the sample's barycentrics.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.ray_maps import RayMaps, reshape_kernel, sample_uvs
from texbake.baking.texels import Samples
from texbake.errors import CageError
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import flat_normals, shading_normals, smooth_normals
from texbake.parallel import run_bands
from texbake.raycast.rays import Rays


class RayField:
    """The rays of a light mesh: everything that a sample needs to become one.

    Parameters
    ----------
    low : Mesh
        The light mesh.
    frame : LocalFrame
        Of both meshes.
    kind : str
        `smooth`, `vertex` or `face`; a direction that cancels to zero falls back to the face's.
    front, back : float
        In model units.
    cage : Mesh, optional
        The light mesh's faces with other positions; it takes the place of `kind` and `front`.
    maps : RayMaps, optional
        Images over the light mesh's texture coordinates that change its rays.

    Raises
    ------
    CageError
        The cage has other faces than the light mesh.
    UvError
        There are images, and the light mesh has no texture coordinates.
    """

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
        self.front = float(frame.length_to_local(front))
        self.back = float(frame.length_to_local(back))
        self.positions = frozen(frame.to_local(low.positions))
        self.faces = low.faces
        if cage is not None:
            check_cage(cage, low)
        self.starts = self.positions if cage is None else frozen(frame.to_local(cage.positions))
        self._has_cage = cage is not None
        normals, corners = ray_normals(low, kind)
        self.normals, self.normal_faces = frozen(normals), frozen(corners)
        self._threads = threads
        self._maps = maps
        self._corner_uvs = None if maps is None else low.corner_uvs()
        self._straight = None
        if maps is not None and maps.skew is not None:
            self._straight = RayField(
                low, frame, kind="face", front=front, back=back, threads=threads
            )

    def rays(self, samples: Samples) -> Rays:
        """Rays of some samples, in their order."""
        n = len(samples)
        rays = Rays(np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n))

        def fill(start: int, stop: int) -> None:
            _rays_kernel(
                samples.faces[start:stop],
                samples.barycentrics[start:stop],
                (self.positions, self.starts, self.faces),
                (self.normals, self.normal_faces),
                (self.front, self.back, self._has_cage),
                rays.origins[start:stop],
                rays.directions[start:stop],
                rays.lengths[start:stop],
                rays.fronts[start:stop],
                (np.empty(3), np.empty(3)),
            )

        run_bands(fill, n, band=1 << 15, threads=self._threads)
        if self._maps is not None:
            self._reshape(rays, samples, self._maps)
        return rays

    def _reshape(self, rays: Rays, samples: Samples, maps: RayMaps) -> None:
        """Change rays, in place, as the images say."""
        assert self._corner_uvs is not None
        uvs = sample_uvs(self._corner_uvs, samples.faces, samples.barycentrics)
        skew, offset = maps.skew_at(uvs, self._threads), maps.offset_at(uvs, self._threads)
        straight = rays if self._straight is None else self._straight.rays(samples)

        def reshape(start: int, stop: int) -> None:
            band = slice(start, stop)
            reshape_kernel(
                samples.faces[band],
                samples.barycentrics[band],
                (self.positions, self.faces),
                (skew[band], offset[band]),
                straight.directions[band],
                self.back,
                (rays.origins[band], rays.directions[band], rays.lengths[band], rays.fronts[band]),
            )

        run_bands(reshape, len(samples), band=1 << 15, threads=self._threads)


def ray_normals(low: Mesh, kind: str) -> tuple[FloatArray, IntArray]:
    """Outward unit directions (N, 3) of rays, and the index (F, 3) of each corner's."""
    if kind == "smooth":
        return smooth_normals(low), low.faces
    if kind == "vertex":
        return shading_normals(low)
    return flat_normals(low)


def check_cage(cage: Mesh, low: Mesh) -> None:
    """Raise `CageError` unless a cage has the faces of the light mesh, in the same order."""
    if cage.n_vertices != low.n_vertices or not np.array_equal(cage.faces, low.faces):
        raise CageError(
            f"{cage.name}: a cage has the faces of the light mesh with other positions, and this "
            f"one has {cage.n_faces} faces on {cage.n_vertices} vertices where {low.name} has "
            f"{low.n_faces} on {low.n_vertices}, or others; make it by moving the vertices of "
            f"{low.name}"
        )


@kernel
def _rays_kernel(  # type: ignore[no-untyped-def]
    faces, barycentrics, surface, field, reach, origins, directions, lengths, fronts, scratch
):
    positions, starts, corners = surface
    normals, normal_corners = field
    front, back, has_cage = reach
    point, outward = scratch
    for i in range(len(faces)):
        face = faces[i]
        b, c = barycentrics[i, 0], barycentrics[i, 1]
        a = 1.0 - b - c
        square = 0.0
        for axis in range(3):
            point[axis] = (
                a * positions[corners[face, 0], axis]
                + b * positions[corners[face, 1], axis]
                + c * positions[corners[face, 2], axis]
            )
            if has_cage:
                outward[axis] = (
                    a * starts[corners[face, 0], axis]
                    + b * starts[corners[face, 1], axis]
                    + c * starts[corners[face, 2], axis]
                    - point[axis]
                )
            else:
                outward[axis] = (
                    a * normals[normal_corners[face, 0], axis]
                    + b * normals[normal_corners[face, 1], axis]
                    + c * normals[normal_corners[face, 2], axis]
                )
            square += outward[axis] * outward[axis]
        length = np.sqrt(square)
        # A cage that touches the surface, or unit normals that cancel to rounding: no direction.
        if length < 1e-12:
            length = _face_normal(positions, corners[face], outward)
            fronts[i] = 0.0 if has_cage else front
        else:
            fronts[i] = length if has_cage else front
        lengths[i] = fronts[i] + back if length > 0.0 else 0.0
        for axis in range(3):
            unit = outward[axis] / length if length > 0.0 else 0.0
            origins[i, axis] = point[axis] + fronts[i] * unit
            directions[i, axis] = -unit


@kernel
def _face_normal(positions, corners, normal):  # type: ignore[no-untyped-def]
    """Write a face's normal, as long as twice its area, and return that length."""
    a, b, c = corners[0], corners[1], corners[2]
    for axis in range(3):
        y, z = (axis + 1) % 3, (axis + 2) % 3
        normal[axis] = (positions[b, y] - positions[a, y]) * (positions[c, z] - positions[a, z]) - (
            positions[b, z] - positions[a, z]
        ) * (positions[c, y] - positions[a, y])
    return np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
