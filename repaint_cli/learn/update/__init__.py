"""From samples to better networks."""
