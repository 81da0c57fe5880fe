from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mapping.options import UnwrapOptions


def test_width_and_height_of_a_square_and_of_a_rectangle() -> None:
    assert (UnwrapOptions(size=512).width_px, UnwrapOptions(size=512).height_px) == (512, 512)
    assert (UnwrapOptions(size=(512, 64)).width_px, UnwrapOptions(size=(512, 64)).height_px) == (
        512,
        64,
    )


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"method": "magic"}, "method: magic is not one of atlas"),
        ({"size": 0}, "size: 0 is out of range"),
        ({"size": 100_000}, "size: 100000 is out of range"),
        ({"size": (512, -1)}, "size: -1 is out of range"),
        ({"size": (1, 2, 3)}, "neither a whole number nor"),
        ({"padding": -1}, "padding: -1 is out of range; it must be 0 or more"),
        ({"size": (1024, 8), "padding": 4}, "leave no room in 1024 x 8"),
        ({"timeout": 0.0}, "timeout: 0.0"),
        ({"timeout": float("nan")}, "timeout: nan"),
        ({"keep": True, "max_stretch": 1.1}, "max_stretch: charts that are kept are not cut"),
        ({"keep": True, "charts": "xatlas"}, "charts: charts that are kept are not cut"),
        ({"timeout": 9.0}, "timeout: it is for xatlas; leave it out, or use charts xatlas"),
        (
            {"method": "projector", "matrix": ((1.0, 0.0, 0.0, 0.0),) * 4, "fov": 50.0},
            "fov: the matrix has its own",
        ),
        ({"method": "projector", "camera": 5}, "camera: 5 is neither 2 finite numbers nor 3"),
        ({"method": "planar", "warp": ("twirl",)}, "is not a name with its strength"),
        ({"rotate": float("inf")}, "rotate: inf is not a finite number"),
        ({"texel_density": 9.0, "scale": 2.0}, "texel_density: an atlas is packed at"),
        (
            {"texel_density": 9.0, "warp": "twirl"},
            "texel_density: an atlas is packed at",
        ),
        ({"method": "two-part", "surface": "box", "theta": (0.0, 90.0)}, "theta: the surface box"),
        ({"method": "two-part", "surface": "plane", "padding": 9}, "padding: the surface plane"),
        ({"method": "two-part", "eye": (0.0, 0.0, 9.0)}, "eye: via centroid does not use it"),
        ({"method": "cylindrical", "theta": (0.0, 1e-320)}, "theta: .* is an empty range"),
    ],
)
def test_a_value_that_cannot_be_is_one_clear_error(values: dict[str, Any], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        UnwrapOptions(**values)


def test_numbers_of_numpy_are_numbers() -> None:
    center = tuple(np.float32([1, 2, 3]))
    assert UnwrapOptions(method="spherical", center=center).center == (1.0, 2.0, 3.0)


def test_defaults_are_read_without_loading_numpy() -> None:
    code = "import sys, texbake.mapping.options; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-P", "-c", code], check=False).returncode == 0
