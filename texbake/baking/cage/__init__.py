"""A cage measured from two meshes: around the dense surface, no farther out than it must."""
