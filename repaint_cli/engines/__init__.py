"""Engines: what carries out the plans of many runs, in processes here or on a cluster."""
