"""Flattening charts with as little distortion as possible."""
