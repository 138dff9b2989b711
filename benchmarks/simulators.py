"""Environment steps per second of the racer, alone and among bots, with one thread and with two.

    python benchmarks/simulators.py

Everything at full size: 120 × 160 pixels an eye, 64 beams, four bots. The settings take turns, so
that what slows the machine slows all of them; a ratio is of neighbours in time.
"""

import argparse
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

from repaint_cli.envs.racer import RacerVectorEnv
from repaint_cli.simulators import load_track

CARS = 64
KINDS = {
    "one car, one camera": {"track": "reinvent-like"},
    "four bots, two cameras, lidar": {"track": "wide-loop", "sensors": "stereo+lidar", "n_bots": 4},
}


def steps_per_second(kind: str, threads: int, steps: int) -> float:
    """Drive 64 cars at random for some steps; return steps per second over all of them."""
    settings = dict(KINDS[kind])
    track = load_track(str(settings.pop("track")))
    env = RacerVectorEnv(track, CARS, threads=threads, **settings)  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    for _ in range(5):  # compiles, and warms the caches
        env.step(rng.integers(10, size=CARS))
    started = perf_counter()
    for _ in range(steps):
        env.step(rng.integers(10, size=CARS))
    seconds = perf_counter() - started
    env.close()
    return CARS * steps / seconds


def main() -> None:
    """Measure in rounds, and print medians and ranges."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=150)
    chosen = parser.parse_args()
    found: dict[tuple[str, int], list[float]] = {(k, t): [] for k in KINDS for t in (1, 2)}
    for _ in range(chosen.rounds):
        for (kind, threads), rates in found.items():
            rates.append(steps_per_second(kind, threads, chosen.steps))
    table = Table("", "1 thread, steps/s", "2 threads, steps/s", "2 : 1", box=None)
    for kind in KINDS:
        one, two = (np.array(found[kind, threads]) for threads in (1, 2))
        table.add_row(kind, _span(one, ",.0f"), _span(two, ",.0f"), _span(two / one, ".2f"))
    Console().print(table)
    print(f"{CARS} cars, {chosen.rounds} rounds of {chosen.steps} steps: median [range]")


def _span(numbers: np.ndarray, digits: str) -> str:
    low, middle, high = (format(float(q), digits) for q in np.quantile(numbers, (0, 0.5, 1)))
    return f"{middle} [{low}, {high}]"


if __name__ == "__main__":
    main()
