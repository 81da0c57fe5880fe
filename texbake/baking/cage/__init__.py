"""Cages fitted to a pair of meshes: around the high-poly surface, no farther out than necessary."""
