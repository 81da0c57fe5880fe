"""Options, charts and errors of `texbake.compat.xatlas`."""

from __future__ import annotations

import enum
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from texbake.errors import TexbakeError
from texbake.records import dataclass

UintArray = npt.NDArray[np.uint32]

_Values = dict[str, bool | int | float]


class AddMeshError(TexbakeError, RuntimeError):
    """A mesh cannot be added to an atlas."""


class ArrayError(TexbakeError, ValueError):
    """An array has the wrong shape."""


class NoImageError(TexbakeError, RuntimeError):
    """An atlas was generated without `PackOptions.create_image`."""


class ChartType(enum.Enum):
    """How a chart was flattened; texbake reports all charts as LSCM."""

    Planar = 0
    Ortho = 1
    LSCM = 2
    Piecewise = 3
    Invalid = 4

    def __int__(self) -> int:
        return int(self.value)


class _Options:
    """Attributes with fixed names and types."""

    _defaults: ClassVar[_Values] = {}

    def __init__(self) -> None:
        for name, value in self._defaults.items():
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._defaults:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        kind = type(self._defaults[name])
        if kind is bool:
            value = bool(value)
        elif kind is int:
            if not hasattr(value, "__index__") or value.__index__() < 0:
                raise TypeError(f"{name}: {value!r} is not an integer of 0 or more")
            value = value.__index__()
        elif not hasattr(value, "__float__"):
            raise TypeError(f"{name}: {value!r} is not a number")
        object.__setattr__(self, name, kind(value))

    def __getattr__(self, name: str) -> Any:  # for type checkers: those of `_defaults` exist
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")


class ChartOptions(_Options):
    """How charts are cut.

    With `use_input_mesh_uvs`, meshes keep their texture coordinates as charts. A
    `normal_seam_weight` above 1000 cuts charts where the normals of a mesh jump. All others are
    accepted and have no effect: texbake cuts charts by their stretch, all wound alike.
    """

    _defaults: ClassVar[_Values] = {
        "max_chart_area": 0.0, "max_boundary_length": 0.0, "normal_deviation_weight": 2.0,
        "roundness_weight": 0.01, "straightness_weight": 6.0, "normal_seam_weight": 4.0,
        "texture_seam_weight": 0.5, "max_cost": 2.0, "max_iterations": 1,
        "use_input_mesh_uvs": False, "fix_winding": False,
    }  # fmt: skip


class PackOptions(_Options):
    """How charts are packed.

    `resolution`, `texels_per_unit`, `padding` and `create_image` mean what they do for xatlas, but
    a resolution without a density is reached exactly, and a chart that is too long for a resolution
    and a density raises an `UnwrapError` instead of being scaled down. `bilinear` asks for a
    padding of one texel at least, and `bruteForce` for the quality `best`. All others are accepted
    and have no effect.
    """

    _defaults: ClassVar[_Values] = {
        "max_chart_size": 0, "padding": 0, "texels_per_unit": 0.0, "resolution": 0,
        "bilinear": True, "blockAlign": False, "bruteForce": False, "create_image": False,
        "rotate_charts_to_axis": True, "rotate_charts": True,
    }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Chart:
    """One chart of a mesh."""

    faces: UintArray  # (n,) faces of the mesh
    atlas_index: int
    material: int
    type: ChartType = ChartType.LSCM
