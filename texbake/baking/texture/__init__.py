"""Textures baked onto a mesh: solid procedures evaluated in space, and projected photographs."""
