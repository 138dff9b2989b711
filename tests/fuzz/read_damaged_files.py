"""A process that reads thousands of damaged files and prints the outcomes as JSON.

test_damaged_files.py runs it as a program with the number of files: an audit hook cannot be removed
again, and memory is a process's own.
"""

import json
import os
import random
import re
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from time import perf_counter

import damage
from hypothesis import HealthCheck, Phase, given, settings
from read_targets import all_targets

from repaint_cli.errors import RepaintError

SECONDS = 5.0
"""Within which a file of a few kilobytes is to be read."""
MEMORY = 100 * 2**20
"""Bytes that reading may take beside twice the file."""

BANNED = (
    "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.startfile", "subprocess.", "pty.",
    "pickle.", "marshal.load", "socket.", "urllib.", "webbrowser.", "ctypes.dlopen", "shutil.",
    "os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.chmod",
)  # fmt: skip
"""Events that a reader of files has no reason for."""


@dataclass
class Watch:
    """Notes what files make their readers do, while it is on."""

    on: bool = False
    events: list[str] = field(default_factory=list)

    def hook(self, event, args):
        if self.on and self.forbidden(event, args):
            self.events.append(f"{event} {args!r:.200}")

    def forbidden(self, event, args):
        if event == "open":
            return isinstance(args[2], int) and bool(
                args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
            )
        if event == "compile":  # an import compiles what lies on the disk
            return not os.path.exists(os.fsdecode(args[1] or ""))
        if event == "exec":
            return not os.path.exists(args[0].co_filename)
        return event.startswith(BANNED)


class TooLong(BaseException):
    """A reader took too long."""


def too_long(*_):
    raise TooLong


def reset_peak():
    with suppress(OSError):  # where it cannot be reset, only new peaks are measured
        Path("/proc/self/clear_refs").write_text("5")


def peak():
    """The most memory that this process has had since the peak was reset, bytes."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return int(re.search(r"VmHWM:\s+(\d+)", status)[1]) * 1024


@cache
def watch():
    """The process's only watch: a hook cannot be removed."""
    one = Watch()
    sys.addaudithook(one.hook)
    return one


@dataclass
class Reading:
    """Has files read, counts the outcomes, and keeps failures."""

    counts: Counter = field(default_factory=Counter)
    failures: list = field(default_factory=list)
    slowest: float = 0.0
    grown: int = 0

    def case(self, name, target, data):
        target.path.write_bytes(data)
        self.counts["cases"] += 1
        try:
            with self.watched(name, data):
                target.read()
            self.counts["read"] += 1
        except RepaintError as error:
            self.counts["refused"] += 1
            if len(str(error)) > 1000:
                self.add_failure(name, data, f"a message of {len(str(error))} characters")
        except (Exception, TooLong):
            self.add_failure(name, data, traceback.format_exc()[-1500:])

    @contextmanager
    def watched(self, name, data):
        """Measure time and memory of what is done, and note what it does."""
        reset_peak()
        before, began = peak(), perf_counter()
        handler = signal.signal(signal.SIGALRM, too_long)
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
        watch().on = True
        try:
            yield
        finally:
            watch().on = False
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, handler)
            self.slowest = max(self.slowest, perf_counter() - began)
            grown = peak() - before
            self.grown = max(self.grown, grown)
            if grown > MEMORY + 2 * len(data):
                self.add_failure(name, data, f"{grown:,} bytes of memory")
            if watch().events:
                self.add_failure(name, data, "; ".join(watch().events))
                watch().events.clear()

    def add_failure(self, name, data, what):
        self.failures.append(
            f"{name}, case {self.counts['cases']}, {len(data)} bytes {data[:300]!r}: {what}"
        )


def graft(reading, name, target, n_cases):
    """Have hypothesis put values where they do not belong."""

    @settings(
        max_examples=n_cases, phases=[Phase.generate], derandomize=True, deadline=None,
        database=None, suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(target.cases(target.sound))
    def read_case(data):
        reading.case(name, target, data)

    read_case()


def read_all(targets, reading, n_cases):
    """A third of the cases are grafted by hypothesis, the others spoiled byte by byte."""
    others = [target.sound for target in targets.values()]
    for name, target in targets.items():
        share = n_cases // len(targets) + 1

        before = reading.counts["cases"]
        graft(reading, name, target, share // 3 + 1)
        rng = random.Random(name)
        while reading.counts["cases"] < before + share:
            reading.case(name, target, damage.spoiled(rng, target.sound, others))
        target.path.write_bytes(target.sound)


def main(n_cases):
    warnings.simplefilter("error")
    reading = Reading()
    began = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        targets = all_targets(Path(folder))
        for _ in range(2):  # compiles and imports what comes late
            for target in targets.values():
                target.read()
        graft(Reading(), *next(iter(targets.items())), 20)  # hypothesis makes its tables
        read_all(targets, reading, n_cases)
        ran = os.path.exists("ran")
    result = {
        **reading.counts,
        "targets": len(targets),
        "ran": ran,
        "seconds": round(perf_counter() - began, 1),
        "slowest": round(reading.slowest, 2),
        "grown": reading.grown,
        "failures": reading.failures[:20],
    }
    sys.stdout.write(json.dumps(result, indent=1))


if __name__ == "__main__":
    main(int(sys.argv[1]))
