"""What acts: networks, distributions over actions, what goes into and out of them."""
