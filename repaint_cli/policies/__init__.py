"""Policies: networks, distributions over actions, their inputs and outputs."""
