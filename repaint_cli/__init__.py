"""REPAINT: train teacher policies, keep them in a zoo, transfer them to new tasks."""

__version__ = "0.2.0"
