"""What a run looks like: statistics over seeds, curves, paths and films.

Everything here is given arrays and a path. It knows no run folder, no simulator and no network.
"""
