"""A DeepRacer user's own `reward_function(params)`, run as it is. It is their code, and trusted.

Every copy of the environment has a copy of the module of its own, whose variables last from episode
to episode, and in a training from iteration to iteration.
"""

import re
import traceback
from inspect import Parameter, signature
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorWrapper

from repaint_cli import interruption
from repaint_cli.envs.racer.deepracer.memory import fingerprints
from repaint_cli.envs.reward_functions import Functions, UserFunction
from repaint_cli.errors import CardError, RewardFailed

TERM = "function"
"""The name of the reward term that it pays."""
LIMIT = 1e5
"""DeepRacer ends a job whose rewards are larger."""


KEYS_SHOWN = (
    "all_wheels_on_track", "is_offtrack", "is_crashed", "is_reversed", "is_left_of_center",
    "distance_from_center", "track_width", "progress", "speed", "steering_angle", "heading", "x",
    "y", "closest_waypoints", "closest_objects", "object_in_camera", "projection_distance",
    "track_length", "sim_time",
)  # fmt: skip
"""The keys of `params` whose values an error may show: those without long lists."""
MOST_SHOWN = 8
MODULE = "reward_function"
"""What DeepRacer calls the module, whatever the file is called."""


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else f"{value!s:.40}"


class RewardFunction(UserFunction):
    """A copy of a user's module and its function."""

    def __init__(self, name: str, source: str) -> None:
        """Run the module.

        Args:
            name: of the file, for messages.
            source: its text.

        Raises:
            CardError: the module does not run, or has no `reward_function(params)`.
        """
        self._name = name
        module: dict[str, Any] = {"__name__": MODULE, "__file__": name}
        try:
            exec(compile(source, name, "exec"), module)
        except (Exception, SystemExit) as error:
            raise CardError(self._describe(error)) from error
        finally:
            interruption.check()  # which their code may have swallowed
        function = module.get("reward_function")
        if not callable(function):
            raise CardError(f"{name}: expected def reward_function(params), found none")
        given = signature(function).parameters.values()
        places = [parameter for parameter in given if parameter.default is Parameter.empty]
        if len(places) != 1:
            raise CardError(
                f"{name}: expected reward_function(params), found one of {len(places)} "
                "arguments as before 2019; take what it needs from the dictionary params"
            )
        self._function, self._module = function, module
        self._at_first = fingerprints(module, MODULE)
        self._keys = [name for name in KEYS_SHOWN if re.search(rf"['\"]{name}['\"]", source)]
        self._line = getattr(getattr(function, "__code__", None), "co_firstlineno", 1)

    def __call__(self, params: dict[str, Any], row: int | str) -> float:
        """Return what it pays for a step of environment `row`, or of what a name says.

        Raises:
            RewardFailed: the function failed, or paid something that is no number within ±100,000.
        """
        try:
            paid = self._function(params)
        except (Exception, SystemExit) as error:
            raise RewardFailed(self._describe(error), self._moment(params, row)) from error
        finally:
            interruption.check()
        try:
            number = float(paid)
        except (TypeError, ValueError):
            number = np.nan
        if not abs(number) <= LIMIT:  # nan too
            problem = "expected a reward within ±100,000 from reward_function, found"
            place = f"{self._name}:{self._line}: {problem} {paid!r:.100}"
            raise RewardFailed(place, self._moment(params, row))
        return number

    def remembers(self) -> list[str]:
        """Return the names of the module's variables that have changed; see `UserFunction`."""
        now = fingerprints(self._module, MODULE)
        return sorted(name for name in now if now[name] != self._at_first.get(name))

    def _moment(self, params: dict[str, Any], row: int | str) -> str:
        """Return the step, and what `params` held of it in the keys that the function names."""
        values = [f"{name} = {_short(params.get(name))}" for name in self._keys]
        whose = row if isinstance(row, str) else f"environment {row}"
        return ", ".join(
            [f"at step {_short(params.get('steps'))} of {whose}", *values[:MOST_SHOWN]]
        )

    def _describe(self, error: BaseException) -> str:
        """Return file, line, kind and message of what went wrong in the user's file."""
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == self._name]
        line = error.lineno if isinstance(error, SyntaxError) else (lines[-1] if lines else None)
        reason = (str(error) or type(error).__name__).splitlines()[0]
        return f"{self._name}:{line}: {type(error).__name__}: {reason}"


class RewardFile(VectorWrapper):
    """Adds what the user's function pays to the infos, as the reward term "function"."""

    def __init__(
        self, env: Any, name: str, source: str, functions: Functions | None = None
    ) -> None:
        """Run the module once per environment that has no function yet; see `RewardFunction`."""
        super().__init__(env)
        self._racer, self._functions = env, [] if functions is None else functions
        while len(self._functions) < env.num_envs:
            self._functions.append(RewardFunction(name, source))
        self._ended = np.zeros(env.num_envs, bool)
        self._parks = env.metadata["autoreset_mode"] is AutoresetMode.DISABLED

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        """Start every environment afresh; cars that park from the beginning are paid nothing."""
        self._ended[:] = (kwargs.get("options") or {}).get("parked", False)
        return self.env.reset(**kwargs)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Drive every car for a step, and let the function pay it.

        Raises:
            RewardFailed: the function failed, or paid something that is no number within ±100,000.
        """
        obs, reward, terminated, truncated, info = self.env.step(actions)
        paid = np.zeros(self.num_envs)
        for row in np.flatnonzero(~self._ended).tolist():
            paid[row] = self._functions[row](self._racer.params(row), row)
        over = terminated | truncated
        self._ended = self._ended | over if self._parks else over
        return obs, reward, terminated, truncated, info | {TERM: paid}
