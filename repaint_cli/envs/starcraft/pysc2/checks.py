"""Is the game there, in the right version, with its maps? And why did it not start?

PySC2 answers such questions with tracebacks. Everything here is one line that says what to install
where.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from repaint_cli.envs.output import warn
from repaint_cli.envs.starcraft.pysc2 import shim
from repaint_cli.envs.starcraft.pysc2.launch import last_words
from repaint_cli.envs.starcraft.pysc2.maps import FILES, RELEASE
from repaint_cli.errors import GameError, some

LINUX = "https://github.com/Blizzard/s2client-proto#linux-packages"
"""Where the game for Linux is, and its licence."""


def get_game(folder: Path | None = None) -> str:
    """Say how to get the game, whose archive holds its folder; None is where PySC2 looks."""
    folder = folder or Path(os.environ.get("SC2PATH", "~/StarCraftII")).expanduser()
    where = f"({LINUX}) in '{folder.parent}'"
    return f"on Linux unpack version 4.10 {where}, or name its folder in SC2PATH"


def installed_game(version: str | None = None) -> Any:
    """Return PySC2's configuration of the installed game: its folder and its version.

    Args:
        version: which to play, such as "4.10"; None is the newest that is installed.

    Raises:
        GameError: PySC2 or the game is not installed, or not in this version.
    """
    shim.load()
    from pysc2 import run_configs
    from pysc2.lib import sc_process

    try:
        game = run_configs.get(version=version)
    except OSError as error:
        folder = Path(error.filename or "~/StarCraftII/Versions").parent
        raise GameError(f"no StarCraft II in '{folder}'; {get_game(folder)}") from error
    except ValueError as error:
        raise GameError(
            f"expected an installed version of StarCraft II, found {version!r}; {_versions(error)}"
        ) from error
    except sc_process.SC2LaunchError as error:
        raise GameError(f"StarCraft II cannot be played: {_line(error)}; {get_game()}") from error
    _check_version(game)
    return game


def _versions(error: ValueError) -> str:
    """Return which versions PySC2 names in its message, for people."""
    names = [part.strip(" '[].") for part in str(error).partition("Known versions:")[2].split(",")]
    return f"installed: {some(names)}"


def _check_version(game: Any) -> None:
    """Warn where PySC2 does not know the game's units and abilities, as it is newer."""
    from pysc2.run_configs import lib

    newest = max(lib.VERSIONS.values(), key=lambda version: version.build_version)
    if game.version.build_version > newest.build_version:
        warn(
            f"StarCraft II is of build {game.version.build_version}, and PySC2 knows those up to "
            f"{newest.build_version} ({newest.game_version}); what it does not know is not seen"
        )


def map_file(game: Any, name: str, own: Path | None = None) -> Path:
    """Return where a mini-game's map lies, absolute.

    Args:
        game: PySC2's configuration of the installed game.
        name: of the mini-game.
        own: a user's map in place of the known one.

    Raises:
        GameError: it is not there.
    """
    if own is not None:
        if own.is_file():
            return own.resolve()
        raise GameError(f"there is no map at '{own}'")
    if name not in FILES:
        raise GameError(
            f"nobody has published the map {name} for StarCraft II; make it as "
            "docs/starcraft-real.md says, and name its file"
        )
    maps = Path(game.data_dir).absolute() / "Maps"
    path = maps / FILES[name]
    if path.is_file():
        return path
    raise GameError(f"there is no map at '{path}'; unpack mini_games.zip ({RELEASE}) in '{maps}'")


@contextmanager
def launch_errors(game: Any) -> Iterator[None]:
    """Say in a line why the game does not start.

    Raises:
        GameError: it does not.
    """
    import portpicker
    import websocket
    from pysc2.lib import protocol, remote_controller, sc_process

    try:
        yield
    except portpicker.NoFreePortFoundError as error:
        raise GameError(
            "expected a free port for StarCraft II, found none; end programs that hold ports"
        ) from error
    except websocket.WebSocketException as error:
        raise GameError(_in_use(error)) from error
    except remote_controller.ConnectError as error:
        if "something else" in str(error):
            raise GameError(_in_use(error)) from error
        raise GameError(
            f"StarCraft II was started and does not answer ({last_words()}); start the binary in "
            f"'{game.data_dir}/Versions/Base{game.version.build_version}' by hand to see why"
        ) from error
    except remote_controller.RequestError as error:
        raise GameError(f"StarCraft II refuses the game: {_line(error)}") from error
    except (protocol.ConnectionError, protocol.ProtocolError) as error:
        raise GameError(f"StarCraft II ended while it started: {_line(error)}") from error
    except (ValueError, LookupError) as error:
        raise GameError(misunderstood(error)) from error
    except (sc_process.SC2LaunchError, RuntimeError, OSError) as error:
        raise GameError(f"StarCraft II cannot be started: {_line(error)}; {get_game()}") from error


def misunderstood(error: Exception) -> str:
    """Say that PySC2 does not know what the game told it, which raised this."""
    return (
        f"PySC2 does not understand this StarCraft II ({_line(error)}); it knows versions up to "
        "5.0.9, and Linux has 4.10"
    )


def _in_use(error: Exception) -> str:
    return (
        "the port that was picked for StarCraft II is in use: something else answers there "
        f"({_line(error)}); try again"
    )


def _line(error: Exception) -> str:
    """Return what an error says, on one line and short."""
    return f"{' '.join(str(error).split()).rstrip('.'):.300}"
