"""What Gymnasium warns of, in our words."""

import re

WORDS = (
    (r"The environment (\S+) is out of date.*version `(\w+)`.*",
     r"\1 is out of date; Gymnasium has \2 of it"),
    (r"Overriding environment (\S+) already in registry.*",
     r"\1 is registered twice; the last one counts"),
    (r"The obs returned by the `(\w+)\(\)` method was expecting numpy array dtype to be (\w+), "
     r"actual type: (\w+).*", r"\1() returns observations of \3 where their space says \2"),
    (r"The obs returned by the `(\w+)\(\)` method is not within the observation space.*",
     r"\1() returns observations that are not in their space"),
    (r"The reward returned by `step\(\)` must be a float.*actual type: (.*)",
     r"step() returns a reward of \1, no float"),
)  # fmt: skip
"""Texts of Gymnasium 1, and what they mean."""


def in_our_words(text: str) -> str | None:
    """Return a warning of Gymnasium's as a line, or None of another library's."""
    kind, _, rest = text.strip().partition(": ")
    if kind not in ("WARN", "ERROR"):
        return None
    line = " ".join(rest.split())
    for pattern, words in WORDS:
        if match := re.fullmatch(pattern, line):
            return f"the environment: {match.expand(words)}"
    return f"Gymnasium says of the environment: {line}"
