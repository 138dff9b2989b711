"""The program: `repaint`, and `python -m repaint_cli`."""

import sys

from repaint_cli.process import prepare


def main() -> None:
    """Run a command; what nobody foresaw ends in one line, too."""
    try:
        prepare()
        from repaint_cli.cli.app import main

        main()
    except KeyboardInterrupt:  # while commands are imported
        sys.exit(130)
    except Exception as error:
        from repaint_cli.errors import as_line

        if "--debug" in sys.argv:
            raise
        line, code = as_line(error)
        sys.stderr.write(f"error: {line}\n")
        sys.exit(code)


if __name__ == "__main__":
    main()
