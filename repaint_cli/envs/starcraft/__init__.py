"""StarCraft II's mini-games of the paper: a simulator of our own, and the game itself by PySC2."""
