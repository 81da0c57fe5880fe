"""Cutting a mesh into flat charts."""
