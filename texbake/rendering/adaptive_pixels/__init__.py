"""Adaptive samples of a picture: few per pixel, and more only where they disagree.

A bound on the error becomes samples in `samples`, a time becomes a bound in `budget`.
"""
