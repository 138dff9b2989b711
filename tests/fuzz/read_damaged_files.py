"""A process that reads thousands of spoiled files and says what came of it, as JSON.

test_damaged_files.py runs it as a program with the number of files: an audit hook cannot be taken
off again, and memory is a process's own.
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
"""Events that nothing that only reads has a reason for."""


@dataclass
class Watch:
    """Notes what files make their readers do, while it is on."""

    on: bool = False
    seen: list[str] = field(default_factory=list)

    def hook(self, event, args):
        if self.on and self.forbidden(event, args):
            self.seen.append(f"{event} {args!r:.200}")

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
    """A reader did not come back."""


def too_long(*_):
    raise TooLong


def forget_peak():
    with suppress(OSError):  # where it cannot be forgotten, only new peaks are seen
        Path("/proc/self/clear_refs").write_text("5")


def peak():
    """The most memory that this process has had since the peak was forgotten, bytes."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return int(re.search(r"VmHWM:\s+(\d+)", status)[1]) * 1024


@cache
def watch():
    """The process's one watch: a hook stays for good."""
    one = Watch()
    sys.addaudithook(one.hook)
    return one


@dataclass
class Judge:
    """Has a file read, and keeps what should not have happened."""

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
                self.blame(name, data, f"a message of {len(str(error))} characters")
        except (Exception, TooLong):
            self.blame(name, data, traceback.format_exc()[-1500:])

    @contextmanager
    def watched(self, name, data):
        """Measure time and memory of what is done, and note what it does."""
        forget_peak()
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
                self.blame(name, data, f"{grown:,} bytes of memory")
            if watch().seen:
                self.blame(name, data, "; ".join(watch().seen))
                watch().seen.clear()

    def blame(self, name, data, what):
        self.failures.append(
            f"{name}, case {self.counts['cases']}, {len(data)} bytes {data[:300]!r}: {what}"
        )


def graft(judge, name, target, n_cases):
    """Have hypothesis put values where they do not belong."""

    @settings(
        max_examples=n_cases, phases=[Phase.generate], derandomize=True, deadline=None,
        database=None, suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(target.cases(target.sound))
    def judged(data):
        judge.case(name, target, data)

    judged()


def judge_all(targets, judge, n_cases):
    """A third of the cases are grafted by hypothesis, the others spoiled byte by byte."""
    others = [target.sound for target in targets.values()]
    for name, target in targets.items():
        share = n_cases // len(targets) + 1

        before = judge.counts["cases"]
        graft(judge, name, target, share // 3 + 1)
        rng = random.Random(name)
        while judge.counts["cases"] < before + share:
            judge.case(name, target, damage.spoiled(rng, target.sound, others))
        target.path.write_bytes(target.sound)


def main(n_cases):
    warnings.simplefilter("error")
    judge = Judge()
    began = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        targets = all_targets(Path(folder))
        for _ in range(2):  # compiles and imports what comes late
            for target in targets.values():
                target.read()
        graft(Judge(), *next(iter(targets.items())), 20)  # hypothesis makes its tables
        judge_all(targets, judge, n_cases)
        ran = os.path.exists("ran")
    told = {
        **judge.counts,
        "targets": len(targets),
        "ran": ran,
        "seconds": round(perf_counter() - began, 1),
        "slowest": round(judge.slowest, 2),
        "grown": judge.grown,
        "failures": judge.failures[:20],
    }
    sys.stdout.write(json.dumps(told, indent=1))


if __name__ == "__main__":
    main(int(sys.argv[1]))
