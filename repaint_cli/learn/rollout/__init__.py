"""From environments to samples."""
