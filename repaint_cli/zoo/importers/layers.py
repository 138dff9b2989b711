"""Layers of another library by our names; what is left over is refused."""

from collections.abc import Iterable, Mapping

from torch import Tensor

from repaint_cli.errors import CheckpointError

CAMERA_LAYERS = ("conv0", "conv1", "conv2", "dense")
"""Our names of the layers of the NatureCNN, which Stable-Baselines3 and cleanrl have too."""


def renamed(
    tensors: Mapping[str, Tensor], layers: Mapping[str, str], where: str
) -> dict[str, Tensor]:
    """Return layers by our names, dense ones transposed, so that their inputs come first.

    Args:
        tensors: of the file, by the library's names.
        layers: the library's names of layers, by ours.
        where: the file's name, for messages.

    Raises:
        CheckpointError: a parameter is missing.
    """
    leaves = {}
    for layer, name in layers.items():
        for part in ("weight", "bias"):
            tensor = tensors.get(f"{name}.{part}")
            if tensor is None:
                raise CheckpointError(f"{where}: expected '{name}.{part}', found none")
            leaves[f"{layer}.{part}"] = tensor.T if tensor.ndim == 2 else tensor
    return leaves


def check_nothing_left(
    tensors: Mapping[str, Tensor], layers: Mapping[str, str], others: set[str], where: str
) -> None:
    """Check that every tensor of a file is used.

    Args:
        tensors: of the file, by the library's names.
        layers: the library's names of layers, by ours.
        others: tensors that belong to no layer, or are copies.
        where: the file's name, for messages.

    Raises:
        CheckpointError: a tensor is neither a layer's nor one of the others.
    """
    known = {f"{name}.{part}" for name in layers.values() for part in ("weight", "bias")}
    for name in sorted(tensors.keys() - known - others):
        raise CheckpointError(f"{where}: '{name}' belongs to no policy that can be read here")


def widths(tensors: Mapping[str, Tensor], layers: Iterable[str], where: str) -> tuple[int, ...]:
    """Return the widths of dense layers.

    Args:
        tensors: of the file, by the library's names.
        layers: the library's names of the layers.
        where: the file's name, for messages.

    Raises:
        CheckpointError: a layer's bias is missing, empty, or no vector.
    """
    names = [f"{layer}.bias" for layer in layers]
    for name in names:
        if name not in tensors or tensors[name].ndim != 1 or not len(tensors[name]):
            raise CheckpointError(f"{where}: expected a layer's '{name}', found none")
    return tuple(len(tensors[name]) for name in names)
