"""The list of all effects, in the order in which they are computed.

To add an effect, write its functions and one `Effect` (`texbake.rendering.effect`) in the module of
its subject here, or in a new one, and put it into `EFFECTS` after the effects that it needs.
"""

from __future__ import annotations

from texbake.rendering.effect import Effect
from texbake.rendering.effects.ambient import (
    AMBIENT,
    AMBIENT_OCCLUSION,
    EMISSION,
    LIGHT_MAP,
    OCCLUSION_PICTURE,
)
from texbake.rendering.effects.buffers import BUFFER
from texbake.rendering.effects.bump import BUMP_MAP, EMBOSS
from texbake.rendering.effects.environment import (
    BACKGROUND,
    ENVIRONMENT,
    ENVIRONMENT_LIGHT,
    FOG,
    FOG_BEHIND,
    IRRADIANCE,
    PREFILTERED_ENVIRONMENT,
)
from texbake.rendering.effects.images import IMAGES, MIP_MAPS
from texbake.rendering.effects.lights import LIGHTS
from texbake.rendering.effects.mirrors import REFLECTION, REFRACTION, RENDERED_ENVIRONMENT
from texbake.rendering.effects.normals import NORMAL_MAP, NORMALS, TANGENTS, VERTEX_NORMALS
from texbake.rendering.effects.parallax import PARALLAX
from texbake.rendering.effects.points import (
    DERIVATIVES,
    FURTHER_COORDINATES,
    MAPPING,
    POSITIONS,
    TEXTURE_COORDINATES,
    VIEW_DIRECTIONS,
)
from texbake.rendering.effects.projectors import LIGHT_PROFILES, PROJECTED_TEXTURES
from texbake.rendering.effects.shading_models import (
    BLINN_PHONG,
    LAMBERT,
    METALLIC_ROUGHNESS,
    UNLIT,
    VERTEX_LIGHT,
)
from texbake.rendering.effects.shadows import SHADOW_MAPS, SHADOWS
from texbake.rendering.effects.slots import PROCEDURES, SLOTS
from texbake.rendering.effects.surfaces import DISPLACEMENT, PLACING
from texbake.rendering.effects.transparency import LAYERS, TRANSPARENCY

EFFECTS: tuple[Effect, ...] = (
    # Place the surfaces. Visibility is computed after these.
    PLACING,
    MAPPING,
    DISPLACEMENT,
    # Resources that are loaded once per scene or prepared once per picture.
    LAYERS,
    OCCLUSION_PICTURE,
    LIGHTS,
    LIGHT_PROFILES,
    SHADOW_MAPS,
    ENVIRONMENT,
    FOG_BEHIND,
    BACKGROUND,
    IRRADIANCE,
    PREFILTERED_ENVIRONMENT,
    RENDERED_ENVIRONMENT,
    # Geometry of the fragments.
    POSITIONS,
    SHADOWS,
    VIEW_DIRECTIONS,
    DERIVATIVES,
    TEXTURE_COORDINATES,
    FURTHER_COORDINATES,
    IMAGES,
    MIP_MAPS,
    PROCEDURES,
    VERTEX_NORMALS,
    PARALLAX,
    # Material values.
    SLOTS,
    PROJECTED_TEXTURES,
    NORMALS,
    TANGENTS,
    NORMAL_MAP,
    BUMP_MAP,
    # Reflected and emitted light.
    UNLIT,
    AMBIENT_OCCLUSION,
    AMBIENT,
    LAMBERT,
    BLINN_PHONG,
    METALLIC_ROUGHNESS,
    EMBOSS,
    LIGHT_MAP,
    ENVIRONMENT_LIGHT,
    VERTEX_LIGHT,
    REFRACTION,
    REFLECTION,
    EMISSION,
    FOG,
    TRANSPARENCY,
    # Shows a buffer instead of a shaded picture.
    BUFFER,
)
