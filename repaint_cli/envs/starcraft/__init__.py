"""StarCraft II: a small, fast model of its economy and fights."""
