"""Standard output as people read it: the console, and what a command wrote."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from repaint_cli.cli.console import literal

out = Console(soft_wrap=True, highlight=False, emoji=False)


def print_written(files: Sequence[Path], following: str) -> None:
    """Print every file written, folder by folder, and the next command worth typing."""
    folders: dict[Path, list[str]] = {}
    for path in files:
        folders.setdefault(path.parent, []).append(path.name)
    for folder, names in folders.items():
        out.print(f"wrote [bold]{literal(folder)}/[/bold]: {literal(', '.join(names))}")
    out.print(f"next: [bold]{literal(following)}[/bold]")
