"""One module a kind of step, and one list of them; a further kind is a module and a line here."""

from __future__ import annotations

from texbake.building.step import StepKind
from texbake.building.steps.bake import BAKE
from texbake.building.steps.bake_texture import BAKE_TEXTURE
from texbake.building.steps.check import CHECK
from texbake.building.steps.export import EXPORT
from texbake.building.steps.make import MAKE
from texbake.building.steps.mipmap import MIPMAP
from texbake.building.steps.pack_textures import PACK_TEXTURES
from texbake.building.steps.page import PAGE
from texbake.building.steps.preview import PREVIEW
from texbake.building.steps.repair import REPAIR
from texbake.building.steps.simplify import SIMPLIFY
from texbake.building.steps.unwrap import UNWRAP

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
