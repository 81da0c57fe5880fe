"""Two models whose parts stand close together, high-poly and low-poly, with the same parts.

A part is the unit sphere with its points moved; its group has the part's name. The low-poly mesh
has fewer rings of the same spheres, so that its faces lie a little inside of the surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from texbake.mapping.unwrap import unwrap
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.shapes import uv_sphere

Form = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Part:
    """A form of the unit sphere, and what the high-poly mesh adds to it."""

    form: Form
    detail: Form = np.zeros_like


@dataclass(frozen=True)
class Crowd:
    """Both meshes; the part of each of their faces; and each part of the high-poly mesh alone."""

    high: Mesh
    low: Mesh
    low_parts: IntArray
    alone: list[Mesh]


def crowd(parts: dict[str, Part], high_rings: int, low_rings: int) -> Crowd:
    """Make both meshes of some parts."""
    alone = []
    for part in parts.values():
        sphere = uv_sphere(high_rings, 2 * high_rings)
        points = part.form(sphere.positions) + part.detail(sphere.positions)
        alone.append(Mesh(positions=points, faces=sphere.faces))
    sphere = uv_sphere(low_rings, 2 * low_rings)
    coarse = [
        Mesh(positions=part.form(sphere.positions), faces=sphere.faces) for part in parts.values()
    ]
    low = _joined(coarse, tuple(parts))
    assert low.face_groups is not None
    return Crowd(_joined(alone, tuple(parts)), unwrap(low), low.face_groups, alone)


def _joined(meshes: list[Mesh], names: tuple[str, ...]) -> Mesh:
    firsts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    return Mesh(
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        faces=np.concatenate(
            [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)]
        ).astype(np.int32),
        face_groups=np.repeat(
            np.arange(len(meshes), dtype=np.int32), [mesh.n_faces for mesh in meshes]
        ),
        group_names=names,
    )


def capsule(middle: tuple[float, float, float], radius: float, half_length: float) -> Form:
    """Upright capsule."""

    def form(points: FloatArray) -> FloatArray:
        middles = np.zeros_like(points)
        middles[:, 2] = half_length * np.clip(4.0 * points[:, 2], -1.0, 1.0)
        return np.asarray(np.array(middle) + radius * points + middles)

    return form


def block(middle: tuple[float, float, float], half_sides: tuple[float, float, float]) -> Form:
    """Box with rounded edges."""

    def form(points: FloatArray) -> FloatArray:
        scales = (points**8).sum(axis=1, keepdims=True) ** (-1 / 8)
        return np.asarray(np.array(middle) + np.array(half_sides) * points * scales)

    return form


def lump(height: float, axis: tuple[float, float, float], width: float = 0.4) -> Form:
    """A lump that stands out of a part, around one direction."""
    away = np.array(axis)

    def form(points: FloatArray) -> FloatArray:
        nearness = np.exp(-(((points - away) / width) ** 2).sum(axis=1))
        return np.asarray(height * nearness[:, None] * away)

    return form


def ripples(height: float) -> Form:
    """Fine waves all over a part."""
    return lambda points: height * np.sin(20.0 * points[:, 2:]) * points


def hand() -> Crowd:
    """Four fingers with gaps of a fifth of their width, over a palm with a lump as high as a finger
    is wide, which the low-poly mesh leaves out.
    """
    fingers = {
        f"finger {i}": Part(
            capsule((0.24 * i - 0.36, 0.0, 0.9), 0.1, 0.45 - 0.05 * abs(i - 1.5)), ripples(0.004)
        )
        for i in range(4)
    }
    palm = Part(block((0.0, 0.0, 0.0), (0.5, 0.16, 0.4)), lump(0.2, (0.0, -1.0, 0.0)))
    return crowd({**fingers, "palm": palm}, high_rings=48, low_rings=14)


def hinge() -> Crowd:
    """Two plates, the knuckles between them on a pin, bolts that stand in a plate, and a lump that
    the low-poly mesh leaves out.
    """
    plates = {
        "left plate": Part(block((-0.6, 0.0, 0.0), (0.46, 0.05, 0.8)), lump(0.25, (0.0, 1.0, 0.0))),
        "right plate": Part(block((0.6, 0.0, 0.0), (0.46, 0.05, 0.8)), ripples(0.002)),
    }
    knuckles = {
        f"knuckle {i}": Part(block((0.0, 0.0, 0.4 * i - 0.6), (0.13, 0.13, 0.19)), ripples(0.002))
        for i in range(4)
    }
    bolts = {
        f"bolt {i}": Part(block((0.3 + 0.15 * i, 0.06, 0.5), (0.06, 0.08, 0.06)), ripples(0.002))
        for i in range(4)
    }
    pin = {"pin": Part(capsule((0.0, 0.0, 0.0), 0.06, 0.85))}
    return crowd({**plates, **knuckles, **bolts, **pin}, high_rings=48, low_rings=14)
