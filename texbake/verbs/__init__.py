"""Verbs: one module each, which declares a command and a step around the function that does it."""
