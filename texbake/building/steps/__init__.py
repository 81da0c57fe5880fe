"""All kinds of steps; a further kind is a `StepKind` in one of these modules and a line here."""

from __future__ import annotations

from texbake.building.steps.maps import BAKE, BAKE_TEXTURE
from texbake.building.steps.results import CHECK, EXPORT, PAGE, PREVIEW
from texbake.verbs.step import StepKind, find_step

# In the order in which a pipeline usually has them.
STEP_KINDS: dict[str, StepKind] = {
    kind.name: kind
    for kind in (
        *map(find_step, ("make", "repair", "transform", "remesh", "simplify", "unwrap")),
        CHECK,
        BAKE,
        BAKE_TEXTURE,
        *map(find_step, ("pack-textures", "pack-channels", "split-channels", "mipmap")),
        PREVIEW,
        PAGE,
        EXPORT,
    )
}
