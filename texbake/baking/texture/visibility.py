"""Whether points on a mesh see a projector, or other parts of the mesh stand before it.

Rays go from outside towards the point and end just before it, so that what they meet hides it. They
begin at the projector or just outside the mesh, whichever is nearer, because float32 rays that come
from far away have few digits left where they arrive.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

# Beyond the unit cube from any point of it, in local units.
_OUTSIDE = 2.0

# In local units: what lies nearer than this to a point stands on it, not before it. That is 100
# times what a float32 ray that is two units long is off, so that a surface does not hide itself
# at the angles from which photographs count.
_CONTACT = 2.0**-16


class Visibility:
    """A ray tree over a mesh, asked who sees whom; close it in the end.

    Parameters
    ----------
    mesh : Mesh
    frame : LocalFrame
        Of the mesh alone.
    """

    def __init__(self, mesh: Mesh, frame: LocalFrame, *, threads: int | None = None) -> None:
        self._scene = RayScene.build(mesh, frame, threads=threads)

    def hidden(
        self,
        points: FloatArray,
        faces: IntArray,
        seen_from: FloatArray,
        slack: FloatArray | float = 0.0,
    ) -> npt.NDArray[np.bool_]:
        """Tell which points have a surface between them and a projector.

        Parameters
        ----------
        points : (n, 3) float64
            In local units.
        faces : (n,) int32
            On which the points lie, and which do not hide them.
        seen_from : (4,) float64
            A point as (x, y, z, 1), or the direction towards one at infinity as (x, y, z, 0).
        slack : (n,) float64
            In local units: what is nearer than this to a point does not hide it.

        Returns
        -------
        (n,) bool
            Faces hide from either side.
        """
        towards = seen_from[:3] - seen_from[3] * points
        distances = np.sqrt(np.einsum("ij,ij->i", towards, towards))
        towards /= np.where(distances > 0.0, distances, 1.0)[:, None]
        reach = np.minimum(distances, _OUTSIDE) if seen_from[3] else np.full(len(points), _OUTSIDE)
        rays = Rays(
            points + reach[:, None] * towards,
            -towards,
            np.maximum(reach - _CONTACT - slack, 0.0),
            reach,
        )
        met = self._scene.cast(rays, cull_back_faces=False).faces
        return np.asarray((met != NO_HIT) & (met != faces))

    def close(self) -> None:
        """Free the ray tree."""
        self._scene.close()
