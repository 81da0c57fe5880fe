"""A mesh to pieces laid flat, each a chart."""
