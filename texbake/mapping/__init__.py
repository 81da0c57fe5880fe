"""A mesh to the same mesh with texture coordinates."""
