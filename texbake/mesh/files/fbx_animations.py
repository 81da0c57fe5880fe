"""Animations of FBX files: what their layers together give for a property, and shapes.

The first layer gives values. Each further one is added to what the layers below it give, or takes
their place, by its weight: rotations angle by angle or as a whole, scales as sums or as products.
A channel with several shapes shows two of them at a time, or one and the surface without shapes.

Based on: Autodesk, "FBX SDK Programmer's Guide", 2020, for FbxAnimLayer; B. Raiskila, "ufbx", 2020,
for how rotations are composed: in the order x, y, z, whatever the order of the model.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.deformation import Morph
from texbake.mesh.files.fbx_curves import Curve, read_curve
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.files.fbx_scene import FbxObject, FbxScene, Id, euler_matrices
from texbake.mesh.mesh import FloatArray
from texbake.mesh.rig import decomposed, rotation_matrices
from texbake.records import dataclass

ROTATION, SCALING, PERCENT = "Lcl Rotation", "Lcl Scaling", "DeformPercent"
Target = tuple[Id, str]  # an object, and a property of it
_AXES = {"d|X": 0, "d|Y": 1, "d|Z": 2, "d|DeformPercent": 0, "d|Weight": 0}
_LEAST_STEP = 1e-6  # between the weights of shapes of a channel
_ADDS, _REPLACES = 0, 1  # other modes replace by the weight


@dataclass(frozen=True, eq=False)
class Track:
    """Values of a property in a layer, axis by axis."""

    curves: Mapping[int, Curve]
    constants: Mapping[int, float]  # of axes without a curve

    def at(self, times: FloatArray, default: FloatArray) -> FloatArray:
        """(n, w) values at (n,) times; `default` (w,) where there are none."""
        rows: FloatArray = np.tile(default, (len(times), 1))
        for axis, constant in self.constants.items():
            if axis < rows.shape[1]:
                rows[:, axis] = constant
        for axis, curve in self.curves.items():
            if axis < rows.shape[1]:
                rows[:, axis] = curve.at(times)
        return rows


@dataclass(frozen=True, eq=False)
class Layer:
    """A layer of an animation."""

    tracks: Mapping[Target, Track]
    weight: Track  # in percent
    mode: int
    turns_as_a_whole: bool
    scales_by_products: bool

    def over(self, below: FloatArray, target: Target, times: FloatArray) -> FloatArray:
        """(n, w) values of a property, from those of the layers below."""
        path = target[1]
        default = np.full(below.shape[1], float(path == SCALING))
        own = self.tracks[target].at(times, default)
        if self.mode == _REPLACES:
            return own
        weight = np.clip(self.weight.at(times, np.array([100.0])) / 100.0, 0.0, 1.0)
        adds = self.mode == _ADDS
        if path == ROTATION and self.turns_as_a_whole:
            one, other = euler_matrices(below), euler_matrices(own)
            if adds:
                turned = pm.matmul(
                    one, _between(np.eye(3)[None].repeat(len(own), 0), other, weight)
                )
            else:
                turned = _between(one, other, weight)
            return _euler_angles(turned)
        if path == SCALING and self.scales_by_products:
            rest = 1.0 if adds else 1.0 - weight
            return _powers(below, rest) * _powers(own, weight)
        return below * (1.0 if adds else 1.0 - weight) + own * weight


@dataclass(frozen=True, eq=False)
class Animation:
    """An animation: its name and its layers, the lowest first."""

    name: str
    layers: tuple[Layer, ...]

    @property
    def targets(self) -> dict[Target, None]:
        """Properties that it moves."""
        return dict.fromkeys(target for layer in self.layers for target in layer.tracks)

    def curves(self, target: Target) -> list[Curve]:
        """Curves that a property depends on."""
        found: list[Curve] = []
        for number, layer in enumerate(self.layers):
            if target in layer.tracks:
                found += layer.tracks[target].curves.values()
                found += layer.weight.curves.values() if number else ()
        return found

    def at(self, target: Target, times: FloatArray, default: FloatArray) -> FloatArray:
        """(n, w) values of a property at (n,) times; `default` (w,) below the layers."""
        rows: FloatArray = np.tile(default, (len(times), 1))
        for number, layer in enumerate(self.layers):
            if target not in layer.tracks:
                continue
            if number == 0:
                rows = layer.tracks[target].at(times, default)
            else:
                rows = layer.over(rows, target, times)
        return rows


def read_animations(scene: FbxScene) -> list[Animation]:
    """Read the animations of a scene that have curves."""
    owners: dict[Id, list[Target]] = {}
    for owner, members in scene.members.items():
        for member, name in members:
            if name.startswith("Lcl ") or name in (PERCENT, "Weight"):
                owners.setdefault(member, []).append((owner, name))
    found = []
    for stack in (o for o in scene.objects.values() if o.node.name == "AnimationStack"):
        items = scene.members_of(stack.key, "AnimationLayer")
        layers = [
            _layer(scene, item, owners, is_base=item is items[0], is_alone=len(items) == 1)
            for item in items
        ]
        animation = Animation(stack.name, tuple(layers))
        if any(animation.curves(target) for target in animation.targets):
            found.append(animation)
    return found


def _layer(
    scene: FbxScene,
    item: FbxObject,
    owners: Mapping[Id, list[Target]],
    *,
    is_base: bool,
    is_alone: bool,
) -> Layer:
    def whole(name: str) -> int:
        value = next(iter(item.properties.get(name, ())), 0)
        return int(value) if isinstance(value, int | float) and math.isfinite(value) else 0

    tracks: dict[Target, Track] = {}
    is_muted = bool(whole("Mute")) and not is_base
    for node in () if is_muted else scene.members_of(item.key, "AnimationCurveNode"):
        track = _track(scene, node)
        for target in owners.get(node.key, ()):
            if track.curves or not is_alone:
                tracks.setdefault(target, track)
    own = next(iter(item.properties.get("Weight", ())), 100.0)
    own = float(own) if isinstance(own, int | float) and math.isfinite(own) else 100.0
    weight = tracks.pop((item.key, "Weight"), Track({}, {}))
    return Layer(
        tracks=tracks,
        weight=weight if weight.curves else Track({}, {0: own}),
        mode=whole("BlendMode"),
        turns_as_a_whole=whole("RotationAccumulationMode") == 0,
        scales_by_products=whole("ScaleAccumulationMode") == 0,
    )


def _track(scene: FbxScene, node: FbxObject) -> Track:
    constants = {
        _AXES[name]: float(values[0])
        for name, values in node.properties.items()
        if name in _AXES and values and isinstance(values[0], int | float)
    }
    curves = {}
    for member, name in scene.members.get(node.key, ()):
        item = scene.objects.get(member)
        if name in _AXES and item is not None and item.node.name == "AnimationCurve":
            curve = read_curve(item.node)
            if curve is not None:
                curves[_AXES[name]] = curve
    return Track(curves, {axis: value for axis, value in constants.items() if np.isfinite(value)})


@dataclass(frozen=True, eq=False)
class Shape:
    """A morph target, and the channel whose percentage sets its weight."""

    name: str
    node: Node
    channel: FbxObject | None = None
    full: FloatArray = field(default_factory=lambda: np.ones(1))  # weights of a channel's shapes
    place: int = 0  # among these

    def morph(self, n_vertices: int) -> Morph:
        """Morph target of a geometry with so many vertices."""
        indices = self.node.numbers("Indexes").astype(np.int64)
        moves = self.node.numbers("Vertices").astype(np.float64)
        n = min(len(indices), len(moves) // 3)
        indices, moves = indices[:n], moves[: 3 * n].reshape(-1, 3)
        sound = (indices >= 0) & (indices < n_vertices) & np.isfinite(moves).all(axis=1)
        rows = np.zeros((n_vertices, 3))
        rows[indices[sound]] = moves[sound]
        return Morph.of_rows(rows)

    @property
    def percent(self) -> float:
        """What the file sets the channel to."""
        if self.channel is None:
            return 0.0
        values = self.channel.properties.get(PERCENT) or self.channel.node.numbers(PERCENT).tolist()
        value = next(iter(values), 0.0)
        return float(value) if isinstance(value, int | float) and abs(value) < 1e9 else 0.0


def shape_weights(full: FloatArray, percents: FloatArray) -> FloatArray:
    """(n, k) weights of the k shapes of a channel at (n,) percentages.

    Between the weights of two neighbors, one of which may be no shape at all, they share it; beyond
    the last two, the line through them goes on.
    """
    knots, own = np.unique([0.0, *full], return_inverse=True)
    weights = percents / 100.0
    at = np.clip(np.searchsorted(knots, weights, side="right") - 1, 0, len(knots) - 2)
    share = (weights - knots[at]) / (knots[at + 1] - knots[at])
    rows, numbers = np.zeros((len(weights), len(knots))), np.arange(len(weights))
    rows[numbers, at], rows[numbers, at + 1] = 1.0 - share, share
    return rows[:, own[1:]]


def full_weights(channel: FbxObject, n: int) -> FloatArray:
    """(n,) weights at which a channel shows each of its shapes alone."""
    found = channel.node.numbers("FullWeights").astype(np.float64) / 100.0
    steps = np.diff(np.sort([0.0, *found]))  # NaN comes last, and is a step that is not larger
    is_sound = len(found) == n and steps.min() > _LEAST_STEP and np.abs(found).max() < 1e6
    return found if is_sound else np.arange(1, n + 1) / n


def _powers(values: FloatArray, exponents: float | FloatArray) -> FloatArray:
    """Powers of absolute values, with the signs of the values unless the exponent is 0."""
    exponents = np.asarray(exponents)
    sizes = pm.power(np.abs(values), exponents)
    powers = np.where(exponents < 1.0, np.where(values < 0.0, -sizes, sizes), values)
    return np.asarray(np.where(exponents > 0.0, powers, 1.0))


def _between(one: FloatArray, other: FloatArray, share: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations on the shortest way from one to the other, by (n, 1) shares."""
    a, b = (_quaternions(matrices) for matrices in (one, other))
    cos = (a * b).sum(axis=1, keepdims=True)
    b = np.where(cos < 0.0, -b, b)
    cos = np.minimum(np.abs(cos), 1.0)
    sin = np.sqrt(1.0 - cos * cos)
    angle = pm.arctan2(sin, cos)
    is_near = sin < 1e-9  # then the way is straight up to rounding
    divisor = np.where(is_near, 1.0, sin)
    left = np.where(is_near, 1.0 - share, pm.sin((1.0 - share) * angle) / divisor)
    right = np.where(is_near, share, pm.sin(share * angle) / divisor)
    return rotation_matrices(left * a + right * b)


def _quaternions(matrices: FloatArray) -> FloatArray:
    placed = np.tile(np.eye(4), (len(matrices), 1, 1))
    placed[:, :3, :3] = matrices
    return decomposed(placed)[1]


def _euler_angles(matrices: FloatArray) -> FloatArray:
    """(n, 3) angles in degrees of (n, 3, 3) rotations about x, y and z, one after the other."""
    m = matrices
    cos = np.sqrt(m[:, 0, 0] ** 2 + m[:, 1, 0] ** 2)
    is_locked = cos < 1e-9  # x and z turn about the same axis: z does not turn
    x = np.where(is_locked, pm.arctan2(-m[:, 1, 2], m[:, 1, 1]), pm.arctan2(m[:, 2, 1], m[:, 2, 2]))
    z = np.where(is_locked, 0.0, pm.arctan2(m[:, 1, 0], m[:, 0, 0]))
    angles: FloatArray = np.stack([x, pm.arctan2(-m[:, 2, 0], cos), z], axis=1)
    return np.degrees(angles)
