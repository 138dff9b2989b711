"""Figures and films: curves, paths, markers and videos, drawn from arrays.

Nothing here depends on a run folder, a simulator or a network.
"""
