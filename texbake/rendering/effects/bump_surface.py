"""A surface that a height is laid over: its frame at fragments, and the height about them.

Everything is told in the object's own space, in whose units heights are. P(u, v) is a point of a
triangle, N the shading normal that the fragment has. P_u and P_v are those of the triangle, turned
into the plane across N; N_u and N_v those of the mesh's normals, interpolated over the triangle and
normalized.

The height is looked up one texel apart, or one pixel where that is more. Within a texel it is
linear, so shorter steps would show the texels as facets; over less than a pixel there is nothing to
be seen. A procedure in space has no texture coordinates: there u and v are lengths along the
triangle, and the step is a pixel. Where a triangle has no area, in space or on the texture, there
is no frame.

Based on: Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978; Mikkelsen, "Bump mapping
unparametrized surfaces on the GPU", 2010, for slopes without texture coordinates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.compose import transformed_normals
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.rendering.effect import RenderState, Target
