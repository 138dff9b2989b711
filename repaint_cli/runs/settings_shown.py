"""The settings of a run that are no defaults, and those in which runs differ, as rows of texts."""

from collections.abc import Mapping
from typing import Any

from pydantic_core import PydanticUndefined, to_jsonable_python

from repaint_cli.runs.reader import RecordedRun
from repaint_cli.runs.run_command import shipped_card
from repaint_cli.settings import Settings
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_settings import differing, setting_text, settings_of

LONGEST = 80
"""Letters of a value that are shown."""


def chosen_settings(run: RecordedRun) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the settings of a run that are no defaults or not its card's."""
    card, own, usual = shipped_card(run.task), settings_of(run.task), _defaults(run.task)
    shipped = own if card is None else settings_of(card)
    meaning = _sentences(run.task)
    heads = ["setting", "this run", *([] if card is None else ["its card"]), "default", "meaning"]
    rows = []
    for name in sorted(own.keys() | shipped.keys()):
        values = [settings.get(name) for settings in (own, shipped, usual)]
        if values[0] == values[1] and (values[0] == values[2] or (card and name not in usual)):
            continue
        each = (own, usual) if card is None else (own, shipped, usual)
        shown = [setting_text(settings, name, LONGEST) for settings in each]
        rows.append([name, *shown, meaning.get(name, "")])
    return heads, rows


def differing_settings(runs: Mapping[str, RecordedRun]) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the settings that are not the same in all runs, by their labels."""
    each = [_begun_with(run) | settings_of(run.task) for run in runs.values()]
    rows = [
        [name, *(setting_text(settings, name, LONGEST) for settings in each)]
        for name in differing(*each)
    ]
    return ["setting", *runs], rows


def _begun_with(run: RecordedRun) -> dict[str, Any]:
    """Return what a run was begun with beside its card."""
    record = run.record
    facts: dict[str, Any] = {
        "method": record.method,
        "algorithm": record.algorithm,
        "teachers": " and ".join(teacher.label for teacher in record.teachers) or "none",
        "seeds": record.seeds,
    }
    return facts | {f"version of {name}": version for name, version in record.versions.items()}


def _sections(task: TaskCard) -> dict[str, Settings]:
    parts = {name: getattr(task, name) for name in type(task).model_fields}
    return {name: part for name, part in parts.items() if isinstance(part, Settings)}


def _defaults(task: TaskCard) -> dict[str, Any]:
    """Return the defaults of a card's settings as JSON has them, of those that have one."""
    defaults = {}
    for section, part in _sections(task).items():
        for key, field in type(part).model_fields.items():
            default = field.get_default(call_default_factory=True, validated_data={})
            if default is not PydanticUndefined:
                defaults[f"{section}.{key}"] = to_jsonable_python(default)
    return defaults


def _sentences(task: TaskCard) -> dict[str, str]:
    sentences = {}
    for section, part in _sections(task).items():
        for key, sentence in type(part).sentences().items():
            sentences[f"{section}.{key}"] = " ".join(sentence.split())
    return sentences
