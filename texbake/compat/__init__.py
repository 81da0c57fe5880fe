"""Modules with the API of other libraries, so that a program only changes one import."""
