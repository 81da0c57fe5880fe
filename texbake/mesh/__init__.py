"""Meshes: the data structure, file formats, parametric surfaces, simplification and repair."""
