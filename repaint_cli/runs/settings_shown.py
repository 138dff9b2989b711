"""The settings of a run that are no defaults, and those in which runs differ, as rows of texts."""

from collections.abc import Mapping
from typing import Any

from pydantic_core import PydanticUndefined

from repaint_cli.runs.command import shipped_card, toml_value
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.settings import Settings
from repaint_cli.tasks.card import TaskCard

LONGEST = 80
"""Letters of a value that are shown."""

ABSENT = "-"


def chosen_settings(run: RecordedRun) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the settings of a run that are no defaults or not its card's."""
    card, own, usual = shipped_card(run.task), _settings(run.task), _defaults(run.task)
    shipped = own if card is None else _settings(card)
    meaning = _sentences(run.task)
    heads = ["setting", "this run", *([] if card is None else ["its card"]), "default", "meaning"]
    rows = []
    for name in sorted(own.keys() | shipped.keys()):
        texts = [_text(own, name), _text(shipped, name), _text(usual, name)]
        if texts[0] == texts[1] and (texts[0] == texts[2] or (card and name not in usual)):
            continue
        shown = texts if card is not None else texts[::2]
        rows.append([name, *shown, meaning.get(name, "")])
    return heads, rows


def differing_settings(runs: Mapping[str, RecordedRun]) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the settings that are not the same in all runs, by their labels."""
    each = [_begun_with(run) | _settings(run.task) for run in runs.values()]
    names = dict.fromkeys(name for settings in each for name in settings)
    rows = []
    for name in names:
        texts = [_text(settings, name) for settings in each]
        if len(set(texts)) > 1:
            rows.append([name, *texts])
    return ["setting", *runs], rows


def _begun_with(run: RecordedRun) -> dict[str, Any]:
    """Return what a run was begun with beside its card."""
    record = run.record
    facts: dict[str, Any] = {
        "method": record.method,
        "algorithm": record.algorithm,
        "teachers": " and ".join(teacher.name for teacher in record.teachers) or "none",
        "seeds": record.seeds,
    }
    return facts | {f"version of {name}": version for name, version in record.versions.items()}


def _settings(task: TaskCard) -> dict[str, Any]:
    """Return a card's settings by `section.key`."""
    return {
        f"{section}.{key}": value
        for section, values in task.model_dump(mode="json").items()
        if isinstance(values, Mapping)
        for key, value in values.items()
    }


def _sections(task: TaskCard) -> dict[str, Settings]:
    parts = {name: getattr(task, name) for name in type(task).model_fields}
    return {name: part for name, part in parts.items() if isinstance(part, Settings)}


def _defaults(task: TaskCard) -> dict[str, Any]:
    """Return the defaults of a card's settings, of those that have one."""
    defaults = {}
    for section, part in _sections(task).items():
        for key, field in type(part).model_fields.items():
            default = field.get_default(call_default_factory=True, validated_data={})
            if default is not PydanticUndefined:
                defaults[f"{section}.{key}"] = (
                    list(default) if isinstance(default, tuple) else default
                )
    return defaults


def _sentences(task: TaskCard) -> dict[str, str]:
    sentences = {}
    for section, part in _sections(task).items():
        for key, sentence in type(part).sentences().items():
            sentences[f"{section}.{key}"] = " ".join(sentence.split())
    return sentences


def _text(settings: Mapping[str, Any], name: str) -> str:
    if name not in settings:
        return ABSENT
    value = settings[name]
    text = value if isinstance(value, str) else toml_value(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
