"""The list of all effects, in the order in which they are computed.

To add an effect, write its functions and one `Effect` (`texbake.rendering.effect`) in the module of
its subject here, or in a new one, and put it into `EFFECTS` after the effects that it needs.
"""

from __future__ import annotations

from texbake.rendering.effect import Effect
from texbake.rendering.effects import (
    ambient,
    buffers,
    bump,
    environment,
    images,
    lights,
    mirrors,
    normals,
    parallax,
    points,
    projectors,
    shading_models,
    shadows,
    slots,
    surfaces,
    transparency,
)

EFFECTS: tuple[Effect, ...] = (
    # Place the surfaces. Visibility is computed after these.
    surfaces.PLACING,
    points.MAPPING,
    surfaces.DISPLACEMENT,
    # Resources that are loaded once per scene or prepared once per picture.
    transparency.LAYERS,
    ambient.OCCLUSION_PICTURE,
    lights.LIGHTS,
    projectors.LIGHT_PROFILES,
    shadows.SHADOW_MAPS,
    environment.ENVIRONMENT,
    environment.FOG_BEHIND,
    environment.BACKGROUND,
    environment.IRRADIANCE,
    environment.PREFILTERED_ENVIRONMENT,
    mirrors.RENDERED_ENVIRONMENT,
    # Geometry of the fragments.
    points.POSITIONS,
    shadows.SHADOWS,
    points.VIEW_DIRECTIONS,
    points.DERIVATIVES,
    points.TEXTURE_COORDINATES,
    points.FURTHER_COORDINATES,
    images.IMAGES,
    images.MIP_MAPS,
    slots.PROCEDURES,
    normals.VERTEX_NORMALS,
    parallax.PARALLAX,
    # Material values.
    slots.SLOTS,
    projectors.PROJECTED_TEXTURES,
    normals.NORMALS,
    normals.TANGENTS,
    normals.NORMAL_MAP,
    bump.BUMP_MAP,
    # Reflected and emitted light.
    shading_models.UNLIT,
    ambient.AMBIENT_OCCLUSION,
    ambient.AMBIENT,
    shading_models.LAMBERT,
    shading_models.BLINN_PHONG,
    shading_models.METALLIC_ROUGHNESS,
    bump.EMBOSS,
    ambient.LIGHT_MAP,
    environment.ENVIRONMENT_LIGHT,
    shading_models.VERTEX_LIGHT,
    mirrors.REFRACTION,
    mirrors.REFLECTION,
    ambient.EMISSION,
    environment.FOG,
    transparency.TRANSPARENCY,
    # Shows a buffer instead of a shaded picture.
    buffers.BUFFER,
)
