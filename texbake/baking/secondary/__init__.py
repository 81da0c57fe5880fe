"""Rays from the points that were hit: ambient occlusion, bent normals and thickness."""
