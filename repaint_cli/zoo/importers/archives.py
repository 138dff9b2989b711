"""Zip files and PyTorch weights of other programs, read with limits; nothing in them runs."""

import io
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch import Tensor

from repaint_cli.errors import CheckpointError

MAX_BYTES = 512 * 2**20
"""Bytes that a file, or an unpacked part of it, may have."""

WRAPPERS = {"_orig_mod", "module"}
"""Names that `torch.compile` and `DataParallel` put before those of what they wrap."""


def read_members(
    data: bytes, where: str, names: Iterable[str], optional: Iterable[str] = ()
) -> dict[str, bytes]:
    """Return some parts of a zip file, unpacked in memory.

    Args:
        data: the file.
        where: its name, for messages.
        names: of the parts; all others are ignored.
        optional: more names, of parts that may be absent.

    Raises:
        CheckpointError: the file is no whole zip file, lacks a part, or a part is too large.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            present = [name for name in optional if name in archive.namelist()]
            return {name: _member(archive, name, where) for name in (*names, *present)}
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError, OSError) as error:
        raise CheckpointError(f"{where} is not a whole zip file ({error})") from error


def _member(archive: zipfile.ZipFile, name: str, where: str) -> bytes:
    if name not in archive.namelist():
        raise CheckpointError(f"{where}: expected a part '{name}', found none")
    info = archive.getinfo(name)
    plain = info.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
    if info.file_size > MAX_BYTES or not plain:
        raise CheckpointError(
            f"{where}: expected a part '{name}' of at most {MAX_BYTES} bytes, stored or deflated, "
            f"found {info.file_size} by method {info.compress_type}"
        )
    with archive.open(info) as file:
        return file.read(MAX_BYTES)


def read_tensors(data: bytes, where: str) -> dict[str, Tensor]:
    """Return the tensors of a file that `torch.save` wrote from a `state_dict`.

    Names are as they were before a module was compiled or made parallel.

    Raises:
        CheckpointError: the file is damaged, holds anything but tensors by name, or holds numbers
            that are not finite or of another type than float32.
    """
    _check_unpacked(data, where)
    try:
        tensors = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises errors of many kinds
        reason = str(error).strip().partition("\n")[0][:120]
        raise CheckpointError(f"{where} holds no plain tensors ({reason})") from error
    if not isinstance(tensors, dict) or not all(isinstance(name, str) for name in tensors):
        raise CheckpointError(f"{where}: expected tensors by name, found {type(tensors).__name__}")
    for name, tensor in tensors.items():
        _check_tensor(name, tensor, len(data), where)
    return _unwrapped(tensors, where)


def _unwrapped(tensors: Mapping[str, Tensor], where: str) -> dict[str, Tensor]:
    """Return tensors by their names without those of wrappers, which may be in any place."""
    names = {
        ".".join(part for part in name.split(".") if part not in WRAPPERS): name for name in tensors
    }
    if len(names) < len(tensors):
        (twice, *_) = sorted(tensors.keys() - names.values())
        raise CheckpointError(f"{where}: found '{twice}' both wrapped and not wrapped")
    return {short: tensors[name] for short, name in names.items()}


def _check_unpacked(data: bytes, where: str) -> None:
    """Check that a file is as `torch.save` writes it: a zip file whose parts are not compressed."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            parts = archive.infolist()
    except (zipfile.BadZipFile, ValueError, OSError) as error:
        raise CheckpointError(f"{where} is not as torch.save writes it ({error})") from error
    stored = all(part.compress_type == zipfile.ZIP_STORED for part in parts)
    if not stored or sum(part.file_size for part in parts) > len(data):
        raise CheckpointError(f"{where}: expected parts as torch.save stores them, found packed")


def _check_tensor(name: str, tensor: Any, size: int, where: str) -> None:
    """Check that a tensor is plain and no larger than its file, before it is used."""
    plain = type(tensor) is Tensor and tensor.layout is torch.strided
    if not plain or tensor.device.type != "cpu" or tensor.dtype != torch.float32:
        kind = f"{tensor.dtype} {tensor.device}" if isinstance(tensor, Tensor) else type(tensor)
        raise CheckpointError(
            f"{where}: expected numbers in single precision in '{name}', found {kind}"
        )
    if tensor.numel() * tensor.itemsize > size or not tensor.is_contiguous():
        raise CheckpointError(
            f"{where}: '{name}' claims {tuple(tensor.shape)} numbers that the file does not hold"
        )
    if not torch.isfinite(tensor).all():
        raise CheckpointError(f"{where}: '{name}' holds numbers that are not finite")
