"""One module a kind of step, and one list of them; a further kind is a module and a line here."""

from __future__ import annotations

from texbake.pipeline.building.step import StepKind
from texbake.pipeline.building.steps.bake import BAKE
from texbake.pipeline.building.steps.bake_texture import BAKE_TEXTURE
from texbake.pipeline.building.steps.check import CHECK
from texbake.pipeline.building.steps.export import EXPORT
from texbake.pipeline.building.steps.make import MAKE
from texbake.pipeline.building.steps.mipmap import MIPMAP
from texbake.pipeline.building.steps.pack_textures import PACK_TEXTURES
from texbake.pipeline.building.steps.page import PAGE
from texbake.pipeline.building.steps.preview import PREVIEW
from texbake.pipeline.building.steps.repair import REPAIR
from texbake.pipeline.building.steps.simplify import SIMPLIFY
from texbake.pipeline.building.steps.unwrap import UNWRAP

# In the order in which a job uses them.
STEP_KINDS: dict[str, StepKind] = {
    kind.name: kind
    for kind in (
        MAKE,
        REPAIR,
        SIMPLIFY,
        UNWRAP,
        CHECK,
        BAKE,
        BAKE_TEXTURE,
        PACK_TEXTURES,
        MIPMAP,
        PREVIEW,
        PAGE,
        EXPORT,
    )
}
