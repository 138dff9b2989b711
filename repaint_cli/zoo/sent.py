"""Teachers that were sent from another machine: kept by what they hold, in this user's cache."""

from pathlib import Path

from repaint_cli.errors import StoreError
from repaint_cli.files.atomic import atomic_write, sha256
from repaint_cli.process import cache_folder


def sent_file(digest: str) -> Path | None:
    """Return where a teacher's file of this SHA-256 lies, or would lie; None without a cache."""
    folder = cache_folder("teachers")
    return Path(folder) / f"{digest}.safetensors" if folder and digest.isalnum() else None


def has(digest: str) -> bool:
    """Tell whether a file of this SHA-256 is here, whole."""
    path = sent_file(digest)
    return path is not None and path.is_file() and sha256(path) == digest


def keep(digest: str, data: bytes) -> Path:
    """Keep a teacher's file.

    Raises:
        StoreError: there is no folder for it, or it cannot be written.
    """
    path = sent_file(digest)
    if path is None:
        raise StoreError("expected a folder for teachers, found none; set XDG_CACHE_HOME")
    with atomic_write(path) as temporary:
        temporary.write_bytes(data)
    return path
