"""`repaint open`."""

import os
import sys
from pathlib import Path
from typing import Annotated

from repaint_cli.cli.options import argument


def open_page(
    run: Annotated[
        Path | None,
        argument("RUN", "A run's folder, or that of a report of compare. Default: the newest run."),
    ] = None,
) -> None:
    """Show a run's page, report.html, in the browser.

    A run's page is written anew, with a film and pictures that came later. Without a display its
    path is printed and nothing opened.

    Examples:
        repaint open
        repaint open runs/reacher/scratch-20210718-120000
    """
    import webbrowser

    from repaint_cli.cli.console import plain
    from repaint_cli.runs.run_page import fresh_page

    page = fresh_page(run)
    print(plain(page), flush=True)
    if has_display():
        webbrowser.open(page.resolve().as_uri())


def has_display() -> bool:
    """Tell whether a browser could show a window here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
