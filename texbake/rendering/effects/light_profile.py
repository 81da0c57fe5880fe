"""Light profiles: slides in spots, whose light is multiplied by the picture.

The slide is the square around the spot's outer cone, upright along the light's `up`; a point is
looked up at (s/q, t/q). Behind the spot and outside the square there is no light.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992, for the projection.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from texbake.mesh.mesh import FloatArray
from texbake.rendering.effect import (
    Call,
    Effect,
    Refusal,
    RenderState,
    Result,
    Target,
)
from texbake.rendering.effects.images import LoadedImage
from texbake.rendering.effects.lights import PLACED_LIGHTS, PlacedLight, shining
from texbake.rendering.effects.projection import load_slide, pixel_steps, thrown
from texbake.rendering.fragments import Floats, Fragments, Incident
from texbake.rendering.maps import colors_from
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.projecting import projector_matrix
from texbake.rendering.scene.textures import FILTERS_WITH_FOOTPRINT


@dataclass(frozen=True, eq=False)
class Slide:
    """The picture in a spot; `matrix` (4, 4) takes world space to (s, t, r, q)."""

    image: LoadedImage
    matrix: FloatArray

    @property
    def n_bytes(self) -> int:
        """Memory of its texels."""
        return self.image.n_bytes


def _called_for(request: RenderRequest) -> Iterator[Call | Refusal]:
    for index, light in enumerate(request.scene.lighting.lights):
        if light.profile is None:
            continue
        name = f'light "{light.name}"'
        if light.kind != "spot":
            yield Refusal(name, f"only a spot holds a slide, and it is {light.kind}")
        elif index not in shining(request):
            yield Refusal(name, "it is dark")
        elif not request.lit:
            yield Refusal(name, "no object in the picture is lit")
        else:
            yield Call(index, name, "it has a slide")


def _load(state: RenderState, target: Target) -> LoadedImage:
    assert target is not None
    light = state.lights[target]
    assert light.profile is not None
    return _image_of(light, state.request.filter_of(light.profile), state.threads)


def _image_of(light: Light, filter_name: str, threads: int | None) -> LoadedImage:
    assert light.profile is not None
    pixels = colors_from(light.profile.image, color=light.profile.color is not False)
    name = f"{light.name}.profile"
    return load_slide(light.profile, pixels, filter_name=filter_name, name=name, threads=threads)


def slide_of(light: Light, placed: PlacedLight, image: LoadedImage | None = None) -> Slide:
    """Return the slide of a spot that stands somewhere; its image is read where it is not given."""
    if image is None:
        image = _image_of(light, "bilinear", None)
    place, ahead = placed.position, placed.position + placed.direction
    matrix = projector_matrix(
        position=(place[0], place[1], place[2]),
        target=(ahead[0], ahead[1], ahead[2]),
        up=tuple(placed.axes[1]),
        fov=light.angle,
    )
    return Slide(image, matrix)


def slide_colors(slide: Slide, points: FloatArray, steps: FloatArray | None = None) -> Floats:
    """(n, 3) float32: what the light that reaches points is multiplied by.

    `steps` are those of `texbake.rendering.effects.projection.pixel_steps`, where they are pixels'.
    """
    colors, coverage = thrown(slide.image, slide.matrix, points, steps)
    return colors * coverage[:, None]


def _prepare(state: RenderState, target: Target) -> Slide:
    assert target is not None
    light, placed = state.lights[target], state.of(PLACED_LIGHTS, target)
    return slide_of(light, placed, state.of(SLIDE_IMAGES, target))


def _dim(fragments: Fragments, state: RenderState, index: int, incident: Incident) -> None:
    slide = state.of(SLIDES, index)
    assert fragments.positions is not None
    steps = None
    if slide.image.filter in FILTERS_WITH_FOOTPRINT:
        steps = pixel_steps(fragments, state)
    incident.radiance = incident.radiance * slide_colors(slide, fragments.positions, steps)


SLIDE_IMAGES = Result(_load)

SLIDES = Result(_prepare)

LIGHT_PROFILES = Effect(
    name="light profiles",
    does="puts slides into spots",
    of="light",
    called_for=_called_for,
    left_out="no light has a slide",
    needs=lambda request, target: ("lights",),
    load=SLIDE_IMAGES,
    prepare=SLIDES,
    dim=_dim,
)
