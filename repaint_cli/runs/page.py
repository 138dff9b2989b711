"""report.html: one run or several as one file that any browser shows; what both kinds have."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from repaint_cli import __version__
from repaint_cli.files.atomic import write_text
from repaint_cli.report.html import render_page
from repaint_cli.runs import page_tables
from repaint_cli.runs.comparison import Comparison
from repaint_cli.runs.comparison_words import (
    paper_alike,
    ran_away,
    seeds_can_show,
    unreached,
    verdicts,
)
from repaint_cli.runs.glossary import GLOSSARY, MEANING_OF
from repaint_cli.runs.page_curves import curves_json, note_of
from repaint_cli.runs.reader import RecordedRun

MOST_ALARMS = 30
"""Alarms that a page shows."""

Values = dict[str, Any]
"""What the template page.html is given, by name."""


def write_page(
    page: Path, own: Values, runs: Mapping[str, RecordedRun], comparison: Comparison
) -> Path:
    """Write a page; return it.

    Args:
        page: where to.
        own: what this kind of page says beside the curves and tables.
        runs: by their labels.
        comparison: their numbers.

    Raises:
        CheckpointError: the alarms of a run are damaged.
        StoreError: the page cannot be written.
    """
    common = _of_runs(runs) | _of_comparison(comparison)
    targets = page_tables.targets(runs, comparison)
    common |= Values(targets=targets, data=curves_json(runs, targets["levels"]))
    write_text(page, render_page(common | own))
    return page


def _of_runs(runs: Mapping[str, RecordedRun]) -> Values:
    """Return what a page says of its runs one by one, and of all pages."""
    alarms_heads, alarms = page_tables.alarms(runs)
    more = len(alarms) - MOST_ALARMS
    return Values(
        version=__version__,
        curves_note=note_of(runs),
        alarms_heads=alarms_heads,
        alarms=alarms[:MOST_ALARMS],
        more_alarms=f"{more} more are in run.json." if more > 0 else "",
        glossary=[{"id": i, "name": name, "text": text} for i, name, text in GLOSSARY],
        glossary_of=MEANING_OF,
    )


def _of_comparison(comparison: Comparison) -> Values:
    """Return what a page says of its runs beside each other."""
    scores_heads, scores = page_tables.scores(comparison)
    gaps_heads, gaps = page_tables.differences(comparison)
    ladder_heads, ladder, earlier = page_tables.ladder(comparison)
    several = len(ladder_heads) > 1
    return Values(
        verdicts=[*verdicts(comparison), *ran_away(comparison)],
        scores_heads=scores_heads,
        scores=scores,
        reference=comparison.reference,
        gaps_heads=gaps_heads,
        gaps=gaps,
        can_show=[*map(_sentence, seeds_can_show(comparison))],
        ladder_heads=ladder_heads,
        ladder=ladder if several else [],
        earlier=earlier if several else [],
        unreached=[*map(_sentence, unreached(comparison))],
        iterations=comparison.iterations,
        targets_picture=None,
        profiles_picture=None,
        alike=paper_alike(comparison) if gaps else None,
        no_difference=None,
    )


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."
