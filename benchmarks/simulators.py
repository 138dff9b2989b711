"""Environment steps per second: the racer, Reacher and Ant, beside Gymnasium's own and CarRacing.

    python benchmarks/simulators.py

The racer at full size (120 × 160 pixels an eye, 64 beams, four bots), with its pictures and
without, on one thread and on two; MuJoCo tasks through EnvPool beside Gymnasium's own vector
environment; CarRacing-v3, which draws 96 × 96 pixels. Actions are random. Logs of DeepRacer's own
simulator have 8 to 10 steps a second.
"""

from collections.abc import Callable, Iterator
from functools import partial
from time import perf_counter
from typing import Any
from unittest.mock import patch

from turns import Measurements, Table, median, run, span

KINDS: dict[str, dict[str, Any]] = {
    "one car, one camera": {"track": "reinvent-like"},
    "four bots, two cameras, lidar": {"track": "wide-loop", "sensors": "stereo+lidar", "n_bots": 4},
}
SIZES = (1, 8, 64, 256)
HOW = ("", ", two threads", ", no pictures")
BACKENDS = ("envpool", "gymnasium")
IDS = ("Reacher-v5", "Ant-v5")
DEEPRACER = 10.0
"""Steps per second within an iteration of DeepRacer-on-AWS, by its logs of 2026."""


def steps_per_second(env: Any, seconds: float = 1.0) -> float:
    """Act at random for some seconds; return steps per second over all copies."""
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(100)]
    env.reset(seed=0)
    for action in actions[:3]:  # compiles, and warms the caches
        env.step(action)
    steps, started = 0, perf_counter()
    while perf_counter() - started < seconds:
        env.step(actions[steps // env.num_envs % len(actions)])
        steps += env.num_envs
    return steps / (perf_counter() - started)


def racer(kind: str, cars: int, threads: int, draws: bool) -> float:
    """Measure the racer."""
    from repaint_cli.envs.racer.gym_env import make_cars

    env = make_cars(cars, threads=threads, **KINDS[kind])
    if draws:
        return steps_per_second(env)
    obs, _ = env.reset(seed=0)
    readings = obs if isinstance(obs, dict) else {"camera": obs}
    with patch.object(env._sensors, "read", lambda *_: readings):
        return steps_per_second(env)


def mujoco(env_id: str, copies: int, backend: str) -> float:
    """Measure a MuJoCo task, through EnvPool or through Gymnasium."""
    from repaint_cli.envs.gymnasium.vector import make_gym

    return steps_per_second(make_gym(env_id, copies, {}, backend))


def car_racing() -> float:
    """Measure Gymnasium's CarRacing-v3, one copy."""
    import gymnasium

    return steps_per_second(
        gymnasium.make_vec("CarRacing-v3", num_envs=1, vectorization_mode="sync")
    )


def sides() -> dict[str, Callable[[], float]]:
    """Return what measures each side, by name."""
    named: dict[str, Callable[[], float]] = {}
    for kind in KINDS:
        for n in SIZES:
            named[f"{kind}: {n}"] = partial(racer, kind, n, 1, True)
        named[f"{kind}: 64{HOW[1]}"] = partial(racer, kind, 64, 2, True)
        named[f"{kind}: 64{HOW[2]}"] = partial(racer, kind, 64, 1, False)
    for env_id in IDS:
        for n in SIZES[:-1]:
            for backend in BACKENDS:
                named[f"{env_id}: {n}, {backend}"] = partial(mujoco, env_id, n, backend)
    return named | {"CarRacing-v3": car_racing}


SIDES = sides()


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield the racer beside CarRacing, what threads and pictures make, and MuJoCo."""
    rows = []
    for side, rates in measured.items():
        if not side.startswith(IDS):
            ratio = span(rates / measured["CarRacing-v3"], ".1f")
            rows.append((side, median(rates, ",.0f"), ratio, median(rates / DEEPRACER, ",.0f")))
    yield Table(("cars", "steps/s", ": CarRacing", ": DeepRacer"), rows)
    rows = []
    for kind in KINDS:
        one, two, blind = (measured[f"{kind}: 64{how}"] for how in HOW)
        rows.append((kind, span(two / one, ".2f"), span(1 - one / blind, ".0%")))
    yield Table(("64 cars", "two threads : one", "time for pictures"), rows)
    rows = []
    for env_id in IDS:
        for n in SIZES[:-1]:
            envpool, gymnasium = (measured[f"{env_id}: {n}, {backend}"] for backend in BACKENDS)
            rates = (median(envpool, ",.0f"), median(gymnasium, ",.0f"))
            rows.append((f"{env_id}: {n}", *rates, span(envpool / gymnasium, ".1f")))
    yield Table(("copies, steps/s", *BACKENDS, "ratio"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
