"""A run: its plan, its folder, its training, its resumption."""
