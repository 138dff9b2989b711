"""Check racing and learning on a GPU: are they as on the CPU, twice the same, and how fast?

    python tests/gpu/check.py FOLDER

It takes about four minutes and writes FOLDER/gpu.csv, whose rows name the card. Its exit code is 1
where the GPU and the CPU, or two runs, differ by more than they may.
"""

import argparse
import csv
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import learning
import numpy as np
from numba import cuda

from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.sight.boxes import scan_rows
from repaint_cli.envs.racer.track.files import load_track

CASES: dict[str, dict[str, Any]] = {
    "camera": {"sensors": "camera"},
    "stereo, 6 bots": {"sensors": "stereo", "objects": ObjectSettings(n=6)},
    "stereo, 5 boxes": {"sensors": "stereo", "objects": ObjectSettings(n=5, boxes=True)},
}
CARS, STEPS, LOOK = 256, 300, 10
"""Of the comparison with the CPU; pictures are compared every `LOOK` steps."""
SIZES = (256, 1024, 4096, 16384)
STATES, LIDAR, STATUSES, PIXELS, GREY = 1e-9, 1e-9, 1e-3, 1e-4, 1e-5
"""How much may differ: states and ranges (m), shares of statuses, of pixels, and of pixels by more
than one grey level."""


class Row(NamedTuple):
    """A line of the table."""

    card: str
    what: str
    case: str
    cars: int
    value: float
    unit: str
    limit: float | str = ""


def cars(case: str, n: int, device: str, **more: Any) -> RacerVectorEnv:
    """Make N cars on the track of the shipped cards."""
    settings = {**CASES[case], "max_steps": 200, **more}
    return RacerVectorEnv(load_track("reinvent-like"), n, device=device, **settings)


def actions_of(steps: int, n: int) -> np.ndarray:
    """Return actions that mostly go ahead, (T, N)."""
    rng = np.random.default_rng(0)
    return rng.choice(10, (steps, n), p=[0.05, 0.1, 0.1, 0.1, 0.05, 0.1, 0.1, 0.2, 0.1, 0.1])


def agreement(card: str, case: str) -> Iterator[Row]:
    """Compare 300 steps of 256 cars on the GPU with the same on the CPU."""
    here, there = cars(case, CARS, "cpu", threads=8), cars(case, CARS, "cuda")
    reverse = {"reverse": np.arange(CARS) % 4 == 0}
    (seen, _), (image, _) = (env.reset(seed=3, options=reverse) for env in (here, there))
    apart = pixels = grey = poses = 0.0
    same = np.ones(CARS, bool)  # which cars had the same ends of episodes until now
    for t, actions in enumerate(actions_of(STEPS, CARS)):
        seen, reward, ended, late, infos = here.step(actions)
        image, gpu_reward, gpu_ended, gpu_late, gpu_infos = there.step(actions)
        names = [name for name in infos if name not in ("objects", "hit")]
        found = {name: gpu_infos[name].copy_to_host() for name in names}
        same &= infos["status"] == found["status"]
        same &= ended == gpu_ended.copy_to_host()
        same &= late == gpu_late.copy_to_host()
        for name in ("x", "y", "heading", "speed", "steering", "progress", "dprog", "lane"):
            apart = max(apart, np.abs(infos[name] - found[name])[same].max())
        apart = max(apart, np.abs(reward - gpu_reward.copy_to_host())[same].max())
        if "objects" in infos:
            there_now = there.on_device.fleet.poses.copy_to_host()[..., :3]
            poses = max(poses, np.abs(infos["objects"] - there_now)[same].max())
        if t % LOOK == LOOK - 1:
            off = np.abs(seen.astype(int) - image.copy_to_host())[same]
            pixels, grey = max(pixels, np.mean(off > 0)), max(grey, np.mean(off > 1))
    yield Row(card, "states apart", case, CARS, apart, "m, rad, %", STATES)
    yield Row(card, "objects apart", case, CARS, poses, "m, rad", STATES)
    yield Row(card, "other status", case, CARS, 1 - same.mean(), "share", STATUSES)
    yield Row(card, "other pixels", case, CARS, pixels, "share", PIXELS)
    yield Row(card, "pixels off by more than 1", case, CARS, grey, "share", GREY)


def lidar(card: str) -> Iterator[Row]:
    """Compare ranges without noise, and look at what the noise is like."""
    from repaint_cli.envs.racer.device.arrays import zeros

    case = "stereo, 6 bots"
    env = cars(case, CARS, "cuda", sensors="stereo+lidar", range_min=0.0)
    env.reset(seed=3)
    racer = env.on_device
    noisy = racer.sensors.ranges.copy_to_host()
    racer.sensors.ranges, racer.sensors.range_noise = zeros((CARS, 64)), 0.0
    racer.sensors.read(racer.fleet, racer.stream)
    found, exact = racer.sensors.ranges.copy_to_host(), np.ones((CARS, 64))
    states, poses = racer.fleet.states.copy_to_host(), racer.fleet.poses.copy_to_host()
    scan_rows(np.arange(CARS), states, poses, racer.sensors._body.copy_to_host(), exact)
    yield Row(card, "ranges apart", case, CARS, np.abs(found - exact).max(), "m", LIDAR)
    noise = (noisy - exact)[(exact > 0.1) & (exact < 0.95)]
    spread = noise.std() if len(noise) else 0.0
    yield Row(card, "spread of the noise of ranges", case, CARS, spread, "m")


def determinism(card: str, case: str) -> Iterator[Row]:
    """Drive 100 steps twice; count the bytes that differ at the end."""
    ends = []
    for _ in range(2):
        env = cars(case, 1024, "cuda", sensors="stereo+lidar")
        env.reset(seed=5)
        for actions in actions_of(100, 1024):
            obs, reward, *_, infos = env.step(actions)
        arrays = (*obs.values(), reward, infos["terms"], infos["records"])
        ends.append([array.copy_to_host() for array in arrays])
    differ = sum(int(np.count_nonzero(a != b)) for a, b in zip(*ends, strict=True))
    yield Row(card, "numbers that differ in a second run", case, 1024, differ, "numbers", 0)


def speed(card: str, case: str, n: int, **more: Any) -> Iterator[Row]:
    """Measure whole steps, without learning, and pictures alone."""
    env = cars(case, n, "cuda", **more)
    begun = perf_counter()
    env.reset(seed=1)
    cuda.synchronize()
    yield Row(card, "reset", case, n, perf_counter() - begun, "s")
    chosen = [cuda.to_device(row) for row in actions_of(64, n)]
    for actions in chosen[:8]:
        env.step(actions)
    cuda.synchronize()
    taken = []
    for _ in range(3):
        begun = perf_counter()
        for actions in chosen:
            env.step(actions)
        cuda.synchronize()
        taken.append((perf_counter() - begun) / len(chosen))
    best, middle = min(taken), float(np.median(taken))
    yield Row(card, "step", case, n, 1e3 * middle, "ms")
    yield Row(card, "steps a second", case, n, n / middle, "1/s")
    yield Row(card, "steps a second, best of 3", case, n, n / best, "1/s")
    racer = env.on_device
    begun = perf_counter()
    for _ in range(20):
        racer.sensors.read(racer.fleet, racer.stream)
    cuda.synchronize()
    yield Row(card, "pictures and ranges", case, n, 1e3 * (perf_counter() - begun) / 20, "ms")


def torch_reads(card: str) -> Iterator[Row]:
    """Compare what torch sees of pictures drawn into its own tensor, on its own stream."""
    import torch

    env = cars("camera", 64, "cuda")
    env.reset(seed=0)
    ring = torch.zeros(2, 64, 120, 160, 1, dtype=torch.uint8, device="cuda")
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        env.on_device.use_stream(stream.cuda_stream)
        env.on_device.draw_into(ring[1])
        actions = torch.full((64,), 7, device="cuda")
        image, reward, *_ = env.step(actions)
        total = torch.as_tensor(reward, device="cuda").sum()
        seen = ring[1].cpu().numpy()
    off = np.count_nonzero(seen != image.copy_to_host()) + int(ring[0].any())
    off += int(abs(float(total) - reward.copy_to_host().sum()) > 1e-12) + int(seen.max() == 0)
    yield Row(card, "numbers that torch sees otherwise", "camera", 64, off, "numbers", 0)


def rows(card: str, largest: int) -> Iterator[Row]:
    """Yield all measurements; those of the learner name no number of cars."""
    for case in CASES:
        yield from agreement(card, case)
    yield from lidar(card)
    yield from determinism(card, "stereo, 6 bots")
    yield from torch_reads(card)
    for n in SIZES:
        if n <= largest:
            yield from speed(card, "camera", n)
    for n in (1024, 4096):
        if n <= largest:
            yield from speed(card, "stereo, 6 bots", n, sensors="stereo+lidar")
    for measured in learning.measurements():
        what, case, *rest = measured
        yield Row(card, what, case, 0, *rest)


def main() -> int:
    """Measure, print and write; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="where gpu.csv is written")
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="most cars that are timed")
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    name = cuda.get_current_device().name
    card, wrong, begun = name.decode() if isinstance(name, bytes) else str(name), 0, perf_counter()
    with (chosen.folder / "gpu.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(Row._fields)
        for row in rows(card, chosen.largest):
            fails = row.limit != "" and not row.value <= float(row.limit)
            wrong += fails
            table.writerow([*row[:4], f"{row.value:.6g}", *row[5:]])
            file.flush()
            allowed = f"  (at most {row.limit:g})" if row.limit != "" else ""
            mark = "  WRONG" if fails else ""
            line = f"{row.case:16} {row.cars:6} {row.what:36} {row.value:.6g} {row.unit}"
            print(f"{line}{allowed}{mark}  [{perf_counter() - begun:.0f} s]", flush=True)
    print(f"{card}: {wrong} wrong, {perf_counter() - begun:.0f} s")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
