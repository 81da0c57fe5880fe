"""What accuracy costs in time: every setting measured against a truth, on one's own meshes."""
