"""With which versions, and when, a result was made."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import torch

from repaint_cli.errors import CheckpointError


def versions() -> dict[str, str]:
    """Return the versions of what results depend on."""
    found = {}
    for name in ("repaint-rl", "torch", "gymnasium", "mujoco", "envpool", "numpy", "numba"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@dataclass
class Origin:
    """With what a run began, and what changed when it went on."""

    versions: dict[str, str]
    """Of the libraries it began with."""
    threads: int
    """How many torch had: gradients of images differ in their last digits with another number."""
    resumed: list[dict[str, Any]] = field(default_factory=list)
    """After which iterations it went on with which other versions."""

    @classmethod
    def now(cls) -> "Origin":
        """Begin with what is here."""
        return cls(versions(), torch.get_num_threads())

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "Origin":
        """Return what a run's record says.

        Raises:
            CheckpointError: it says nothing.
        """
        try:
            return cls(
                dict(record["versions"]), max(1, int(record["threads"])), list(record["resumed"])
            )
        except (KeyError, TypeError, ValueError) as error:
            raise CheckpointError(f"run.json does not say with what it began: {error}") from error

    def go_on(self, k: int) -> list[str]:
        """Note other versions after iteration k; return what to say of them."""
        theirs, ours = self.versions, versions()
        for later in self.resumed:
            theirs = later["versions"]
        changed = [
            f"{name} {theirs.get(name)} → {ours.get(name)}"
            for name in sorted(theirs.keys() | ours.keys())
            if theirs.get(name) != ours.get(name)
        ]
        if not changed:
            return []
        self.resumed.append({"after": k, "versions": ours})
        return [f"the run goes on with other versions ({', '.join(changed)}): not bit for bit"]

    def record(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {"versions": self.versions, "threads": self.threads, "resumed": self.resumed}


def stamp() -> str:
    """Return the local time as a folder's name, to the second."""
    return datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
