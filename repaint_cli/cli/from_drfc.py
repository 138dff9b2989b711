"""`repaint tasks from-drfc`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from repaint_cli.cli.help_page import OPTIONS
from repaint_cli.cli.options import argument, option

if TYPE_CHECKING:
    from repaint_cli.envs.racer.deepracer.drfc import DrfcSettings
    from repaint_cli.tasks.card import TaskCard

FILES = (
    ("env", "model_metadata", "model_metadata.json"),
    ("ppo", "hyperparameters", "hyperparameters.json"),
    ("reward", "function", "reward_function.py"),
)
"""DeepRacer's files, and where a card names them."""


def from_drfc(
    run_env: Annotated[Path, argument("RUN_ENV", "The settings of a run, `run.env`.")],
    folder: Annotated[
        Path,
        argument("FOLDER", "Where reward_function.py and the others are, `custom_files`."),
    ],
    track: Annotated[
        Path | None,
        option(OPTIONS, "FILE", "The track's waypoints. Default: DR_WORLD_NAME in FOLDER."),
    ] = None,
    output: Annotated[
        Path | None,
        option(OPTIONS, "FILE", "The new card. Default: FOLDER/DR_LOCAL_S3_MODEL_PREFIX.toml."),
    ] = None,
) -> None:
    """Write a card from settings and files of DeepRacer-for-Cloud.

    What has no counterpart stands in the card as a comment that says why.

    Examples:
        repaint tasks from-drfc run.env custom_files
        repaint tasks from-drfc run.env custom_files --output my-task.toml
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.cli.tasks import check_new
    from repaint_cli.envs.racer.deepracer.drfc import read_run_env
    from repaint_cli.errors import NotFound
    from repaint_cli.files.commands import command

    settings = read_run_env(run_env)
    path = output or folder / f"{settings.model}.toml"
    check_new(path)
    absent = [name for _, _, name in FILES if not (folder / name).is_file()]
    if "reward_function.py" in absent:
        raise NotFound(f"expected {folder / 'reward_function.py'}, found none; name its folder")
    text = card_text(settings, run_env, folder, track_of(settings.world, folder, track), path)
    print(plain(f"wrote {path}: {_written(path, text).summary}"))
    for name in absent:
        print(plain(f"note: {folder / name} is absent: the card has racer-inner's instead"))
    if settings.unread:
        print(f"{len(settings.unread)} settings have no counterpart; the card says why")
    print(plain(f"next: {command('repaint tasks check {}', path)}"))


def _written(path: Path, text: str) -> "TaskCard":
    """Write a card and read it; there is no file where it is none."""
    from repaint_cli.errors import RepaintError
    from repaint_cli.files.atomic import write_text
    from repaint_cli.tasks.card_files import read_task

    write_text(path, text, new=True)
    try:
        return read_task(str(path))
    except RepaintError:
        path.unlink()
        raise


def track_of(world: str, folder: Path, given: Path | None) -> Path | str:
    """Return the file of a track's waypoints, or the name of a shipped one.

    Raises:
        NotFound: there is none.
    """
    from repaint_cli.envs.racer.track.files import shipped_tracks
    from repaint_cli.errors import NotFound

    file = given or folder / f"{world}.npy"
    if file.is_file():
        return file
    if given is None and world in shipped_tracks():
        return world
    raise NotFound(
        f"expected the track's waypoints in {file}, found none; they are in the simulator's routes "
        "(deepracer-simapp), and --track FILE names them elsewhere"
    )


def card_text(
    settings: "DrfcSettings", run_env: Path, folder: Path, track: Path | str, path: Path
) -> str:
    """Return the card as TOML.

    Args:
        settings: of the run.
        run_env: where they were read from.
        folder: of DeepRacer's files.
        track: file of waypoints, or the name of a shipped track.
        path: where the card will be, which its files are named from.
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.files.toml import toml_line

    def named(file: Path) -> str:
        whole = file.is_absolute() and not folder.is_absolute()
        return file.as_posix() if whole else Path(os.path.relpath(file, path.parent)).as_posix()

    road = track if isinstance(track, str) else named(track)
    sections: dict[str, dict[str, object]] = {
        "env": {"track": road, "car": "sim5"}, "ppo": {}, "eval": {}, "reward": {},
    }  # fmt: skip
    for section, key, name in FILES:
        if (folder / name).is_file():
            sections[section][key] = named(folder / name)
    for setting, value in settings.card.items():
        section, key = setting.split(".")
        sections[section][key] = value
    summary = f"{settings.world}, {settings.race_type}, from {run_env.name}."
    lines = ['extends = "racer-inner"', toml_line("summary", summary)]
    for section, values in sections.items():
        if values:
            lines += ["", f"[{section}]", *(toml_line(key, value) for key, value in values.items())]
    lines += ["", *(plain(f"# {what}: {why}") for what, why in settings.unread.items())]
    return "\n".join(lines) + "\n"
