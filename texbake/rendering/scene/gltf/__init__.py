"""Scenes of glTF files: what their materials, lights and cameras are here."""
