"""Adaptive sampling of a picture: few samples per pixel, and more where they disagree.

`samples` refines a picture until its estimated error is below a bound; `budget` chooses a bound
that fits into a time budget.
"""
