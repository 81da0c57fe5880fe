"""A knob: the settings of one thing, how to try each, and how wrong each is; and what it works on.

A knob prepares an `Experiment` for a `Case`. A setting costs the time of `Experiment.work` alone;
`Experiment.judge` then compares its product with the truth, untimed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import cached_property
from importlib import import_module
from typing import Any, TypeVar

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mapping.unwrap import unwrap
from texbake.mesh.mesh import Float32Array, Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.mesh.shapes import icosphere, orange
from texbake.mesh.simplify import simplify
from texbake.records import dataclass
from texbake.rendering.scene.scene import Scene
from texbake.study.options import KNOB_MODULES
from texbake.study.truth.surfaces import Surface, orange_surface, rippled_surface

TRUTHS = ("closed form", "exact values", "high-poly mesh", "rays", "converged")


@dataclass(frozen=True)
class Setting:
    """One value of a knob."""

    label: str  # its name in plots, unique within the knob
    value: Any  # the argument of `Experiment.work`
    series: str = ""  # settings of one series turn one thing up step by step; plots join them
    # Settings compete only with others of the same problem; each problem has a front of its own.
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How good the product of a setting is."""

    error: float  # 0 or more, in the unit of the knob
    # (H, W, 3) float32; a crop that shows it, in linear light.
    picture: Float32Array | None = None
    # What else was measured, by names that include the unit: `missed texels (%)`.
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A knob prepared for a case."""

    subject: str  # what is worked on, in words
    # One of `TRUTHS`: a closed form; the values before they were encoded; the high-poly mesh that
    # is approximated; separate rays cast into it, without a texture between; or what the work
    # converges to, at a setting far beyond those that are tried.
    truth: str
    truth_text: str  # the same in a sentence
    settings: tuple[Setting, ...]  # faster ones first
    work: Callable[[Any], Any]  # from a value to a product; timed
    judge: Callable[[Any, Any], Evaluation]  # from a value and its product to a judgment; not timed
    close: Callable[[], None] = lambda: None  # removes temporary files


@dataclass(frozen=True)
class NotApplicable:
    """Why a knob cannot be studied on a case; it is then left out of the study."""

    reason: str  # begins with what does not fit, as an error message does


@dataclass(frozen=True)
class Knob:
    """Something that a user can turn up or down."""

    name: str
    title: str
    about: str  # what it is and what to expect of it, in a sentence or two
    error: str  # what its error is, in words, for the axis of its plot
    unit: str  # of the error: `°`, `%`, `texels` and the like
    kind: str  # errors of one kind, such as `angle` or `picture`, are shown in one plot
    # Prepares it, or says why it cannot be studied.
    prepare: Callable[[Case], Experiment | NotApplicable]
    # Series that the others are compared with: the page says in what share of its time they reach
    # the same errors.
    baseline: str = ""


def knob_named(name: str) -> Knob:
    """Return the knob of one of `KNOB_NAMES`, such as `MAP_KIND_KNOB`, importing its module."""
    module = import_module(f"texbake.study.knobs.{KNOB_MODULES[name]}")
    knob: Knob = getattr(module, f"{name.replace('-', '_').upper()}_KNOB")
    return knob


_ORANGE_TRIANGLES = 500_000
_QUICK_LEVEL = 5  # of an icosphere, 20,480 triangles
_LOW_POLY_TRIANGLES = 500
_QUICK_LOW_POLY_TRIANGLES = 100
_ATLAS_SIZE = 1024

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class StudyPair:
    """A high-poly mesh, its closed form if it was made from one, and a low-poly mesh with uvs."""

    high: Mesh
    low: Mesh
    subject: str
    surface: Surface | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """What knobs are studied on."""

    # high, low: the user's pair.
    high: Mesh | None = None
    low: Mesh | None = None
    scene: Scene | None = None  # the user's scene
    quick: bool = False  # whether to keep everything small
    threads: int | None = None

    @cached_property
    def pair(self) -> StudyPair:
        """The user's pair, the low-poly mesh unwrapped if needed; else a generated one."""
        if self.high is None or self.low is None:
            return self.made_pair
        low = low_with_uvs(self.high, self.low, self.threads)
        words = f"{self.high.name} ({self.high.n_faces:,} triangles) and "
        return StudyPair(self.high, low, f"{words}{low.name} ({low.n_faces:,})")

    @cached_property
    def made_pair(self) -> StudyPair:
        """An orange (small: a rippled sphere) with exact normals, and a low-poly mesh of it."""
        surface = self.choose(orange_surface, rippled_surface)()
        sphere = orange(_ORANGE_TRIANGLES) if not self.quick else icosphere(_QUICK_LEVEL)
        lengths = pm.norm(sphere.positions, axis=1)
        name = self.choose("orange", "rippled sphere")
        high = surface.mesh(sphere.positions / lengths[:, None], sphere.faces, name)
        bare = high.replace(normals=None, normal_faces=None)
        low = simplify(
            bare, self.choose(_LOW_POLY_TRIANGLES, _QUICK_LOW_POLY_TRIANGLES), threads=self.threads
        )
        low = unwrap(low, quality=self.choose("good", "fast"), threads=self.threads)
        subject = f"{name}, {high.n_faces:,} triangles of known form, and {low.n_faces:,}"
        return StudyPair(high, low, subject, surface)

    def choose(self, full: Value, quick: Value) -> Value:
        """Return the second value if everything is kept small, else the first."""
        return quick if self.quick else full


def low_with_uvs(high: Mesh, low: Mesh, threads: int | None = None) -> Mesh:
    """Return a user's low-poly mesh, unwrapped if needed; raise if a mesh has no surface."""
    for mesh in high, low:
        if degenerate_faces(mesh).all():
            raise MeshError(
                f"{mesh.name}: no face has an area, so there is nothing "
                "to measure; give a mesh with a surface"
            )
    return low if low.uvs is not None else unwrap(low, size=_ATLAS_SIZE, threads=threads)
