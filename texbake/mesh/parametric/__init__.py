"""Surfaces made from (u, v), which they carry as their texture coordinates."""
