"""An episode as a film: the map from above, what the agent sees of it, and numbers.

The episode is played again from its seed and its actions. A frame is a step, half a second of the
game's own clock.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.starcraft import board, map_view
from repaint_cli.envs.starcraft.layers import MINIMAP_LAYERS, SCREEN_LAYERS, Spread
from repaint_cli.envs.starcraft.rts.constants import COMMANDS, LOOPS_PER_SECOND, MEASUREMENTS
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.simulator import StarCraftSimulator
from repaint_cli.report import style
from repaint_cli.report.video import Frame, font, write_video

FPS = 24
TITLE, GAP = 40, 16
"""Height of the title, and between what stands side by side, pixels."""
COUNTERS, LEGEND = 64, 28
WIDTH = map_view.WIDTH + GAP + board.WIDTH + GAP
HEIGHT = TITLE + board.HEIGHT + COUNTERS
"""Of a frame, pixels."""
TOP = 12
"""Above the counters."""
BASE_NAMES, FOES = ("minerals", "SCV"), ("zergling", "unseen")
"""Of the legend, where there is a base, and where there are zerglings."""


def film(
    env: StarCraftSimulator, episodes: Episodes, path: Path, title: str, n_episodes: int
) -> None:
    """Film the first seed's first episodes; see `Simulator.film`."""
    frames = (
        frame
        for e in range(n_episodes)
        for frame in frames_of(env, episodes, e, f"{title} · episode {e + 1}")
    )
    write_video(frames, path, FPS)


def frames_of(env: StarCraftSimulator, episodes: Episodes, e: int, title: str) -> Iterator[Frame]:
    """Yield a frame for each step of an episode of the first seed, (H, W, 3)."""
    n_steps = int(episodes.lengths[0, e])
    actions = episodes.actions[:n_steps, 0, e].astype(np.int16)
    returns = np.cumsum(episodes.rewards[:n_steps, 0, e])
    game = MiniRTS(env.spec, 1)
    game.reset(np.array([episodes.env_seeds[e]]))
    layers = SCREEN_LAYERS[env.layers], MINIMAP_LAYERS[env.layers]
    names = [layer.name for layer in layers[0]]
    names += [f"minimap: {layer.name}" for layer in layers[1]]
    spread, still = [Spread(kind) for kind in layers], _still(env, title)
    view, seen_layers = map_view.MapView(env.spec), board.Layers(names)
    for action, total in zip(actions, returns, strict=True):
        game.step(action[None])
        observation, row = game.observe(), game.state.arrays[0]
        images = [one(part)[0] for one, part in zip(spread, observation[:2], strict=True)]
        frame = still.copy()
        frame.paste(view.draw(row), (0, TITLE))
        frame.paste(seen_layers.draw(images), (map_view.WIDTH + GAP, TITLE))
        numbers = _numbers(row, observation.measurements[0], float(total))
        frame.paste(board.counters(numbers, WIDTH, COUNTERS - TOP), (0, HEIGHT - COUNTERS + TOP))
        yield np.asarray(frame)


def _still(env: StarCraftSimulator, title: str) -> Image.Image:
    """Draw the title and the legend."""
    frame = Image.new("RGB", (WIDTH, HEIGHT), "white")
    absent = [*(() if env.spec.base else BASE_NAMES), *(() if env.spec.zerglings else FOES)]
    pen, letters = ImageDraw.Draw(frame), font(16, "-Bold")
    while letters.getlength(title) > WIDTH - 2 * GAP and letters.size > 8:
        letters = font(int(letters.size) - 1, "-Bold")
    pen.text((WIDTH / 2, TITLE / 2), title, style.INK, letters, anchor="mm")
    below = board.legend(map_view.WIDTH, LEGEND, absent)
    frame.paste(below, (0, TITLE + map_view.HEIGHT))
    return frame


def _numbers(row: np.void, measurements: np.ndarray, total: float) -> list[tuple[str, str]]:
    """Return the names and texts of the counters of a step."""
    seconds = int(row["loop"]) // LOOPS_PER_SECOND
    now = dict(zip(MEASUREMENTS, measurements.tolist(), strict=True))
    command = COMMANDS[row["last_command"]] if row["last_command"] >= 0 else "none"
    return [
        ("game time", f"{seconds // 60}:{seconds % 60:02d}"),
        ("refused" if row["last_refused"] else "command", command),
        ("minerals", str(now["minerals"])),
        ("supply", f"{now['food_used']} / {now['food_cap']}"),
        ("SCVs", str(now["scvs"])),
        ("marines", str(now["army"])),
        ("marines built", str(row["marines_built"])),
        ("zerglings killed", str(row["zerglings_killed"])),
        ("return", f"{total:+.2f}"),
    ]
