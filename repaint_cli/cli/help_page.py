"""A command's help: options under headings, examples below, ASCII where a terminal has no UTF-8."""

import sys
from typing import Any

from typer.core import TyperCommand
from typer.exceptions import TyperException

from repaint_cli.cli.hints import for_extra_words, for_unknown_option

OPTIONS = "Options"
"""The heading for options of commands that have too few for headings of their own."""

ASCII = str.maketrans({"β": "beta", "ζ": "zeta", "₀": "_0", "≥": ">=", "…": "...", "×": "x"})
"""How help spells what ASCII lacks."""

BRACES = str.maketrans("", "", "{}")


def legible(text: str | None, encoding: str) -> str:
    """Return a text as a terminal of this encoding can show it."""
    return (text or "").translate({} if "utf" in encoding.lower() else ASCII)


class HelpPage(TyperCommand):
    """A command whose docstring ends in examples, and whose options stand under their headings.

    The heading of an option is its `rich_help_panel`. Typer's own types for the context and the
    formatter are private, so they are Any here.
    """

    def __init__(self, name: str | None, **settings: Any) -> None:
        text, _, examples = (settings.pop("help", None) or "").partition("\n\nExamples:\n")
        encoding = sys.stdout.encoding or "ascii"
        settings |= {"help": legible(text, encoding), "epilog": examples}
        super().__init__(name, **settings)
        params: list[Any] = self.params
        for param in params:
            param.help = legible(param.help, encoding)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line; say what was meant by words that are none of the command's."""
        ctx.allow_extra_args = True  # which are refused here
        try:
            rest: list[str] = super().parse_args(ctx, args)
        except TyperException as error:
            if hint := for_unknown_option(getattr(error, "option_name", "")):
                ctx.fail(hint)
            raise
        if rest and not ctx.resilient_parsing:
            params: list[Any] = self.params
            takes = [param.metavar for param in params if param.param_type_name == "argument"]
            ctx.fail(for_extra_words(f"repaint {ctx.info_name}", rest, ctx.params, takes))
        return rest

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words of the usage line; required ones without braces, as in manuals."""
        return [piece.translate(BRACES) for piece in super().collect_usage_pieces(ctx)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options, a column over all headings."""
        params: list[Any] = self.get_params(ctx)
        sections: dict[str, list[tuple[str, str]]] = {}
        for param in params:
            names, sentence = param.get_help_record(ctx)[0], param.help
            if param.param_type_name == "argument":
                names = param.metavar
            if param.default is not None and param.default is not False:
                sentence += f" Default: {param.default}."
            heading = param.rich_help_panel or (OPTIONS if OPTIONS in sections else "Help")
            sections.setdefault(heading, []).append((names, sentence))
        width = max(len(names) for rows in sections.values() for names, _ in rows)
        for heading, rows in sections.items():
            with formatter.section(heading):
                formatter.write_dl([(names.ljust(width), sentence) for names, sentence in rows])

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples, each on a line as it is typed."""
        with formatter.section("Examples"):
            for example in (self.epilog or "").splitlines():
                formatter.write(f"  {example.strip()}\n")
