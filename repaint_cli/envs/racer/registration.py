"""The racer among Gymnasium's environments: `gymnasium.make("repaint/Racer-v0")`.

`import repaint_cli` registers it, in whatever order both are imported, and does not import
Gymnasium for that: it would take longer than everything else.
"""

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

ID = "repaint/Racer-v0"
MAX_EPISODE_STEPS = 1500
"""Steps of 1/15 s; the time limit of our tasks."""


def _register() -> None:
    import gymnasium

    if ID not in gymnasium.registry:
        gymnasium.register(
            ID,
            entry_point="repaint_cli.envs.racer.gym_env:RacerEnv",
            vector_entry_point="repaint_cli.envs.racer.gym_env:make_cars",
            max_episode_steps=MAX_EPISODE_STEPS,
        )


class _WhenImported:
    """Finds Gymnasium as all other finders do, and registers the racer once it is imported."""

    @classmethod
    def find_spec(
        cls, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to import Gymnasium; other modules are not found here."""
        if name != "gymnasium":
            return None
        others = (finder for finder in sys.meta_path if finder is not cls)
        specs = (finder.find_spec(name, path, target) for finder in others)
        spec = next(filter(None, specs), None)
        if spec and spec.loader:
            execute = spec.loader.exec_module

            def execute_and_register(module: ModuleType) -> None:
                execute(module)
                if cls in sys.meta_path:
                    sys.meta_path.remove(cls)
                    _register()

            spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec


if "gymnasium" in sys.modules:
    _register()
else:
    sys.meta_path.insert(0, _WhenImported)
