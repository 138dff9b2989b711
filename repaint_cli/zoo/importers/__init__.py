"""Policies from elsewhere become teachers: their files are read as data, none is run."""
