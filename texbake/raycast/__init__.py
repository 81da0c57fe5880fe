"""Rays against triangles, and what they hit."""
