"""PySC2 4.0.0 made to import, which on Python 3.11 and later it does not by itself.

It breaks twice. Its messages (s2clientprotocol) are written for protobuf before 4, which later ones
refuse; the descriptions inside them are still good, so the modules are built anew from these. And
its colours call `random.shuffle` in a way that Python 3.11 no longer has. Its viewer, which nobody
opens here, is left out: it needs pygame and a part of SciPy that SciPy 2 will not have.
"""

import ast
import os
import random
import sys
import warnings
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from repaint_cli.envs.starcraft.pysc2.launch import launch
from repaint_cli.errors import GameError

INSTALL = (
    "the engine 'pysc2' plays StarCraft II by PySC2, which is not installed: "
    'pip install "pysc2==4.0.0" "s2clientprotocol>=5"'
)

MESSAGES = "s2clientprotocol"
MODULES = ("common", "data", "error", "raw", "score", "spatial", "ui", "debug", "query", "sc2api")
"""Its modules, each behind those that it needs."""

FALLBACK = "PROTOCOL_BUFFERS_PYTHON_IMPLEMENTATION"
"""The variable that chooses protobuf's own Python code, which takes old messages, but reads an
observation in 10 ms in place of 50 µs."""


VIEWER = "pysc2.lib.renderer_human"


def load() -> None:
    """Import PySC2 in this process, with its flags at their defaults.

    Raises:
        GameError: PySC2 is not installed, or its messages cannot be loaded.
    """
    if find_spec("pysc2") is None or find_spec(MESSAGES) is None:
        raise GameError(INSTALL)
    if "pysc2.env.sc2_env" in sys.modules:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        load_messages()
        _parse_flags()
        colours: Any = import_module("pysc2.lib.colors")
        colours.shuffled_hue = _shuffled_hue
        sys.modules[VIEWER] = ModuleType(VIEWER)
        import_module("pysc2.env.sc2_env")
        del sys.modules[VIEWER]
        process: Any = import_module("pysc2.lib.sc_process")
        process.StarcraftProcess._launch = launch


def load_messages() -> None:
    """Import the messages: built anew, or with protobuf's own Python code where that fails.

    Raises:
        GameError: neither works here.
    """
    if f"{MESSAGES}.{MODULES[-1]}_pb2" in sys.modules:
        return
    before = any(name.startswith("google.protobuf.") for name in sys.modules)
    try:
        for name in MODULES:
            _build(f"{MESSAGES}.{name}_pb2")
    except Exception as error:
        _forget(MESSAGES)
        if before:
            raise GameError(
                f"the installed protobuf does not take PySC2's messages ({type(error).__name__}); "
                f"a slower way takes them: {FALLBACK}=python repaint …"
            ) from error
        _forget("google.protobuf")
        os.environ[FALLBACK] = "python"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import_module(f"{MESSAGES}.{MODULES[-1]}_pb2")


def _build(name: str) -> None:
    """Put a module of messages in its place, built from its description."""
    from google.protobuf import descriptor_pool
    from google.protobuf.internal import builder

    spec = find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    description = _description(Path(spec.origin).read_text(encoding="utf-8"))
    if description is None or os.environ.get(FALLBACK) == "python":
        import_module(name)
        return
    file: Any = descriptor_pool.Default().AddSerializedFile(description)
    module = ModuleType(name)
    module.__dict__["DESCRIPTOR"] = file
    builder.BuildMessageAndEnumDescriptors(file, module.__dict__)
    builder.BuildTopDescriptorsAndMessages(file, name, module.__dict__)
    sys.modules[name] = module
    setattr(import_module(MESSAGES), name.rpartition(".")[2], module)


def _description(source: str) -> bytes | None:
    """Return what an old module says of its messages, or None of one that protobuf now takes."""
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Call) and "FileDescriptor" in ast.unparse(node.func)):
            continue
        for keyword in node.keywords:
            if keyword.arg == "serialized_pb":
                (text,) = (
                    part.value for part in ast.walk(keyword.value) if isinstance(part, ast.Constant)
                )
                return text if isinstance(text, bytes) else str(text).encode("latin1")
    return None


def _forget(package: str) -> None:
    for name in [name for name in sys.modules if name == package or name.startswith(package + ".")]:
        del sys.modules[name]


def _parse_flags() -> None:
    """Parse no words: PySC2 refuses to read its flags before, and ours are not meant for it."""
    from absl import flags, logging

    if not flags.FLAGS.is_parsed():
        flags.FLAGS(["repaint"])
    logging.set_verbosity(logging.ERROR)


def _shuffled_hue(scale: int) -> Any:
    """Return a palette in an order that is mixed, and always the same."""
    import numpy as np
    from pysc2.lib import colors

    palette = list(colors.smooth_hue_palette(scale))
    random.Random(0).shuffle(palette)
    return np.array(palette)
