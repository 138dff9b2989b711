"""This process and its children: nothing in the current folder is read as code or as settings.

Both ways to start repaint call `prepare` before they import what is installed, and so does every
child, for which this file is the program (`child_command`). Until the current folder is off the
search path, nothing may be imported here but modules that the interpreter carries within it
(frozen).
Whoever imports `repaint_cli` as a library keeps their search path and settings.
"""

import os
import sys
from importlib.machinery import PathFinder

TYPE_CHECKING = False  # that of typing would have to be imported
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType

TORCH_BYTES = 1_500_000_000
"""Address space that torch and the compiled simulators take, before there is a network."""


def prepare() -> None:
    """Guard this process and whatever it starts; twice is as good as once."""
    _open_streams()
    _leave_current_folder()
    os.environ.update(environment())
    if _ImportGuard not in sys.meta_path:
        sys.meta_path.insert(0, _ImportGuard)


def environment() -> dict[str, str]:
    """Return the environment variables of guarded processes: settings of libraries, in one place.

    Libraries read theirs when they are imported; so they are set before.
    """
    settings = {
        "PYTHONSAFEPATH": "1",  # the current folder is on no child's search path
        "MPLBACKEND": "Agg",  # figures are drawn to files
        "PYDANTIC_DISABLE_PLUGINS": "1",  # looking for some takes a while
    }
    if "PYTHONPATH" in os.environ:  # an empty entry, as in "$PYTHONPATH:x", is the current folder
        settings["PYTHONPATH"] = os.pathsep.join(filter(None, _python_path()))
    return settings


def thread_limits(n: int) -> dict[str, str]:
    """Return the environment variables that give the libraries of a child so many threads."""
    names = ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB", "NUMBA", "NUMEXPR")
    return {f"{name}_NUM_THREADS": str(n) for name in names}


def child_command(module: str, *words: str) -> list[str]:
    """Return the command of a child that runs one of our modules, as if typed with `words`.

    It finds modules where this process does, but for the current folder of an interactive one.
    """
    search_path = os.pathsep.join(filter(None, sys.path))
    return [sys.executable, "-P", os.path.abspath(__file__), search_path, module, *words]


def cache_folder(kind: str) -> str:
    """Return the user's folder for what can be made anew, or "" where none can be written.

    It is in $XDG_CACHE_HOME or ~/.cache, else in $TMPDIR, else in /tmp. Compiled code lies there: a
    folder that belongs to somebody else, or that others may write, is not taken.
    """
    cache = os.environ.get("XDG_CACHE_HOME", "")
    temporary = os.environ.get("TMPDIR", "")
    for parent, name in (
        (cache if os.path.isabs(cache) else os.path.expanduser("~/.cache"), "repaint"),
        *((place, f"repaint-{_user()}") for place in (temporary, "/tmp") if os.path.isabs(place)),
    ):
        folder = os.path.join(parent, name)
        inner = os.path.join(folder, kind)
        try:
            if not os.path.isabs(parent):  # "~" of a user who has no home
                continue
            for path in (parent, folder, inner):  # a home that is not there is not made
                if not os.path.isdir(path):
                    os.mkdir(path, 0o700)
            if _is_ours(folder) and _is_ours(inner) and os.access(inner, os.W_OK | os.X_OK):
                return inner
        except OSError:
            continue
    return ""


def _user() -> int:
    return os.geteuid() if hasattr(os, "geteuid") else 0


def _is_ours(folder: str) -> bool:
    """Return whether a folder, which is no link, is this user's and nobody else may write it."""
    status = os.lstat(folder)
    if not hasattr(os, "geteuid"):
        return True
    return status.st_mode & 0o170022 == 0o040000 and status.st_uid == _user()


def _open_streams() -> None:
    """Put the null device in place of closed standard streams; `sys.stdout` stays None then.

    Else the next file that is opened would take the number of one, and what is printed.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free
    if sys.stderr is None:
        sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False)


_left = False


def _leave_current_folder() -> None:
    """Take the current folder off the search path, unless PYTHONPATH or a .pth file names it.

    Python puts it there for `-m` and `-c`, and for empty entries of PYTHONPATH.
    """
    global _left
    if _left:
        return
    _left = True
    try:
        here = os.getcwd()
    except OSError:  # it was deleted
        here = ""
    if sys.path and not sys.flags.safe_path and sys.path[0] in ("", here):
        del sys.path[0]
    named = _python_path()
    if "" in named and here not in map(os.path.abspath, filter(None, named)) and here in sys.path:
        sys.path.remove(here)


def _python_path() -> list[str]:
    """Return the entries of PYTHONPATH."""
    text = os.environ.get("PYTHONPATH", "")
    return text.split(os.pathsep) if text else []


class _ImportGuard:
    """Imports what would read the current folder, or needs something first, with care."""

    @staticmethod
    def find_spec(
        name: str, path: "Sequence[str] | None" = None, target: "ModuleType | None" = None
    ) -> "ModuleSpec | None":
        """Return how to import one of the modules of `_CAREFULLY`; others are not found here."""
        if name not in _CAREFULLY:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec and spec.loader and spec.origin:
            folder, carefully = os.path.dirname(spec.origin), _CAREFULLY[name]
            execute = spec.loader.exec_module
            spec.loader.exec_module = lambda module: carefully(  # type: ignore[method-assign]
                folder, lambda: execute(module)
            )
        return spec


def _import_matplotlib(folder: str, execute: "Callable[[], None]") -> None:
    """Import it where its own defaults are the first `matplotlibrc` that it looks for.

    The user's settings do not count either: they may ask for LaTeX, or for another backend.
    """
    if cache := cache_folder("matplotlib"):
        os.environ["MPLCONFIGDIR"] = cache
    with standing_in(os.path.join(folder, "mpl-data")):
        execute()


def _import_numba(folder: str, execute: "Callable[[], None]") -> None:
    """Import it where no `.numba_config.yaml` is; it looks for one again whenever it compiles."""
    with standing_in(folder):
        execute()
    sys.modules["numba.core.config"].__dict__["_config_fname"] = os.devnull


def _import_torch(folder: str, execute: "Callable[[], None]") -> None:
    """Check first that there is room for it: it would abort the process.

    Raises:
        RepaintError: the address space is limited to less than it takes.
    """
    from repaint_cli.errors import RepaintError

    try:
        from resource import RLIMIT_AS, getrlimit
    except ImportError:  # not on Windows
        return execute()
    limit, _ = getrlimit(RLIMIT_AS)
    if 0 <= limit < TORCH_BYTES:
        raise RepaintError(
            f"expected at least {TORCH_BYTES / 1e9:.2f} GB of address space, found a limit of "
            f"{limit / 1e9:.2f} GB; raise it: ulimit -v unlimited"
        )
    return execute()


_CAREFULLY: "dict[str, Callable[[str, Callable[[], None]], None]]" = {
    "matplotlib": _import_matplotlib,
    "numba": _import_numba,
    "torch": _import_torch,
}


class standing_in:  # noqa: N801 - a context manager, as contextlib's are, which is not frozen
    """Have another current folder meanwhile."""

    def __init__(self, folder: str) -> None:
        self._folder = folder

    def __enter__(self) -> None:
        self._here = os.open(".", getattr(os, "O_PATH", os.O_RDONLY))  # also one that was deleted
        os.chdir(self._folder)

    def __exit__(self, *_: object) -> None:
        os.fchdir(self._here)
        os.close(self._here)


def _run_child(search_path: str, module: str, *words: str) -> None:
    """Run a module of the package that this file is in, wherever that lies."""
    import runpy
    from importlib.util import module_from_spec, spec_from_file_location

    sys.path[:] = search_path.split(os.pathsep)
    package = os.path.join(os.path.dirname(__file__), "__init__.py")
    spec = spec_from_file_location("repaint_cli", package)
    assert spec
    assert spec.loader
    sys.modules["repaint_cli"] = module_from_spec(spec)
    spec.loader.exec_module(sys.modules["repaint_cli"])
    from repaint_cli import process

    process.prepare()
    sys.argv = [module, *words]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _run_child(*sys.argv[1:])
elif sys.argv[:1] == ["-m"] and "repaint_cli" in sys.orig_argv:
    _leave_current_folder()  # while Python looks for `-m repaint_cli`, before its next import
