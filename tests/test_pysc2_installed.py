"""What is not installed, or does not start: one line that says what to do, and its exit code.

Where the game is started here, a shell script stands for it.
"""

import re
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import numpy as np
import pytest
from small_pysc2 import install

from repaint_cli.envs.starcraft.pysc2 import checks, shim
from repaint_cli.envs.starcraft.pysc2.engine import RealEngine
from repaint_cli.envs.starcraft.rts.maps import MAPS
from repaint_cli.errors import GameError

BUILD = MAPS["build-marines"]

DOCS = Path(__file__).parents[1] / "docs"
LINUX = "https://github.com/Blizzard/s2client-proto#linux-packages"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty place for the game, which SC2PATH names."""
    monkeypatch.setenv("SC2PATH", str(tmp_path / "StarCraftII"))
    return tmp_path / "StarCraftII"


def on_linux(folder):
    """How to get the game, whose archive holds a folder StarCraftII."""
    return (
        f"on Linux unpack version 4.10 ({LINUX}) in '{folder.parent}', or name its folder in "
        "SC2PATH"
    )


def refusal(spec=BUILD, **settings):
    """The line with which an engine is refused, at its making or at its first reset."""
    with pytest.raises(GameError) as refused:
        RealEngine(spec, 1, **settings).reset(np.array([0]))
    assert refused.value.exit_code == 9
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_the_manual_installs_as_the_errors_say():
    page = (DOCS / "starcraft-real.md").read_text(encoding="utf-8")
    assert page.count("pip install") == 1
    assert shim.INSTALL.partition("pip install")[2] in page
    example = re.search(r"error: no StarCraft II in '(.*?)'; .*", page)
    assert example[0].endswith(checks.get_game(Path(example[1])))


def test_pysc2_is_not_installed(monkeypatch):
    monkeypatch.setattr(shim, "find_spec", lambda name: None)
    assert refusal() == (
        "the engine 'pysc2' plays StarCraft II by PySC2, which is not installed: "
        'pip install "pysc2==4.0.0" "s2clientprotocol>=5"'
    )


def test_the_game_is_not_installed(folder):
    assert refusal() == f"no StarCraft II in '{folder}'; {on_linux(folder)}"


def test_no_version_is_installed(folder):
    (folder / "Versions").mkdir(parents=True)
    message = f"StarCraft II cannot be played: No SC2 Versions found in {folder}/Versions"
    assert refusal() == f"{message}; {on_linux(folder)}"


def test_the_version_is_not_installed(folder, monkeypatch):
    install(folder, monkeypatch)
    assert refusal(version="3.17.2") == (
        "expected an installed version of StarCraft II, found '3.17.2'; installed: 4.10.0, latest"
    )


def test_the_version_is_too_old(folder, monkeypatch):
    install(folder, monkeypatch, build=53644)
    assert refusal() == (
        "StarCraft II cannot be played: SC2 Binaries older than 3.16.1 don't support the api; "
        f"{on_linux(folder)}"
    )


def test_a_version_that_pysc2_does_not_know_is_said(folder, monkeypatch, capsys):
    install(folder, monkeypatch, build=93333)
    checks.installed_game()
    assert capsys.readouterr().err == (
        "warning: StarCraft II is of build 93333, and PySC2 knows those up to 87702 (5.0.9); what "
        "it does not know is not seen\n"
    )


def test_the_map_is_not_there(folder, monkeypatch):
    install(folder, monkeypatch, maps=())
    maps = folder / "Maps"
    assert refusal() == (
        f"there is no map at '{maps}/mini_games/BuildMarines.SC2Map'; unpack mini_games.zip "
        f"(https://github.com/google-deepmind/pysc2/releases/tag/v1.2) in '{maps}'"
    )


def test_a_map_of_ones_own_is_not_there(folder, monkeypatch, tmp_path):
    install(folder, monkeypatch)
    own = tmp_path / "mine.SC2Map"
    assert refusal(file=own) == f"there is no map at '{own}'"


def test_the_map_that_nobody_has_published_must_be_made(folder, monkeypatch):
    install(folder, monkeypatch)
    assert refusal(MAPS["build-marines-fdz"]) == (
        "nobody has published the map build-marines-fdz for StarCraft II; make it as "
        "docs/starcraft-real.md says, and name its file"
    )


def test_the_binary_is_not_there_or_is_none(folder, monkeypatch):
    binary = install(folder, monkeypatch)
    binary.chmod(0o644)
    assert refusal().startswith("StarCraft II cannot be started: Trying to run '")
    binary.unlink()
    assert refusal() == (
        f"StarCraft II cannot be started: No SC2 binary found at: {binary}; {on_linux(folder)}"
    )


@pytest.mark.parametrize(
    ("prints", "last_words"),
    [
        ("", "it printed nothing"),
        (
            "echo a line; echo libX11.so.6 is absent >&2; echo",
            "its last line: libX11.so.6 is absent",
        ),
    ],
)
def test_the_game_ends_as_it_starts(folder, monkeypatch, capfd, prints, last_words):
    binary = install(folder, monkeypatch)
    binary.write_text(f"#!/bin/sh\n{prints}\nsleep 0.3\nexit 1\n")
    assert refusal() == (
        f"StarCraft II was started and does not answer ({last_words}); start the binary in "
        f"'{binary.parent}' by hand to see why"
    )
    assert capfd.readouterr() == ("", "")


def test_what_stands_for_the_binary_is_no_program(folder, monkeypatch):
    binary = install(folder, monkeypatch)
    binary.write_text("this is text")
    assert refusal() == (
        f"StarCraft II cannot be started: Exec format error: {binary}; {on_linux(folder)}"
    )


class _Elsewhere(BaseHTTPRequestHandler):
    """Somebody else's program at a port."""

    def do_GET(self):
        self.send_response(200)
        self.end_headers()

    def log_message(self, *words):
        pass


def test_the_port_is_in_use(folder, monkeypatch):
    import portpicker

    install(folder, monkeypatch)
    server = HTTPServer(("127.0.0.1", 0), _Elsewhere)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    monkeypatch.setattr(portpicker, "pick_unused_port", lambda: server.server_port)
    monkeypatch.setattr(portpicker, "return_port", lambda port: None)
    try:
        assert refusal().startswith(
            "the port that was picked for StarCraft II is in use: something else answers there ("
        )
    finally:
        server.shutdown()
        server.server_close()


def test_no_port_is_free(folder, monkeypatch):
    import portpicker

    def none():
        raise portpicker.NoFreePortFoundError

    install(folder, monkeypatch)
    monkeypatch.setattr(portpicker, "pick_unused_port", none)
    assert refusal() == (
        "expected a free port for StarCraft II, found none; end programs that hold ports"
    )


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (
            lambda: _pysc2().remote_controller.RequestError("InvalidMapData: ''", None),
            "StarCraft II refuses the game: InvalidMapData: ''",
        ),
        (
            lambda: _pysc2().protocol.ConnectionError("Websocket timed out."),
            "StarCraft II ended while it started: Websocket timed out",
        ),
        (
            lambda: _pysc2().remote_controller.ConnectError(
                "Connection rejected. Is something else connected?"
            ),
            "the port that was picked for StarCraft II is in use: something else answers there "
            "(Connection rejected. Is something else connected?); try again",
        ),
    ],
)
def test_what_pysc2_says_as_it_starts_is_a_line(folder, monkeypatch, error, message):
    install(folder, monkeypatch)
    shim.load()

    def fail(**settings):
        raise error()

    monkeypatch.setattr("pysc2.env.sc2_env.SC2Env", fail)
    assert refusal() == message


def _pysc2():
    from pysc2.lib import protocol, remote_controller

    class Modules:
        pass

    Modules.protocol, Modules.remote_controller = protocol, remote_controller
    return Modules
