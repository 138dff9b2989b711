"""Experiments: what is trained, at which scale, and what is drawn and tabled of it."""
