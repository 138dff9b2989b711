"""Arrays of numbers in NumPy's .npy format, read without evaluating anything."""

import re
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_DIMENSIONS = 8

_HEADER = re.compile(
    rb"\x93NUMPY(?:\x01\0..|[\x02\x03]\0....)"
    rb"\{'descr': '(?P<dtype>[<>=|][A-Za-z]\d{0,9})', "
    rb"'fortran_order': (?P<fortran>True|False), 'shape': \((?P<shape>[\d, ]{0,60})\), \} *\n",
    re.DOTALL,
)
"""What numpy.save writes before an array of one type: magic, version, length, and a literal."""


class NotAnArray(ValueError):
    """Bytes that hold no array of numbers; the message names what they hold instead."""


def read_npy(data: bytes, kinds: str) -> NDArray[Any]:
    """Return the array in an .npy file, a read-only view of its bytes.

    Args:
        data: the whole file.
        kinds: the kinds of numbers allowed, as in `numpy.dtype.kind`.

    Raises:
        NotAnArray: the header is not what numpy.save writes, the numbers are of another kind, or
            the bytes after the header are more or fewer than the shape says.
    """
    header = _HEADER.match(data)
    if header is None:
        raise NotAnArray("a header of another kind")
    try:
        dtype = np.dtype(header["dtype"].decode())
    except TypeError as error:
        raise NotAnArray("a header of another kind") from error
    if dtype.kind not in kinds:
        raise NotAnArray(f"an array of {dtype}")
    shape = tuple(int(size) for size in re.findall(rb"\d+", header["shape"]))
    fortran = header["fortran"] == b"True"
    return array_over(data[header.end() :], dtype, shape, fortran=fortran)


def array_over(
    data: bytes | bytearray, dtype: np.dtype[Any], shape: tuple[int, ...], *, fortran: bool = False
) -> NDArray[Any]:
    """Return bytes as an array of this shape, read-only where the bytes are.

    Raises:
        NotAnArray: the shape has too many dimensions, or a size other than that of the bytes.
    """
    if len(shape) > MAX_DIMENSIONS:
        raise NotAnArray("no array of numbers")
    if prod(shape) * dtype.itemsize != len(data):
        raise NotAnArray(f"an array of another size than its {len(data)} bytes")
    try:
        return np.ndarray(shape, dtype, data, order="F" if fortran else "C")
    except (ValueError, OverflowError) as error:  # a dimension beyond 64 bits beside one of 0
        raise NotAnArray("no array of numbers") from error
