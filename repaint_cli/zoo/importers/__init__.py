"""Policies of other libraries become teachers: their files are read as data, none is run."""
