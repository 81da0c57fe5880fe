"""The environment at infinite distance, as background and as image-based light, and fog.

Fog fades light into its color with the distance from the camera. At the distance d the share
(end - d) / (end - start) of a surface's light remains for `linear` fog, exp(-density d) for `exp`,
and exp(-(density d)^2) for `exp2`. The background is infinitely far away and has faded completely,
so a scene with fog does not show its environment there.

Based on: Greene, "Environment mapping and other applications of world projections", 1986; Karis,
"Real Shading in Unreal Engine 4", 2013, for the split of the mirrored part in two.

Kernel: `core/surrounding_light.c`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.effect import Activation, Effect, Rejection, RenderState
from texbake.rendering.effects.ambient import arriving_share
from texbake.rendering.effects.shading_models import head_on, normals_effect
from texbake.rendering.fragments import Fragments, one_row
from texbake.rendering.maps import colors_from
from texbake.rendering.material_simplification import reflects_environment, scatters
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Target
from texbake.rendering.scene.lights import Environment
from texbake.rendering.studio import STUDIO_ROOM, studio_room
from texbake.texture.cube_map import CubeChain, CubeMap, from_latitude_longitude, sample_cube
from texbake.texture.image import FloatImage
from texbake.texture.prefilter import irradiance, specular_levels, split_sum_table

# Prefiltered environment: width in texels of a face of its sharpest level, and number of levels.
_SPECULAR_SIZE = 256
_LEVELS = 6
# Rows of pixels per band.
_ROWS = 32
_FOG_MODES = {"linear": 0, "exp": 1, "exp2": 2}


@dataclass(frozen=True, eq=False)
class PlacedEnvironment:
    """A cube map with the rotation from world space to its own."""

    chain: CubeChain
    turn: FloatArray

    @property
    def n_bytes(self) -> int:
        """Memory of its texels."""
        return self.chain.texels.nbytes

    def look(self, directions: Float32Array, levels: Float32Array | None = None) -> Float32Array:
        """(n, 3) float32: light from directions (n, 3) in world space."""
        turned = directions
        if not np.array_equal(self.turn, np.eye(3)):
            turned = pm.matmul(directions, self.turn.T.astype(np.float32))
        turned = np.ascontiguousarray(turned)
        kind = "bilinear" if levels is None else "trilinear"
        return sample_cube(self.chain, turned, levels, filter=kind, threads=1)


def turn_of(environment: Environment, up: str) -> FloatArray:
    """(3, 3): rotation from world directions to those of the environment's image (+y up)."""
    radians = math.radians(environment.rotate)
    sine, cosine = pm.sin(radians), pm.cos(radians)
    about_up = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    if up == "y":
        return about_up
    from_z_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    turned: FloatArray = pm.matmul(about_up, from_z_up)
    return turned


def environment_map(state: RenderState, target: Target) -> PlacedEnvironment:
    """Return the environment as a cube map, times its intensity."""
    environment = state.scene.lighting.environment
    assert environment is not None
    cube = _cube(environment, state.threads)
    if environment.intensity != 1.0:
        cube = CubeMap(cube.faces * np.float32(environment.intensity))
    return PlacedEnvironment(CubeChain.of([cube]), turn_of(environment, state.options.up))


def _cube(environment: Environment, threads: int | None) -> CubeMap:
    if environment.faces:
        return CubeMap(np.stack([colors_from(face) for face in environment.faces]))
    if isinstance(environment.image, str) and environment.image == STUDIO_ROOM:
        return studio_room(environment.size)
    if environment.image is not None:
        pixels = colors_from(environment.image)
        size = min(environment.size, max(1, pixels.shape[1] // 4))
        return from_latitude_longitude(pixels, size=size, threads=threads)
    faces = np.empty((6, 1, 1, 3), np.float32)
    faces[...] = one_row(environment.color, 3)
    return CubeMap(faces)


def _background_activations(request: RenderRequest) -> Iterator[Activation | Rejection]:
    environment = request.scene.lighting.environment
    if environment is None:
        return
    if request.shows_buffer:
        yield Rejection("a buffer is shown", "the scene")
    elif request.scene.lighting.fog is not None and request.scene.lighting.fog.fades:
        yield Rejection("its fog hides what lies infinitely far", "the scene")
    elif not environment.background and request.depth == 0:  # mirrors show it all the same
        yield Rejection("its environment is not shown as the background", "the scene")
    else:
        yield Activation(None, "the scene", "it has an environment")


def _background_picture(state: RenderState, target: Target) -> FloatImage:
    """(H, W, 3): the environment at pixels not fully covered by a surface; 0 elsewhere."""
    height, width = state.options.height, state.options.width
    side = state.options.supersampling
    environment = state.of(environment_map)
    rays = state.camera.view_rays(width, height).astype(np.float32)
    behind = np.zeros((height, width, 3), np.float32)
    face_ids = state.visible.visibility.face_ids

    def work(start: int, stop: int) -> None:
        samples = face_ids[start * side : stop * side].reshape(stop - start, side, width, side)
        rows, columns = np.nonzero((samples < 0).any(axis=(1, 3)))
        places = np.stack([columns, rows + start], axis=1).astype(np.float32) + np.float32(0.5)
        directions = rays[0] + pm.matmul(places, rays[1:])
        behind[rows + start, columns] = environment.look(directions)

    run_bands(work, height, band=_ROWS, threads=state.threads)
    return behind


def _is_lit(request: RenderRequest, index: int) -> bool:
    environment = request.scene.lighting.environment
    lights = environment is not None and environment.lighting
    return lights and reflects_environment(request.material(index))


def _maps_for_lighting(request: RenderRequest, target: int) -> Iterator[str]:
    if scatters(request.material(target)):
        yield "irradiance"
    if request.material(target).shading == "metallic-roughness":
        yield from ("view directions", "prefiltered environment")


def _irradiance_map(state: RenderState, target: Target) -> PlacedEnvironment:
    environment = state.of(environment_map)
    diffuse = irradiance(environment.chain.level(0), threads=state.threads)
    return PlacedEnvironment(CubeChain.of([diffuse]), environment.turn)


def _prefiltered_map(state: RenderState, target: Target) -> PlacedEnvironment:
    """Prefilter the environment; level i is for the roughness i / (levels - 1)."""
    environment = state.of(environment_map)
    size = min(_SPECULAR_SIZE, environment.chain.size)
    chain = specular_levels(
        environment.chain.level(0), n_levels=_LEVELS, size=size, threads=state.threads
    )
    return PlacedEnvironment(chain, environment.turn)


_ZERO = np.zeros((1, 1), np.float32)
_NO_TABLE = np.zeros((1, 1, 2), np.float32)


def _or_zero(values: Float32Array | None) -> Float32Array:
    return _ZERO if values is None else values


def _light(fragments: Fragments, state: RenderState) -> None:
    values, normals, to_eye = fragments.values, fragments.normals, fragments.to_eye
    diffuse = np.zeros_like(normals)
    if scatters(fragments.drawn.material):
        diffuse = state.of(_irradiance_map).look(normals)
    mirrored, table = np.empty((0, 3), np.float32), _NO_TABLE
    if fragments.drawn.material.shading == "metallic-roughness":
        directions = np.empty_like(normals)
        core.mirror_directions(normals, to_eye, directions)
        assert values.roughness is not None
        levels = np.broadcast_to(values.roughness[:, 0] * (_LEVELS - 1), len(normals))
        mirrored = state.of(_prefiltered_map).look(
            directions, np.ascontiguousarray(levels, np.float32)
        )
        table = split_sum_table()
    core.reflect_environment(
        normals, to_eye if len(to_eye) else normals, diffuse, mirrored, table,
        values.base_color, _or_zero(values.roughness), _or_zero(values.metalness),
        head_on(fragments.drawn.material.ior), arriving_share(fragments), fragments.light,
    )  # fmt: skip


ENVIRONMENT = Effect(
    name="environment",
    does="makes a cube map of the environment",
    after="shadow maps",
    of="picture",
    left_out="the scene has no environment, or nothing shows it",
    load=environment_map,
)

BACKGROUND = Effect(
    name="background",
    does="shows the environment behind surfaces",
    after="fog behind",
    of="picture",
    activations=_background_activations,
    without=lambda scene: scene.with_environment(background=False),
    left_out="the scene has no environment",
    needs=("environment",),
    prepare=_background_picture,
    behind=lambda state: state.of(_background_picture),
)

IRRADIANCE = Effect(
    name="irradiance",
    does="integrates the environment's light for each normal",
    after="background",
    of="picture",
    left_out="no environment lights a visible surface that is not pure metal",
    needs=("environment",),
    load=_irradiance_map,
)

PREFILTERED_ENVIRONMENT = Effect(
    name="prefiltered environment",
    does="blurs the environment for each roughness",
    after="irradiance",
    of="picture",
    left_out="no environment lights a metallic-roughness surface in the picture",
    needs=("environment",),
    load=_prefiltered_map,
)

# Results of scenes with an environment in common that are the same in all of them.
OF_ENVIRONMENT = (environment_map, _irradiance_map, _prefiltered_map)

ENVIRONMENT_LIGHT = Effect(
    name="environment light",
    does="adds the light of the environment",
    after="light map",
    among="lit",
    when=_is_lit,
    why="the environment lights the scene",
    without=lambda scene: scene.with_environment(lighting=False),
    left_out="no environment lights a surface in the picture",
    needs=("slots", normals_effect, _maps_for_lighting),
    shade=_light,
    rate="vertex",
)


def _fog_activations(request: RenderRequest) -> Iterator[Activation | Rejection]:
    fog = request.scene.lighting.fog
    if fog is not None and not fog.fades:
        yield Rejection("its fog has no density", "the scene")
    elif fog is not None:
        for index in request.shaded:
            yield Activation(index, request.name(index), "the scene has fog")


def _fog_hides(request: RenderRequest) -> Iterator[Activation]:
    fog = request.scene.lighting.fog
    if fog is not None and fog.fades and not request.shows_buffer:
        yield Activation(None, "the scene", "its fog hides what lies infinitely far")


def _fade(fragments: Fragments, state: RenderState) -> None:
    fog = state.scene.lighting.fog
    assert fog is not None
    core.fade_into_fog(
        fragments.positions, state.camera.eye, _FOG_MODES[fog.mode], float(fog.density),
        float(fog.start), float(fog.end), np.array(fog.color, np.float64), fragments.light,
    )  # fmt: skip


def _fog_color(state: RenderState) -> FloatImage:
    fog = state.scene.lighting.fog
    assert fog is not None
    return np.array(fog.color, np.float32)


FOG_BEHIND = Effect(
    name="fog behind",
    does="shows fog behind all surfaces",
    after="environment",
    of="picture",
    activations=_fog_hides,
    left_out="the scene has no fog",
    behind=_fog_color,
)

FOG = Effect(
    name="fog",
    does="fades light with distance",
    after="emission",
    activations=_fog_activations,
    left_out="the scene has no fog",
    needs=("positions",),
    without=lambda scene: scene.with_lighting(fog=None),
    shade=_fade,
    rate="pixel",
)
