"""Do all machines of a cluster see the folder of runs, and have they the same versions?

Asked before anything is trained: else runs would lie somewhere on other disks.
"""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from repaint_cli.engines import ray_node
from repaint_cli.engines.options import RunsWatcher
from repaint_cli.engines.ray_cluster import Cluster
from repaint_cli.errors import EngineError
from repaint_cli.files.atomic import write_text
from repaint_cli.files.provenance import versions

SECONDS = 180.0
"""For a machine to answer; a process has to be started there."""


class Probe:
    """Markers in the folders of runs, by which machines know them."""

    def __init__(self, cluster: Cluster, driver: str, watcher: RunsWatcher) -> None:
        self._cluster, self._driver, self._watcher = cluster, driver, watcher
        self._marked = set[Path]()
        self._noted = set[str]()

    def look(self, roots: Sequence[str], environment: dict[str, Any]) -> None:
        """Have all machines look for folders; put a marker into each first, which stays.

        Raises:
            EngineError: a machine does not see one, or cannot run repaint.
            StoreError: a folder cannot be written.
        """
        new = [root for root in roots if self._marker(root) not in self._marked]
        if not new:
            return
        for root in new:
            write_text(self._marker(root), self._driver)
            self._marked.add(self._marker(root))
        for name, report in self._answers(new, environment):
            unseen = [r for r in new if r in report.unseen or not self._sign(r, name).is_file()]
            if unseen:
                raise EngineError(ray_node.not_seen(report.host, unseen[0]))
            for root in new:
                self._sign(root, name).unlink(missing_ok=True)
            self._compare(report)

    def _answers(
        self, roots: Sequence[str], environment: dict[str, Any]
    ) -> list[tuple[str, ray_node.NodeReport]]:
        """Return what each machine says, by a name for it."""
        ray = self._cluster.ray
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        probe = ray.remote(num_cpus=0, max_calls=1, runtime_env=environment)(ray_node.probe)
        asked = []
        for node in self._cluster.nodes():
            only = NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)
            name = node["NodeID"][:12]
            own = probe.options(scheduling_strategy=only).remote(self._driver, name, list(roots))
            asked.append((node["NodeManagerHostname"], name, own))
        answers = []
        for host, name, reference in asked:
            try:
                report = self._cluster.waiting(ray.get, reference, timeout=SECONDS)
                answers.append((name, report))
            except ray.exceptions.GetTimeoutError as error:
                raise EngineError(
                    f"machine {host} does not answer within {SECONDS:.0f} s; is it busy or gone?"
                ) from error
            except ray.exceptions.RayError as error:
                line = str(error).strip().splitlines()[-1].strip()
                raise EngineError(
                    f"machine {host} cannot run repaint ({line:.200}); install the same version "
                    "there"
                ) from error
        return answers

    def _compare(self, report: ray_node.NodeReport) -> None:
        """Say once in which versions a machine differs from this one."""
        here, there = versions(), report.versions
        other = [
            f"{name} {there.get(name)} (here {here.get(name)})"
            for name in sorted(here.keys() | there.keys())
            if here.get(name) != there.get(name)
        ]
        if other and report.host not in self._noted:
            self._noted.add(report.host)
            self._watcher.notice(
                f"machine {report.host} has {', '.join(other)}: its runs are not equal bit for bit"
            )

    def _marker(self, root: str) -> Path:
        return Path(root) / ray_node.marker_name(self._driver)

    def _sign(self, root: str, name: str) -> Path:
        """Return the file that a machine leaves."""
        return Path(f"{self._marker(root)}-{name}")

    def close(self) -> None:
        """Take all markers away."""
        for marker in self._marked:
            for path in (marker, *marker.parent.glob(f"{marker.name}-*")):
                with suppress(OSError):
                    path.unlink()
