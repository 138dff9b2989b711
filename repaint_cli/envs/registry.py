"""Which simulators there are: a new one is a line here and a folder beside this file."""

from collections.abc import Iterator
from importlib import import_module

from repaint_cli.envs.simulator import Simulator

REGISTRY = {
    "gymnasium": "repaint_cli.envs.gymnasium.simulator:GymnasiumSimulator",
    "racer": "repaint_cli.envs.racer.simulator:RacerSimulator",
    "starcraft": "repaint_cli.envs.starcraft.simulator:StarCraftSimulator",
}
"""The class of each simulator by its name in a card, as module:class; imported when needed."""


def simulator_class(name: object) -> type[Simulator]:
    """Return the class of a simulator by its name in a card, which may hold anything.

    Raises:
        ValueError: no simulator has this name.
    """
    if not isinstance(name, str) or name not in REGISTRY:
        raise ValueError(f"expected simulator to be one of {', '.join(map(repr, REGISTRY))}")
    module, _, kind = REGISTRY[name].partition(":")
    simulator: type[Simulator] = getattr(import_module(module), kind)
    return simulator


def simulator_classes() -> Iterator[type[Simulator]]:
    """Yield the class of every simulator."""
    return map(simulator_class, REGISTRY)
