"""PySC2 imports under the newest protobuf, and where its repair fails, by slower code."""

import subprocess
import sys

import pytest

pytest.importorskip("pysc2", reason="needs PySC2, of the extra sc2")

from repaint_cli.envs.starcraft.pysc2 import shim

OLD = """
DESCRIPTOR = _descriptor.FileDescriptor(
  name='s2clientprotocol/some.proto',
  serialized_pb=_b('\\n\\x1bs2\\xff')
)
"""

BREAK = """
from repaint_cli.envs.starcraft.pysc2 import shim
def build(name):
    from google.protobuf.internal import builder
    raise AttributeError(name)
shim._build = build
{first}
shim.load()
from google.protobuf.internal import api_implementation
from s2clientprotocol import sc2api_pb2
from pysc2.env import sc2_env
print(api_implementation.Type(), sc2api_pb2.Response.FromString(b"\\x88\\x06\\x03").id)
"""


def in_a_process(text):
    words = [sys.executable, "-W", "error", "-c", text]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)


def test_messages_are_built_anew_and_read_by_protobufs_fast_code():
    shim.load()
    shim.load()  # once more is nothing more
    from google.protobuf.internal import api_implementation
    from pysc2.env import sc2_env
    from s2clientprotocol import common_pb2, sc2api_pb2

    assert api_implementation.Type() == "upb"
    sent = sc2api_pb2.Response(id=3, status=sc2api_pb2.in_game)
    assert sc2api_pb2.Response.FromString(sent.SerializeToString()) == sent
    assert common_pb2.Race.Name(sc2_env.Race.terran) == "Terran"


def test_where_that_fails_protobufs_own_python_code_reads_them():
    done = in_a_process(BREAK.format(first=""))
    assert (done.stdout, done.returncode) == ("python 3\n", 0), done.stderr


def test_where_protobuf_is_in_use_already_a_line_says_how_to_choose_its_python_code():
    done = in_a_process(BREAK.format(first="import google.protobuf.message"))
    assert done.stderr.splitlines()[-1] == (
        "repaint_cli.errors.GameError: the installed protobuf does not take PySC2's messages "
        "(AttributeError); a slower way takes them: "
        "PROTOCOL_BUFFERS_PYTHON_IMPLEMENTATION=python repaint …"
    )


def test_only_old_modules_are_built_anew():
    assert shim._description(OLD) == b"\n\x1bs2\xff"
    assert shim._description("DESCRIPTOR = pool.AddSerializedFile(b'new')") is None


def test_colours_are_mixed_and_always_the_same():
    shim.load()
    from pysc2.lib import colors

    palette = colors.shuffled_hue(20)
    assert palette.shape == (20, 3)
    assert (palette == colors.shuffled_hue(20)).all()
    assert (palette != colors.smooth_hue_palette(20)).any()
