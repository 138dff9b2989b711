"""Arrays on a GPU and launches on it: the one place that knows by which library."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import cuda
from numpy.typing import DTypeLike, NDArray

THREADS = 64
"""Of a block in which each thread has a car."""


def upload(array: NDArray[Any]) -> Any:
    """Copy an array to the GPU."""
    return cuda.to_device(np.ascontiguousarray(array))


def given(array: Any, stream: Any) -> Any:
    """Return a caller's array, one on the GPU as it is, one of the host as a copy there."""
    if hasattr(array, "__cuda_array_interface__"):
        return cuda.as_cuda_array(array, sync=False)
    if isinstance(array, np.ndarray | list):
        return cuda.to_device(np.ascontiguousarray(array), stream)
    return array


def finish() -> None:
    """Wait for all that was begun, on whatever stream."""
    cuda.synchronize()


def zeros(shape: Sequence[int], dtype: DTypeLike = np.float64) -> Any:
    """Make an array of zeros on the GPU; one of no elements gets one along each empty axis."""
    return upload(np.zeros([max(length, 1) for length in shape], dtype))


def launch(
    kernel: Any, blocks: int | tuple[int, int], threads: int | tuple[int, int], stream: Any,
    *arguments: Any,
) -> None:  # fmt: skip
    """Run a kernel on a stream, after what was begun there before."""
    kernel[blocks, threads, stream](*arguments)


def launch_each(kernel: Any, n: int, stream: Any, *arguments: Any) -> None:
    """Run a kernel whose n threads each have a number."""
    launch(kernel, -(-n // THREADS), THREADS, stream, *arguments)


def stream_at(pointer: int) -> Any:
    """Return a stream of another library, such as torch's current one; 0 is the default stream."""
    return cuda.external_stream(pointer) if pointer else cuda.default_stream()


class Staging:
    """Rows of numbers that travel to the GPU together, while the host goes on."""

    def __init__(self, n: int, width: int) -> None:
        """Make room for n rows at a time."""
        self.host = cuda.pinned_array((n, width), np.float64)
        """What travels next; not to be changed before the last copy is done."""
        self.array = zeros((n, width))
        """What has come, on the GPU."""

    def send(self, n: int, stream: Any) -> None:
        """Begin the copy of the first n rows."""
        self.array[:n].copy_to_device(self.host[:n], stream)


class Reading:
    """A copy of a small array to the host, which the GPU makes while the host goes on."""

    def __init__(self, array: Any) -> None:
        """Make room for copies of an array."""
        self._array, self._event = array, cuda.event()
        self._host = cuda.pinned_array(array.shape, array.dtype)

    def begin(self, stream: Any) -> None:
        """Begin a copy, of what the array holds after what was begun on the stream before."""
        self._array.copy_to_host(self._host, stream)
        self._event.record(stream)

    def result(self) -> NDArray[Any]:
        """Return the copy that was begun last, once it is done."""
        self._event.synchronize()
        return np.array(self._host)
