"""The knob of the kinds of maps: what each costs to bake, and how much of it shows anything."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.baking.result import BakedMap, BakeResult
from texbake.study.case import Case
from texbake.study.knob import Evaluation, Experiment, Knob, Setting

# Maps that a surface may do without, from the cheapest to those that cast rays of their own.
_MAPS = ("normal", "displacement", "curvature", "ao", "bent-normal", "thickness")
# Half a step of 8 bits: of shares from 0 to 1, and of the components of normals.
_SHARE, _COMPONENT = 0.5 / 255.0, 1.0 / 255.0
# Side in pixels of the pictures.
_SIDE = 200
# Lengths below this share of the mesh's size do not show.
_LENGTH = 0.5 / 65535.0


def _prepare_map_kind(case: Case) -> Experiment:
    pair = case.pair
    size = case.choose(1024, 64)
    extent = float(np.ptp(pair.low.bounds, axis=0).max())

    def work(name: str) -> BakeResult:
        options = BakeOptions(size=size, maps=(name,), threads=case.threads)
        return bake(pair.high, pair.low, options)

    def judge(name: str, result: BakeResult) -> Evaluation:
        found = result.maps[name]
        differs, largest = _differs(found, extent)
        counts = result.report.counts
        rays = counts.rays_cast + counts.secondary_rays
        return Evaluation(
            error=100.0 * float(1.0 - differs.mean()),
            picture=_shown(found),
            figures={
                "texels that the map changes (%)": 100.0 * float(differs.mean()),
                f"largest change ({_unit_of(found)})": largest,
                "rays (million)": rays / 1e6,
            },
        )

    return Experiment(
        subject=f"{pair.subject}, at {size} x {size}",
        truth="exact values",
        truth_text="The value that a surface has without the map: a flat normal, a height of 0, "
        "no curvature, an open surface, no thickness.",
        settings=tuple(Setting(name, name) for name in _MAPS),
        work=work,
        judge=judge,
    )


def _differs(found: BakedMap, extent: float) -> tuple[np.ndarray, float]:
    """(n,) bool: texels that differ from no map; and the largest difference."""
    values = found.values[found.has_data]
    changes = np.abs(values - np.array(found.kind.neutral(found.options))).max(axis=1)
    if found.kind.coding == "mask":
        least = _SHARE
    elif found.kind.coding == "normal":
        least = _COMPONENT
    elif found.kind.coding == "curvature":  # one over a length
        least, changes = _LENGTH, changes * extent
    else:
        least = _LENGTH * extent
    return changes > least, float(changes.max(initial=0.0))


def _shown(found: BakedMap) -> npt.NDArray[np.float32]:
    """(200, 200, 3): the whole map; normals as colors, other values from black to white."""
    rows, columns = (np.arange(_SIDE) * side // _SIDE for side in found.values.shape[:2])
    values = found.values[rows[:, None], columns]
    if found.kind.coding == "normal":
        return np.asarray(0.5 + 0.5 * values, np.float32)
    low, high = float(values.min()), float(values.max())
    gray = (values[..., :1] - low) / max(high - low, 1e-30)
    return np.repeat(gray, 3, axis=2).astype(np.float32)


def _unit_of(found: BakedMap) -> str:
    words = {"mask": "of 1", "normal": "of a component", "curvature": "over the mesh's size"}
    return words.get(found.kind.coding, "model units")


MAP_KIND_KNOB = Knob(
    name="map-kind",
    title="Kinds of maps",
    about="One map at a time: what it costs to bake, and how many of its texels differ from what "
    "a surface has without it. A map that changes few texels is not worth its rays.",
    error="texels that the map leaves as they are",
    unit="%",
    kind="texels",
    prepare=_prepare_map_kind,
)
