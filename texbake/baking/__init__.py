"""Baking: the detail of a high-poly mesh, and its lighting, into maps of a low-poly mesh."""
