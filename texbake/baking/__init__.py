"""A dense and a light mesh to maps."""
