"""A racing simulator in the likeness of DeepRacer: one car, one camera, any number of copies."""

from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.noise import Noise
from repaint_cli.envs.racer.rules import STATUS
from repaint_cli.envs.racer.track import Track

__all__ = ["STATUS", "Noise", "RacerVectorEnv", "Track"]
