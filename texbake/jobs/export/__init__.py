"""Asset folders for other programs: the mesh, maps as each reads them, and what to set where."""
