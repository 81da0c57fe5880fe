"""Triangles to what the samples and pixels of a picture see of them."""
