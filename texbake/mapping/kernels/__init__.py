"""The compiled kernels of the mappings, one file for each algorithm, apart from what calls them."""
