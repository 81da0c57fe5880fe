"""All contrasts, in the order of the table in the documentation."""

from catalog.geometry_contrasts import GEOMETRY_CONTRASTS
from catalog.render_contrasts import RENDER_CONTRASTS
from catalog.texture_contrasts import TEXTURE_CONTRASTS

CONTRASTS = GEOMETRY_CONTRASTS + TEXTURE_CONTRASTS + RENDER_CONTRASTS
