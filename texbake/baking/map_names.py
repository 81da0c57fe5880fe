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
    "texture",
    "opacity",
    "ao",
    "bent-normal",
    "thickness",
)

# Maps for which rays are cast from every hit.
SECONDARY_MAPS = ("ao", "bent-normal", "thickness")
