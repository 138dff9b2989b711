"""What was meant, where words of a command line are none of its options and arguments."""

from collections.abc import Mapping, Sequence
from typing import Any

from repaint_cli.files.commands import quoted


def for_extra_words(
    command: str, words: Sequence[str], given: Mapping[str, Any], arguments: Sequence[str]
) -> str:
    """Return an error's text about words that no argument takes.

    Args:
        command: as it is typed, such as `repaint transfer`.
        words: that are too many.
        given: the values of the command's parameters, by name.
        arguments: what the command takes without an option.
    """
    surplus = " ".join(map(quoted, words))
    if arguments or "task" not in given:
        wanted = f"{' '.join(arguments)} and options" if arguments else "options alone"
        return f"expected {wanted}, found also: {surplus}."
    *teachers, last = map(quoted, words)
    options = [f"--teacher {word}" for word in teachers] if "teacher" in given else []
    is_teacher = given["task"] and "teacher" in given
    options.append(f"--teacher {last}" if is_teacher else f"--task {last}")
    return f"expected options, found {surplus}; did you mean: {command} {' '.join(options)}?"


def for_unknown_option(name: str) -> str:
    """Return an error's text about an option that is a setting elsewhere; empty where none is."""
    from repaint_cli.settings import PPOConfig
    from repaint_cli.tasks.setting_names import SYNONYMS, same_settings

    known = dict.fromkeys([*(f"ppo.{key}" for key in PPOConfig.model_fields), *SYNONYMS])
    meant = same_settings(name.lstrip("-"), known)
    return f"No such option: {name}; did you mean --set {meant[0]}=VALUE?" if meant else ""
