"""Steps of `remesh`: distances in a grid, what is outside, the surface, and its vertices."""
