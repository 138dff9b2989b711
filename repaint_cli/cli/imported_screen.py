"""The screen of a training, which comes with torch and all the rest: it says so before."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repaint_cli.cli.screen import Screen


def screen() -> "Screen":
    """Return a new screen; a terminal shows meanwhile that libraries are loaded."""
    from repaint_cli.cli.live import loading
    from repaint_cli.cli.printing import out

    with loading(out):
        from repaint_cli.cli.screen import Screen
    return Screen()
