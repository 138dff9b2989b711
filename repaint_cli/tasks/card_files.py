"""Task cards on disk: TOML that people write; the shipped ones lie in `tasks/`.

A card may extend a shipped one and then holds only what differs.
"""

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

from repaint_cli.envs.racer.deepracer.model_files import (
    read_hyperparameters,
    unread_hyperparameters,
    unread_metadata,
)
from repaint_cli.envs.registry import simulator_class
from repaint_cli.errors import CardError, NotFound, reported_as
from repaint_cli.files.commands import command
from repaint_cli.files.limits import read_text, read_toml
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.task import FUNCTION, SCALE

DEFAULT_CONV = "3-layer"
"""`net.conv` of a card that does not say it."""
ENV_ID = re.compile(r"-v\d+$")
"""How an id of Gymnasium's ends; no shipped task is called so."""


def read_task(name: str) -> TaskCard:
    """Read a shipped task by name, or a card of one's own by its path (`my-task.toml`).

    Raises:
        NotFound: there is no such task.
        CardError: the card has a value that is not allowed.
    """
    path = Path(name)
    if path.suffix == ".toml":
        if not os.path.exists(path):  # which takes any name
            start = command("repaint tasks copy reacher {}", name)
            raise NotFound(f"there is no card at '{name}'; start one: {start}")
    else:
        known = shipped_tasks()
        if name not in known:
            check_no_environment(name)
            raise NotFound.named("task", name, known, "repaint tasks list")
        path = known[name]
    return TaskCard.parse({"name": path.stem} | _resolve(path), str(path))


def check_no_environment(name: str) -> None:
    """Check that no environment's id stands where a task's name is wanted.

    Raises:
        NotFound: one does; the error says how to write a card for it.
    """
    if not ENV_ID.search(name):
        return
    file = re.sub(r"[^a-z0-9]+", "-", name.rpartition(":")[2].rpartition("-v")[0].lower())
    line = f"expected a task, found the id of an environment, {name!r:.200}; write a card for it: "
    line += command(f"repaint tasks new --env {{}} {file.strip('-') or 'my-task'}.toml", name)
    known = shipped_tasks()
    if tasks := [task for task in known if _resolve(known[task])["env"].get("id") == name]:
        line += f"; or take one of its tasks: {', '.join(tasks)}"
    raise NotFound(line)


def notes_on_files(name: str, card: TaskCard) -> list[str]:
    """Return what is worth knowing where a card of one's own names DeepRacer's files.

    Args:
        name: as `read_task` took it.
        card: what that returned.
    """
    from repaint_cli.envs.racer.deepracer.physics import better_car

    path = Path(name)
    if path.suffix != ".toml":
        return []
    with reported_as(CardError):
        metadata = _model_metadata(read_toml(path), path.parent)
    files = [metadata.name] if metadata else []
    files += [card.reward_code.name] if card.reward_code else []
    line = better_car(card.env, files)
    return [line] if line else []


def _resolve(path: Path) -> dict[str, Any]:
    """Read TOML and merge it over what it extends; files beside the card are put in place."""
    with reported_as(CardError):
        data = read_toml(path)
    code = _reward_code(data, path.parent)
    base = data.pop("extends", None)
    known = shipped_tasks()
    if base is not None and (not isinstance(base, str) or base not in known or known[base] == path):
        raise NotFound.named("task", str(base), known, "repaint tasks list")
    basis = {} if base is None else _resolve(known[base])
    named = _model_metadata(data, path.parent)
    _resolve_files(data, basis, path.parent)
    whole = _merge(basis, data)
    if named:
        net = whole.get("net")
        conv = net.get("conv", DEFAULT_CONV) if isinstance(net, dict) else DEFAULT_CONV
        _say(unread_metadata(named, conv))
    ppo = data.get("ppo")
    if basis and isinstance(ppo, dict) and "n_steps" in ppo and "n_episodes" not in ppo:
        whole["ppo"].pop("n_episodes", None)  # the new card counts otherwise
    return whole | code


def _resolve_files(data: dict[str, Any], basis: dict[str, Any], folder: Path) -> None:
    """Replace the names of files in [env] and [ppo], which lie beside the card, by their contents.

    The values of a section override those of its file.
    """
    env, ppo = (data.get(section) for section in ("env", "ppo"))
    if isinstance(env, dict):
        name = env.get("simulator", basis.get("env", {}).get("simulator"))
        kind = None
        with suppress(ValueError):  # an unknown simulator, which the card's check refuses
            kind = simulator_class(name)
        if kind:
            data["env"] = kind.resolve_files(env, folder)
    if isinstance(ppo, dict) and isinstance(ppo.get("hyperparameters"), str):
        file = folder / ppo.pop("hyperparameters")
        settings = read_hyperparameters(file)
        _say(unread_hyperparameters(file, ppo))
        if "n_steps" in ppo:
            settings.pop("n_episodes", None)
        data["ppo"] = settings | ppo


def _model_metadata(data: dict[str, Any], folder: Path) -> Path | None:
    """Return the file of DeepRacer's that [env] names, or None."""
    env = data.get("env")
    name = env.get("model_metadata") if isinstance(env, dict) else None
    return folder / name if isinstance(name, str) else None


def _say(text: str | None) -> None:
    """Warn, once, of what a file says and nobody reads."""
    if text:
        from repaint_cli.envs.output import warn  # which takes longer than reading a card

        warn(text)


def _reward_code(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return what `[reward] function = "file.py"` stands for: the file's text, and one term.

    The term's weight is the `scale` beside it, or 1.
    """
    reward = data.get("reward")
    if not isinstance(reward, dict) or not isinstance(file := reward.get("function"), str):
        return {}
    if others := sorted(reward.keys() - {"function", SCALE}):
        raise CardError(
            f"a reward function stands alone: leave out {others[0]:.60} beside {file}; what it "
            f"pays can be multiplied, by {SCALE} = 1e-3"
        )
    del data["reward"]
    path = folder / file
    with reported_as(CardError):
        source = read_text(path)
    code = {"name": path.name, "source": source, "file": str(path.absolute())}
    return {"reward": {FUNCTION: reward.get(SCALE, 1.0)}, "reward_code": code}


def _merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    both = {k: (base[k], v) for k, v in over.items() if k in base}
    parts = {k: _merge(*two) for k, two in both.items() if all(isinstance(v, dict) for v in two)}
    return base | over | parts
