"""Scenes: camera, lights, environment, objects and materials, as plain values."""
