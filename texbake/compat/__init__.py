"""Modules with the names of other libraries, so that a program changes one import."""
