"""Adaptive samples of a bake: one ray per texel, and more only where neighboring samples disagree.

A bound on the error becomes samples in `samples`, a time becomes a bound in `budget`.
"""
