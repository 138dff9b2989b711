"""Tracks: their geometry, their files, a map."""
