"""Are all dependencies pinned as installed, and is a known vulnerability among them?

Run by `make audit`. The first question is answered here; the second by pip-audit, which asks the
package index. Where that cannot be reached, offline, the answer says so and is no
failure.
"""

import json
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

CONSTRAINTS = Path(__file__).parent.parent / "constraints.txt"
SECONDS = 600
"""What pip-audit may take."""


def normal(name: str) -> str:
    """Return a distribution's name as the index compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned() -> dict[str, str]:
    """Return the versions in constraints.txt."""
    lines = CONSTRAINTS.read_text(encoding="utf-8").split()
    return {normal(name): version for name, version in (line.split("==") for line in lines)}


def installed(root: str) -> dict[str, str]:
    """Return the versions of all that a distribution, with all its extras, needs here."""
    extras = frozenset(distribution(root).metadata.get_all("Provides-Extra") or ())
    versions, seen, waiting = dict[str, str](), set[object](), [(root, extras)]
    while waiting:
        name, extras = waiting.pop()
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        try:
            needs = distribution(name)
        except PackageNotFoundError:
            continue  # of an extra that is not installed
        if name != normal(root):
            versions[name] = needs.version.partition("+")[0]
        waiting += [
            (normal(need.name), frozenset(need.extras))
            for need in map(Requirement, needs.requires or ())
            if not need.marker or any(need.marker.evaluate({"extra": e}) for e in extras or [""])
        ]
    return versions


def unpinned() -> list[str]:
    """Return what is installed in another version than constraints.txt says, or not in it."""
    known = pinned()
    return [
        f"{name} {version} is installed, constraints.txt says {known.get(name, 'nothing')}"
        for name, version in sorted(installed("repaint-rl").items())
        if known.get(name) != version
    ]


def vulnerable(tool: str) -> tuple[list[str], int, str]:
    """Return known vulnerabilities, of how many pinned versions anything is known, and why so."""
    words = [tool, "-r", str(CONSTRAINTS), "--no-deps", "--disable-pip", "--format", "json",
             "--progress-spinner", "off"]  # fmt: skip
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=SECONDS, check=False)
        looked_at = json.loads(done.stdout)["dependencies"]
    except (OSError, subprocess.TimeoutExpired) as error:
        return [], 0, f"pip-audit did not run ({type(error).__name__})"
    except (ValueError, LookupError):
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        return [], 0, f"pip-audit got no answer ({lines[-1]:.120})"
    known = [one for one in looked_at if "vulns" in one]
    vulnerabilities = [
        f"{one['name']} {one['version']}: {vuln['id']}, mended in "
        f"{', '.join(vuln['fix_versions']) or 'no version yet'}"
        for one in known
        for vuln in one["vulns"]
    ]
    return (
        vulnerabilities,
        len(known),
        f"{len(looked_at)} versions looked up, {len(known)} known to the index",
    )


def main() -> None:
    """Print what was found; end with 1 where something has to be done."""
    problems = unpinned()
    print("\n".join(problems) or "every dependency is installed as constraints.txt pins it")
    vulnerabilities, known, why = vulnerable(sys.argv[1])
    if known:
        print("\n".join(vulnerabilities) or f"no known vulnerability: {why}")
    else:
        print(f"known vulnerabilities could not be looked up: {why}")
    sys.exit(1 if problems or vulnerabilities else 0)


if __name__ == "__main__":
    main()
