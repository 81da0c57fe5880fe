"""Checks before a bake: they report what will go wrong."""
