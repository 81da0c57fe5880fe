"""The names of the maps that a bake can make, without loading what makes them."""

MAP_NAMES = (
    "normal",
    "displacement",
    "vector-displacement",
    "position",
    "world-position",
    "curvature",
    "convexity",
    "concavity",
    "object-id",
    "material-id",
    "vertex-color",
    "base-color",
    "alpha",
    "metallic",
    "roughness",
    "occlusion",
    "emissive",
    "clearcoat",
    "clearcoat-roughness",
    "transmission",
    "sheen-color",
    "sheen-roughness",
    "specular",
    "specular-color",
    "opacity",
    "ao",
    "bent-normal",
    "thickness",
)

# Maps made from the materials of the high-poly mesh.
MATERIAL_MAPS = (
    "material-id",
    *MAP_NAMES[MAP_NAMES.index("base-color") : MAP_NAMES.index("opacity")],
)
