"""Loops over fragments, pixels and edges, compiled by numba; one file for each algorithm."""
