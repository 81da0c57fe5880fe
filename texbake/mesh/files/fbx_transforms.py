"""Where the models of an FBX file stand: local transforms with all pivots, and what is inherited.

A point goes through scaling about the scaling pivot, post-rotation, rotation and pre-rotation about
the rotation pivot, and translation::

    T  Roff  Rp  Rpre  R  Rpost^-1  Rp^-1  Soff  Sp  S  Sp^-1

Pre-rotation, post-rotation and the order of rotation count where `RotationActive` is set. The
geometric transform moves the geometry of a model, but not its children.

Based on: Autodesk, "FBX SDK", sample Transformations, 2020, for the ways to inherit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray

Properties = Mapping[str, Sequence[float]]
# Axes in the order in which they turn a point; 6, spherical, is taken as 0.
_ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
_ROTATE_FIRST, _USUAL, _WITHOUT_PARENT_SCALE = range(3)


@dataclass(frozen=True, eq=False)
class Placed:
    """Where a model stands.

    Attributes
    ----------
    matrix : (4, 4) float64
        To the world.
    rotation : (3, 3) float64
        What its children inherit as rotation.
    scaling : (3,) float64
        Its own scaling.
    """

    matrix: FloatArray
    rotation: FloatArray
    scaling: FloatArray


WORLD = Placed(np.eye(4), np.eye(3), np.ones(3))


def place(parent: Placed, properties: Properties) -> Placed:
    """Place a model in its parent, by the way its `InheritType` says."""
    rotation, local = _local(properties)
    scaling = _vector(properties, "Lcl Scaling", 1.0)
    kind = _integer(properties, "InheritType", _USUAL)
    matrix = pm.matmul(parent.matrix, local)
    turned = pm.matmul(parent.rotation, rotation)
    if kind in (_ROTATE_FIRST, _WITHOUT_PARENT_SCALE):
        # What of the parent's map is no rotation; its own scaling stays out where asked for.
        stretch = pm.matmul(parent.rotation.T, parent.matrix[:3, :3])
        if kind == _WITHOUT_PARENT_SCALE:
            inverse = np.divide(1.0, parent.scaling, where=parent.scaling != 0, out=np.ones(3))
            stretch = stretch * inverse
        matrix[:3, :3] = pm.matmul(turned, stretch) * scaling
    return Placed(matrix, turned, scaling)


def geometric(properties: Properties) -> FloatArray:
    """(4, 4) matrix from the geometry of a model to the model."""
    rotation = _rotation(_vector(properties, "GeometricRotation"))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * _vector(properties, "GeometricScaling", 1.0)
    matrix[:3, 3] = _vector(properties, "GeometricTranslation")
    return matrix


def _local(properties: Properties) -> tuple[FloatArray, FloatArray]:
    """Rotation and (4, 4) matrix of a model in its parent."""
    is_active = bool(_integer(properties, "RotationActive", 0))
    order = _ORDERS[_integer(properties, "RotationOrder", 0) % 6 if is_active else 0]
    rotation = _rotation(_vector(properties, "Lcl Rotation"), order)
    if is_active:
        before = _rotation(_vector(properties, "PreRotation"))
        after = _rotation(_vector(properties, "PostRotation"))
        rotation = pm.matmul(pm.matmul(before, rotation), after.T)
    scaling = _vector(properties, "Lcl Scaling", 1.0)
    pivot = _vector(properties, "RotationPivot")
    center = _vector(properties, "ScalingPivot")
    # Points stay in place under scaling at its pivot, and under rotation at the other.
    scaled = center - scaling * center + _vector(properties, "ScalingOffset") - pivot
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * scaling
    matrix[:3, 3] = (
        pm.matmul(rotation, scaled)
        + pivot
        + _vector(properties, "RotationOffset")
        + _vector(properties, "Lcl Translation")
    )
    return rotation, matrix


def _rotation(degrees: FloatArray, order: str = "xyz") -> FloatArray:
    """(3, 3) rotation by three angles about the axes, one axis after the other."""
    matrix = np.eye(3)
    for axis in order:
        i = "xyz".index(axis)
        j, k = (i + 1) % 3, (i + 2) % 3
        angle = math.radians(degrees[i]) if math.isfinite(degrees[i]) else math.nan
        turn = np.eye(3)
        turn[j, j] = turn[k, k] = pm.cos(angle)
        turn[k, j] = pm.sin(angle)
        turn[j, k] = -turn[k, j]
        matrix = pm.matmul(turn, matrix)
    return matrix


def _vector(properties: Properties, name: str, default: float = 0.0) -> FloatArray:
    values = properties.get(name, ())
    return np.array(values[:3], np.float64) if len(values) >= 3 else np.full(3, default)


def _integer(properties: Properties, name: str, default: int) -> int:
    values = properties.get(name, ())
    return int(values[0]) if len(values) and math.isfinite(values[0]) else default


def scene_axes(settings: Properties) -> FloatArray:
    """(4, 4) matrix from the axes and the unit of a file to Y up, Z to the front, and meters.

    Axes that contradict each other count as not given. A unit is a number of centimeters.
    """
    axes = np.zeros((3, 3))
    for row, (name, default) in enumerate((("Coord", 0), ("Up", 1), ("Front", 2))):
        axis = _integer(settings, f"{name}Axis", default)
        sign = _integer(settings, f"{name}AxisSign", 1)
        if 0 <= axis < 3:
            axes[row, axis] = -1.0 if sign < 0 else 1.0
    if abs(pm.det(axes)) != 1.0:
        axes = np.eye(3)
    unit = next(iter(settings.get("UnitScaleFactor", ())), 1.0)
    meters = 0.01 * unit if 0.0 < unit < math.inf else 0.01
    matrix = np.eye(4)
    matrix[:3, :3] = axes * meters
    return matrix
