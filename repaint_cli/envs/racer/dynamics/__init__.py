"""What moves, and by which rules: the car, the bots, encounters, ends of episodes."""
