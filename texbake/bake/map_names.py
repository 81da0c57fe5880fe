"""The names of the maps that a bake can make, without loading what makes them."""

MAP_NAMES = ("normal", "displacement", "vector-displacement")
