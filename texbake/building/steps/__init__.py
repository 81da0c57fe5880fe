"""All kinds of steps; a further kind is a `StepKind` in one of these modules and a line here."""

from __future__ import annotations

from texbake.building.steps.channels import PACK_CHANNELS, SPLIT_CHANNELS
from texbake.building.steps.maps import BAKE, BAKE_TEXTURE, MIPMAP, PACK_TEXTURES
from texbake.building.steps.meshes import UNWRAP
from texbake.building.steps.results import CHECK, EXPORT, PAGE, PREVIEW
from texbake.verbs.step import StepKind, find_step

# In the order in which a pipeline usually has them.
STEP_KINDS: dict[str, StepKind] = {
    kind.name: kind
    for kind in (
        *map(find_step, ("make", "repair", "transform", "remesh", "simplify")),
        UNWRAP,
        CHECK,
        BAKE,
        BAKE_TEXTURE,
        PACK_TEXTURES,
        PACK_CHANNELS,
        SPLIT_CHANNELS,
        MIPMAP,
        PREVIEW,
        PAGE,
        EXPORT,
    )
}
