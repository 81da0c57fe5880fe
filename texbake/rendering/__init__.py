"""A mesh to a picture."""
