"""Nothing in the current folder is read as code or as settings: a folder full of tripwires.

Each file that Python, a dependency or a process of theirs might look for in the current folder lies
there. A module, once imported, says so in a file; an audit hook in every Python process says which
file was opened; and who obeys a setting fails.
"""

import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path

import pytest
from small_runs import QUICK, QUICK_LAP, add_teacher

from repaint_cli.files.paths import PACKAGE

FIXTURES = Path(__file__).parent / "fixtures"
ROOT = PACKAGE.parent

OPTIONAL = (
    "cffi charset_normalizer colorama coverage cuda cython dill flint glfw_preview gmpy gmpy2 "
    "intel jax monkeytype onnx_tf OpenGL_accelerate opt_einsum org pydot pynvml redis "
    "scikits sksparse tabulate tbb tensorflow tensorrt torchdistx torchvision tqdm triton tvm "
    "uarray usercustomize xarray yaml z3 "
)
"""What dependencies try to import and do without: all names that they asked for in vain."""

PLUGINS = (
    "gymnasium.envs torch.backends torch_dynamo_backends pydantic numba_extensions array_api "
    "matplotlib.backend tensorboard_plugins tensorboard.experiment_data "
    "onnxruntime_extensions imageio.plugins fsspec.specs etils.epath networkx.backends "
    "pytest11 hypothesis jax_plugins "
)
"""Entry points by which installed packages are asked to load others, as
gymnasium/envs/registration.py, torch/__init__.py and numba/core/entrypoints.py do."""

SETTINGS = {
    # file: (who looks for it, what it says)
    "matplotlibrc": (
        "matplotlib/__init__.py: matplotlib_fname, before every other place",
        "text.usetex: True\nfigure.dpi: no number\nbackend: module://tripped\n",
    ),
    ".numba_config.yaml": (
        "numba/core/config.py: _EnvReloader.update, at import and whenever it compiles",
        "disable_jit: 1\ncache_dir: .\n",
    ),
    "mujoco.pkg": ("pkgutil.extend_path, for every search path", "tripped\n"),
    "tripped-1.0.dist-info/METADATA": (
        "importlib.metadata, for every search path",
        "Metadata-Version: 2.1\nName: torch\nVersion: 0.0.1\n",
    ),
    "tripped-1.0.dist-info/entry_points.txt": (
        "importlib.metadata.entry_points, for every search path",
        "".join(f"[{group}]\ntripped = tripped:main\n" for group in PLUGINS.split()),
    ),
    "tripped.pth": ("site, for its own folders", "import tripped\n"),
    "pyvenv.cfg": ("site, beside the interpreter", "home = .\n"),
    "python311._pth": ("the interpreter on Windows, beside it", ".\nimport site\n"),
    "pybuilddir.txt": ("getpath of the interpreter, beside it", ".\n"),
    "setup.cfg": ("setuptools/_distutils/dist.py: find_config_files", "[build_ext]\ndefine=X\n"),
    "pyproject.toml": ("black, setuptools: who builds", "[tool.setuptools]\npackages=0\n"),
    ".env": ("python-dotenv, where installed", "NUMBA_DISABLE_JIT=1\n"),
    ".pdbrc": ("pdb.Pdb.__init__", "import tripped\n"),
    ".netrc": ("netrc, in HOME", "machine x login x password x\n"),
    "imageio.ini": ("imageio, in its settings folder", "tripped\n"),
    "_ops.py": ("inspect, as the file of torch.ops", "import tripped\n"),
    "_classes.py": ("inspect, as the file of torch.classes", "import tripped\n"),
    "drirc": ("Mesa, in /etc and HOME", "<driconf>\n"),
    ".drirc": ("Mesa, in HOME", "<driconf>\n"),
    "libx264-veryfast.ffpreset": ("ffmpeg, in FFMPEG_DATADIR and HOME", "crf=tripped\n"),
    "gl.conf": ("OpenGL vendors, in /usr/share/glvnd", "{}\n"),
    "MUJOCO_LOG.TXT": ("mujoco, which writes there what went wrong", "tripped\n"),
}  # fmt: skip
LIBRARIES = {
    "libglfw.so.3": "glfw/library.py: _get_frozen_library_search_paths",
    "libEGL.so.1": "OpenGL/platform/egl.py, by ctypes",
    "libOSMesa.so.8": "OpenGL/platform/osmesa.py, by ctypes",
    "libmujoco.so.3.6.0": "mujoco/__init__.py, in its own folder",
    "libtripped.so": "mujoco/__init__.py: plugins, in MUJOCO_PLUGIN_DIR",
    "libtbb.so.12": "numba/np/ufunc/parallel.py",
    "libgomp.so.1": "torch/__init__.py: _load_global_deps",
}
MODULE = """import os
with open({log!r}, "a") as log:
    log.write(f"imported {{__name__}} by {{os.getpid()}}\\n")
main = None
"""


def poison(folder, log, names):
    """Put a tripwire into each file; return the files' names."""
    for name in names:
        (folder / f"{name}.py").write_text(MODULE.format(log=str(log)))
    for name, (_, text) in SETTINGS.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    for name in LIBRARIES:
        (folder / name).write_bytes(b"\x7fELF of nobody")
    return [*(f"{name}.py" for name in names), *SETTINGS, *LIBRARIES]


def modules():
    """Names of all modules that might be imported: Python's, the installed ones, optional ones."""
    installed = importlib.metadata.packages_distributions()
    names = {*sys.stdlib_module_names, *installed, *OPTIONAL.split(), "tripped", "sitecustomize"}
    return {name for name in names if name.isidentifier()}


@pytest.fixture
def place(tmp_path):
    """A poisoned folder to stand in, and a program like pip's for `repaint`."""
    folder, program = tmp_path / "poisoned", tmp_path / "bin" / "repaint"
    folder.mkdir()
    program.parent.mkdir()
    program.write_text(
        "import re\nimport sys\nfrom repaint_cli.__main__ import main\nsys.exit(main())\n"
    )
    return Place(tmp_path, folder, program)


class Place:
    """A poisoned folder, in which commands are typed."""

    def __init__(self, root, folder, program):
        self.folder, self.program, self.log = folder, program, root / "log"
        self.files = poison(folder, self.log, modules())
        self.env = {
            name: value for name, value in os.environ.items() if not name.startswith("PYTHON")
        } | {
            "PYTHONPATH": os.pathsep.join([str(FIXTURES / "watch"), str(ROOT)]),
            "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1",
            "REPAINT_HOME": str(root / "home"), "WATCH_FOLDER": str(folder),
            "WATCH_FILES": "\n".join(self.files), "WATCH_LOG": str(self.log),
        }  # fmt: skip

    def tripped(self):
        return self.log.read_text() if self.log.exists() else ""

    def type_in(self, *words, start=()):
        start = start or [self.program]
        return subprocess.run(
            [sys.executable, *start, *map(str, words)], cwd=self.folder, env=self.env,
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip

    def without(self, names):
        """Take modules out of the folder."""
        for name in names:
            (self.folder / f"{name}.py").unlink(missing_ok=True)


def test_the_tripwires_trip(place):
    done = place.type_in(start=["-c", "import tabulate; open('matplotlibrc').close()"])
    assert done.returncode == 0, done.stderr
    assert "imported tabulate" in place.tripped()
    assert "open matplotlibrc in" in place.tripped()


def test_a_poisoned_folder_is_a_folder(place):
    done = place.type_in("zoo", "list")
    assert (done.returncode, done.stderr, place.tripped()) == (0, "", "")
    done = place.type_in("transfer", "--task", "reacher", "--method", "scratch", *QUICK)
    assert (done.returncode, done.stderr, place.tripped()) == (0, "", "")


def started_by_python():
    """What `python -m` imports from the current folder whatever is started, before the package."""
    code = "import runpy, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True)
    return [*done.stdout.split(), "repaint_cli"]


def test_python_m_repaint_cli_guards_as_well(place):
    place.without(started_by_python())
    done = place.type_in("tasks", "list", start=["-m", "repaint_cli"])
    assert (done.returncode, done.stderr, place.tripped()) == (0, "", "")


def test_an_empty_entry_of_pythonpath_is_not_the_current_folder(place):
    place.without(modules() - {"typer", "pydantic"})
    place.env["PYTHONPATH"] += os.pathsep
    done = place.type_in("tasks", "list")
    assert (done.returncode, done.stderr, place.tripped()) == (0, "", "")


def test_what_pythonpath_names_is_kept(place):
    place.without(modules())
    (place.folder / "my_env.py").write_text("print('mine')\n")
    place.program.write_text(
        "from repaint_cli.process import prepare\nprepare()\nimport my_env\nimport subprocess\n"
        "import sys\nsubprocess.run([sys.executable, '-c', 'import my_env'])\n"
    )
    assert "No module named 'my_env'" in place.type_in().stderr
    place.env["PYTHONPATH"] += f"{os.pathsep}."
    assert place.type_in().stdout == "mine\nmine\n"


@pytest.mark.slow
def test_children_of_a_library_are_guarded_and_its_search_path_is_its_own(place):
    place.program.write_text("""
import sys
before = list(sys.path)
import repaint_cli
from repaint_cli import process
from repaint_cli.envs.gymnasium.film import find_renderer
find_renderer()
settings = ["ppo.n_iterations=1", "eval.episodes=2", "ppo.n_steps=204", "ppo.n_envs=4"]
card = repaint_cli.load_task("reacher").with_settings(settings)
print(*repaint_cli.train_methods(card, ["scratch"], seeds=[0], jobs=2))
assert before == sys.path
assert process._ImportGuard not in sys.meta_path
sys.path.insert(0, "")
assert "" not in process.child_command("x")[3].split(":")
""")
    for name in ("matplotlibrc", ".numba_config.yaml"):  # the caller's own, in its process
        (place.folder / name).unlink()
    done = place.type_in()
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("scratch\n")
    assert place.tripped() == ""


COMMANDS = [
    ["--version"],
    ["tasks", "list"],
    ["tasks", "check", "racer-inner"],
    ["tasks", "copy", "reacher", "copied.toml"],
    ["tasks", "check", "copied.toml"],
    ["train-teacher", "--task", "copied.toml", "--name", "mine", "--tensorboard", *QUICK],
    ["transfer", "--teacher", "old-hand", "--task", "reacher", "--run", "run", *QUICK],
    ["transfer", "--resume", "run", "--iterations", 3],
    ["transfer", "--teacher", "old-hand", "--task", "reacher", "--method", "repaint-joint", *QUICK],
    ["eval", "run", "--episodes", 1, "--render-offscreen"],
    ["transfer", "--method", "scratch", "--task", "racer-outer", "--run", "lap", *QUICK_LAP],
    ["eval", "lap", "--episodes", 1, "--render-offscreen"],
    ["compare", "run"],
    ["compare", "lap", "--trajectories"],
    ["similarity", "racer-inner", "racer-outer"],
    ["compare", "--task", "reacher", "--methods", "scratch,kickstart", "--teacher", "old-hand",
     "--jobs", 2, "--iterations", 1, "--seeds", 1,
     "--set", "ppo.n_steps=204", "--set", "ppo.n_envs=4",
     "--set", "eval.episodes=2", "--report", "report"],
    ["zoo", "list"],
    ["zoo", "show", "old-hand"],
    ["zoo", "verify", "old-hand", "--score"],
    ["zoo", "export", "old-hand", "out", "--onnx"],
    ["zoo", "remove", "mine", "--yes"],
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("start", ["repaint", "python -m repaint_cli"])
def test_every_command_in_a_poisoned_folder(place, tmp_path, start):
    add_teacher(tmp_path / "home" / "zoo")
    as_module = start != "repaint"
    if as_module:
        place.without(started_by_python())
    place.env["XDG_CACHE_HOME"] = str(tmp_path / "cache")  # so that all is compiled anew
    for words in COMMANDS:
        done = place.type_in(*words, start=["-m", "repaint_cli"] if as_module else ())
        assert done.returncode in (0, 8), (words, done.stderr)  # 8: nothing here draws MuJoCo
        assert "matplotlib" not in done.stderr
        assert "Numba" not in done.stderr
        assert place.tripped() == "", words
