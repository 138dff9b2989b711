"""Teachers: one file each, with a card inside."""
