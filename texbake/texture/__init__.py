"""Textures: image files, encoding, filtering, mip maps, cube maps and procedures."""
