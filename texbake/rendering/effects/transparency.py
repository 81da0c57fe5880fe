"""Order-independent transparency by depth peeling.

Layers are peeled from front to back, at most `MAX_LAYERS`, each by rasterizing again behind the
previous one. At each sample the light of a layer is weighted by its opacity and by what the layers
in front of it let through. Objects may intersect one another and themselves.

With `alpha_mode` `mask`, a point is opaque if its opacity is at least the cutoff, and otherwise
absent.

Based on: Porter and Duff, "Compositing digital images", SIGGRAPH 1984; Everitt, "Interactive
order-independent transparency", 2001.

Kernel: `core/compositing.c`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import BoolArray, Float32Array, IntArray
from texbake.records import dataclass
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.images import look_up
from texbake.rendering.effects.slots import vertex_colors
from texbake.rendering.fragments import FragmentRows, Fragments
from texbake.rendering.passes import rasterize_samples, seen_objects
from texbake.rendering.rasterize import SKIP, VisibilityBuffer
from texbake.rendering.request import RenderRequest
from texbake.rendering.resolve import Sums
from texbake.rendering.results import Target

MAX_LAYERS = 16
# In front of the near plane, where the reversed depth is 1.
_BEFORE_ALL = 2.0
ShadeRows = Callable[..., tuple[FragmentRows, list[Fragments]]]


def _reasons(request: RenderRequest, index: int) -> Iterator[str]:
    material = request.material(index)
    if material.alpha_mode == "opaque":
        return
    if material.opacity is not None and material.opacity != 1.0:
        yield "its opacity is not 1 everywhere"
    if request.image_opacity(index) is not None:
        yield "the image of its base color has opacity"
    colors = request.scene.objects[index].mesh.colors
    if material.vertex_colors and colors is not None and colors.shape[1] == 4:
        yield "its vertex colors have opacity"


@dataclass(frozen=True, eq=False)
class LayeredSamples:
    """What layers composited from front to back show at samples; changed in place."""

    light: Float32Array  # (h, w, 3)
    passed: Float32Array  # (h, w): share of the light behind these layers that they let through
    normals: Float32Array | None  # (h, w, 3)
    seen: BoolArray  # (h, w)

    @classmethod
    def empty(cls, shape: tuple[int, int], *, keeps_normals: bool = False) -> LayeredSamples:
        """Return samples without any layer."""
        normals = np.zeros((*shape, 3), np.float32) if keeps_normals else None
        light, passed = np.zeros((*shape, 3), np.float32), np.ones(shape, np.float32)
        return cls(light, passed, normals, np.zeros(shape, np.bool_))

    def composite_under(
        self, state: RenderState, of_samples: IntArray, shaded: list[Fragments], *, opaque: bool
    ) -> None:
        """Composite a layer under those before; `of_samples` (h, w) int32 are its fragments."""
        if not shaded:
            return
        with state.costs.timed("transparency"):
            opacity = (
                np.ones(sum(map(len, shaded)), np.float32)
                if opaque
                else np.concatenate([opacity_of(fragments, state) for fragments in shaded])
            )
            core.put_layer_behind(
                of_samples,
                np.concatenate([fragments.light for fragments in shaded]),
                opacity,
                None if self.normals is None else np.concatenate(list(map(_normals_of, shaded))),
                self.light, self.passed, self.normals, self.seen,
            )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Layers:
    """Visibility of transparent objects in front of opaque ones, the nearest layer first."""

    layers: tuple[VisibilityBuffer, ...]
    opaque: VisibilityBuffer

    @property
    def n_bytes(self) -> int:
        """Memory of the layers."""
        return sum(layer.n_bytes for layer in self.layers)

    def compose(
        self, state: RenderState, sums: Sums, rows: tuple[int, int], shade_rows: ShadeRows
    ) -> None:
        """Shade all layers of some rows of pixels and add them to the sums."""
        side = state.options.supersampling
        shape = (rows[1] - rows[0]) * side, state.options.width * side
        samples = LayeredSamples.empty(shape, keeps_normals=len(sums.normals) > 0)
        for layer in (*self.layers, self.opaque):
            found, shaded = shade_rows(state, layer, rows, wants_samples=True)
            samples.composite_under(state, found.of_samples, shaded, opaque=layer is self.opaque)
        with state.costs.timed("pixels"):
            core.sum_samples(
                samples.light, samples.passed, samples.normals, samples.seen, rows[0], side,
                sums.color, sums.coverage, None if samples.normals is None else sums.normals,
            )  # fmt: skip


def opacity_of(fragments: Fragments, state: RenderState) -> Float32Array:
    """(n,): opacity of the slot, times the alpha of the base color's image and of vertex colors."""
    values = np.ones(len(fragments), np.float32)
    if fragments.values.opacity is not None:
        values = values * fragments.values.opacity[:, 0]
    if state.request.image_opacity(fragments.target) is not None:
        values = values * look_up(fragments, state, "base_color.opacity")[:, 0]
    colors = fragments.drawn.mesh.colors
    if fragments.drawn.material.vertex_colors and colors is not None and colors.shape[1] == 4:
        values = values * vertex_colors(fragments)[:, 3]
    values = np.clip(values, 0.0, 1.0)
    material = fragments.drawn.material
    if material.alpha_mode == "mask":
        values = (values >= material.alpha_cutoff).astype(np.float32)
    return np.ascontiguousarray(values, np.float32)


def _normals_of(fragments: Fragments) -> Float32Array:
    return fragments.normals if len(fragments.normals) else np.zeros_like(fragments.light)


def peel_layers(state: RenderState, target: Target) -> Layers:
    """Rasterize transparent objects, each layer behind the one before."""
    opaque = state.visible.visibility
    shape = opaque.face_ids.shape
    modes = state.visible.modes.copy()
    for index in range(len(modes)):
        if not state.plan.has("transparency", index):
            modes[index] = SKIP
    last = VisibilityBuffer(np.full(shape, -1, np.int32), np.full(shape, _BEFORE_ALL, np.float32))
    layers: list[VisibilityBuffer] = []
    while len(layers) < MAX_LAYERS:
        layer = rasterize_samples(state, modes, behind=last, before=opaque)
        if not (layer.face_ids >= 0).any():
            break
        layers.append(layer)
        last = layer
    return Layers(tuple(layers), opaque)


def _objects_in_layers(state: RenderState) -> frozenset[int]:
    layers = state.of(peel_layers).layers
    found = (seen_objects(layer, state.world, threads=state.threads) for layer in layers)
    return frozenset().union(*found)


LAYERS = Effect(
    name="layers",
    does="peels transparent surfaces from front to back",
    after="displacement",
    of="picture",
    left_out="nothing in the picture is transparent",
    prepare=peel_layers,
    finds_objects=_objects_in_layers,
)

TRANSPARENCY = Effect(
    name="transparency",
    does="blends transparent surfaces in order of depth",
    after="fog",
    reasons=_reasons,
    without=lambda scene: scene.with_materials(lambda each: replace(each, alpha_mode="opaque")),
    left_out="nothing in the picture is transparent",
    needs=("layers", "slots"),
)
