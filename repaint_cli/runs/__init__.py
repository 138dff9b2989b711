"""A run: what was decided, its folder, what it does, how it goes on."""
