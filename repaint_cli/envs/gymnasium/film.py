"""Films of Gymnasium environments on machines without a screen.

MuJoCo reads MUJOCO_GL when it is first imported and cannot use another after a failure, so a child
process draws, and child processes find out beforehand which of EGL and OSMesa works here.
The child is this module, with the word `probe` or `film`; it reads its job as JSON from standard
input.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli import interruption, process
from repaint_cli.envs.gymnasium.ids import name_of, spec_of
from repaint_cli.errors import RenderError
from repaint_cli.files.atomic import atomic_write

RENDERERS = ("egl", "osmesa")
PROBE_SECONDS = 60.0
ADVICE = "no offscreen renderer works here (tried EGL and OSMesa); on Debian: apt install " + (
    "libegl1 libgl1-mesa-dri"
)
DRAWN_FLAT = tuple(f"gymnasium.envs.{kind}." for kind in ("classic_control", "box2d", "toy_text"))
"""Where Gymnasium keeps what pygame draws in memory, without a renderer."""
SIZE = 480
"""Width and height of a MuJoCo frame, pixels."""
CAMERA_SETTINGS: dict[str, dict[str, Any]] = {
    "Reacher-v5": {
        "trackbodyid": -1,
        "lookat": [0.0, 0.0, 0.0],
        "distance": 0.85,
        "elevation": -90.0,
    }
}
"""Where Gymnasium's own camera shows the body too small."""


@dataclass(frozen=True)
class Replay:
    """An episode to play again."""

    seed: int
    """Given to `reset`."""
    actions: NDArray[Any]
    """(T, A) float64, or (T,) integers where actions are discrete."""
    rewards: NDArray[np.float64] | None = None
    """What each step earned (T,), to show the return so far; the task's, not the environment's."""


@cache
def find_renderer() -> str | None:
    """Return which of "egl" and "osmesa" draws on this machine, or None; asked once a process."""
    wish = os.environ.get("MUJOCO_GL", "").lower()
    for renderer in sorted(RENDERERS, key=lambda name: name != wish):
        try:
            if _child("probe", renderer, "", PROBE_SECONDS).returncode == 0:
                return renderer
        except subprocess.TimeoutExpired:
            continue
    return None


def render_gym(
    env_id: str,
    kwargs: Mapping[str, Any],
    episodes: Sequence[Replay],
    path: Path,
    *,
    title: str = "",
    fps: float | None = None,
) -> None:
    """Play episodes again in Gymnasium's own environment and film them.

    The actions must come from the same environment: EnvPool's episodes start elsewhere.

    Args:
        env_id: as in `gymnasium.make`.
        kwargs: passed to the environment, as JSON; they win over our size and camera.
        episodes: seeds and actions; an episode that ends earlier is cut there.
        path: of the MP4.
        title: in the strip below the picture.
        fps: frames a second; the environment's own by default.

    Raises:
        RenderError: no renderer works here, or the environment cannot be drawn.
        StoreError: the file cannot be written.
    """
    renderer = RENDERERS[0] if _is_drawn_flat(env_id) else find_renderer()
    if renderer is None:
        raise RenderError(ADVICE)
    job = {
        "env_id": env_id, "kwargs": dict(kwargs), "title": title, "fps": fps,
        "episodes": [_as_json(episode) for episode in episodes],
    }  # fmt: skip
    with (
        atomic_write(path) as scratch,
        TemporaryDirectory(prefix=".film-", dir=path.parent) as folder,
    ):
        made = Path(folder).resolve() / "film.mp4"
        _film_in_child(job | {"path": str(made)}, renderer)
        os.replace(made, scratch)


def _is_drawn_flat(env_id: str) -> bool:
    """Return whether an environment is one of Gymnasium's that need no renderer."""
    import gymnasium

    spec = gymnasium.registry.get(env_id)
    return spec is not None and str(spec.entry_point).startswith(DRAWN_FLAT)


def _film_in_child(job: dict[str, Any], renderer: str) -> None:
    seconds = PROBE_SECONDS + sum(len(episode["actions"]) + 1 for episode in job["episodes"])
    try:
        child = _child("film", renderer, json.dumps(job), seconds)
    except subprocess.TimeoutExpired as error:
        raise RenderError(f"filming '{job['env_id']}' took longer than {seconds:.0f} s") from error
    if child.returncode != 0:
        lines = (child.stdout.strip() or child.stderr.strip()).splitlines()
        reason = lines[-1] if lines else f"exit code {child.returncode}"
        raise RenderError(f"cannot film '{job['env_id']}': {reason}")


def _as_json(episode: Replay) -> dict[str, Any]:
    """Return an episode as JSON, whose numbers are read back bit for bit the same."""
    rewards = None if episode.rewards is None else np.asarray(episode.rewards).tolist()
    actions = np.asarray(episode.actions).tolist()
    return {"seed": int(episode.seed), "actions": actions, "rewards": rewards}


def _child(task: str, renderer: str, job: str, seconds: float) -> subprocess.CompletedProcess[str]:
    """Run this module on its own, guarded as this process is, with the renderer it asks for."""
    return subprocess.run(
        process.child_command("repaint_cli.envs.gymnasium.film", task),
        input=job,
        env=os.environ
        | process.environment()
        | {"MUJOCO_GL": renderer, "PYOPENGL_PLATFORM": renderer},
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )


# What follows runs in the child.


def probe() -> bool:
    """Draw a white ball on black; return whether the picture shows anything."""
    import mujoco  # type: ignore[import-untyped]

    ball = "<mujoco><worldbody><light pos='0 0 3'/><geom size='.5'/></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(ball)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 64, 64) as renderer:
        renderer.update_scene(data)
        return bool(np.ptp(renderer.render()) > 0)


def write_film(job: Mapping[str, Any]) -> None:
    """Write the film that `render_gym` asks for."""
    import gymnasium

    from repaint_cli.report.video import write_video

    env = gymnasium.make(job["env_id"], render_mode="rgb_array", **_view(job))
    try:
        fps = job["fps"] or env.metadata.get("render_fps", 30)
        write_video(frames(env, job["episodes"], job["title"]), Path(job["path"]), fps)
    finally:
        env.close()


def _view(job: Mapping[str, Any]) -> dict[str, Any]:
    """Add size and camera to the arguments of Gymnasium's MuJoCo environments; others have none."""
    entry = str(spec_of(job["env_id"]).entry_point)
    if not entry.startswith("gymnasium.envs.mujoco"):
        return dict(job["kwargs"])
    view: dict[str, Any] = {"width": SIZE, "height": SIZE}
    if (name := name_of(job["env_id"])) in CAMERA_SETTINGS:
        view["default_camera_config"] = CAMERA_SETTINGS[name]
    return {**view, **job["kwargs"]}


def frames(
    env: Any, episodes: Sequence[Mapping[str, Any]], title: str
) -> Iterator[NDArray[np.uint8]]:
    """Yield each episode's first frame and one after every action, until the episode ends."""
    from repaint_cli.report.video import caption

    for number, episode in enumerate(episodes, start=1):
        name = f"episode {number} of {len(episodes)}"
        env.reset(seed=episode["seed"])
        yield caption(env.render(), title, f"{name} · step 0")
        for t, action in enumerate(episode["actions"], start=1):
            _, _, terminated, truncated, _ = env.step(_of_its_space(action, env))
            so_far = f"{name} · step {t}{_return(episode['rewards'], t)}"
            yield caption(env.render(), title, so_far)
            if terminated or truncated:
                break


def _of_its_space(action: Any, env: Any) -> Any:
    """Return an action as training gives it: with the type of the environment's space."""
    return np.asarray(action, env.action_space.dtype)[()]


def _return(rewards: Sequence[float] | None, t: int) -> str:
    """Return the text of what the first `t` steps earned, if that is known."""
    return "" if rewards is None else f" · return {sum(rewards[:t]):.1f}".replace("-", "−")


def main(task: str) -> int:
    """Do one task of the child, return its exit code; an error is a line on standard output."""
    interruption.end_with(os.getppid())
    try:
        if task == "probe":
            return 0 if probe() else 1
        with redirect_stdout(sys.stderr):  # what an environment prints is no answer
            write_film(json.load(sys.stdin))
    except Exception as error:  # the parent turns it into one line for people
        sys.stdout.write((str(error) or type(error).__name__).splitlines()[0])
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
