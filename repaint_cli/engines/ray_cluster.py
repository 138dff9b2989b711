"""A Ray cluster: found, or started on this machine."""

import logging
import os
import signal
import socket
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

from repaint_cli.engines.options import RunsWatcher
from repaint_cli.errors import EngineError
from repaint_cli.process import standing_in

REACH_SECONDS = 5.0
"""For the machine at an address to answer: Ray itself would wait for ever."""
LOCAL = "local"


class Cluster:
    """A connection to a cluster; `ray` is the library."""

    def __init__(self, address: str) -> None:
        """Connect to a cluster.

        Args:
            address: HOST:PORT, ray://HOST:PORT, auto, or local for one of this machine; where
                empty, what RAY_ADDRESS names or runs on this machine, else one of this machine.

        Raises:
            EngineError: there is no cluster at the address.
        """
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # which would ask a network
        import ray

        self.ray: Any = ray
        self.own = False
        """Whether it was started here."""
        self._connected = not ray.is_initialized()
        if self._connected:
            self._connect(address or os.environ.get("RAY_ADDRESS", ""))

    def _connect(self, address: str) -> None:
        _check_reachable(address)
        self._place = tempfile.TemporaryDirectory(prefix="repaint-ray-")
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            with standing_in(self._place.name):  # which Ray puts on the search path of processes
                if address in ("", "auto"):
                    self._find(start=address == "")
                else:
                    self._init(address)
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            self._place.cleanup()
            line = (str(error).strip().splitlines() or [type(error).__name__])[0]
            raise EngineError(f"expected a Ray cluster at {address or 'auto'}: {line}") from error
        finally:
            with suppress(ValueError):  # not in the main thread
                for number, handler in before.items():
                    signal.signal(number, handler)

    def _find(self, *, start: bool) -> None:
        try:
            self._init("auto")
        except ConnectionError:
            if not start:
                raise
            self._init(LOCAL)

    def _init(self, address: str) -> None:
        local = {"include_dashboard": False} if address == LOCAL else {}
        self.ray.init(address, logging_level=logging.ERROR, log_to_driver=False, **local)
        self.own = address == LOCAL

    def waiting(self, call: Callable[..., Any], *values: Any, **named: Any) -> Any:
        """Call what waits in Ray, in a thread: there a signal would end in an error of Ray's."""
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(call, *values, **named).result()

    def nodes(self) -> list[dict[str, Any]]:
        """Return the machines that live, as Ray describes them."""
        return [node for node in self.ray.nodes() if node["Alive"]]

    def check_room(self, cpus: int, gpus: float, watcher: RunsWatcher) -> None:
        """Check that a machine has room for a run.

        Raises:
            EngineError: none has, and none will come.
        """
        rooms = [node["Resources"] for node in self.nodes()]
        if any(room.get("CPU", 0) >= cpus and room.get("GPU", 0) >= gpus for room in rooms):
            return
        largest = max((room.get("CPU", 0) for room in rooms), default=0)
        most = max((room.get("GPU", 0) for room in rooms), default=0)
        text = (
            f"no machine has {cpus} CPUs{f' and {gpus:g} GPUs' if gpus else ''} for a run, found "
            f"at most {largest:g} CPUs and {most:g} GPUs"
        )
        if self.own:
            raise EngineError(f"{text}; take a smaller --cpus-per-run or --gpus-per-run")
        watcher.notice(f"{text}; runs wait until one comes")

    def close(self) -> None:
        """Leave the cluster, unless whoever called had connected to it before."""
        if self._connected:
            self.ray.shutdown()
            self._place.cleanup()


def _check_reachable(address: str) -> None:
    """Check that something answers at HOST:PORT.

    Raises:
        EngineError: nothing does.
    """
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon or not port.isdecimal():
        if address in ("", "auto", LOCAL):
            return
        raise EngineError(
            f"expected --engine ray:HOST:PORT, ray:auto or ray:local, found ray:{address}"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), REACH_SECONDS).close()
    except (OSError, OverflowError) as error:
        raise EngineError(
            f"expected a Ray cluster at {address}, nothing answers there ({error}); begin one: ray "
            "start --head"
        ) from error
