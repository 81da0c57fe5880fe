"""Rasterization: which triangle each sample of the picture sees, and the fragments to shade."""
