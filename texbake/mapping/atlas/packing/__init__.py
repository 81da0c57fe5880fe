"""Packing charts into textures, as large as they fit."""
