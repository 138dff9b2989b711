"""A teacher that acts: observations in, actions out."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from repaint_cli.errors import TeacherMismatch
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.zoo.store import read_teacher
from repaint_cli.zoo.teacher_card import TeacherCard


@dataclass(frozen=True)
class LoadedTeacher:
    """A teacher from its file."""

    card: TeacherCard
    """The card in its file: task, score, spaces, origin."""
    network: ActorCritic
    """Its policy and critic, with a seed axis of 1."""

    @classmethod
    def read(cls, path: Path) -> "LoadedTeacher":
        """Read a teacher's file.

        Raises:
            CheckpointError: the file is damaged.
        """
        network, card = read_teacher(path)
        return cls(card, network)

    def act(self, observations: Any) -> np.ndarray:
        """Return the most likely actions.

        Args:
            observations: as the environment gives them, (B, *O), or one of them, (*O,); by name,
                {"camera": …, "lidar": …}, where there are several.

        Returns:
            Actions, (B, A), (B,) numbers of discrete ones or (B, P) of compound ones; without B for
            one observation. They are not clipped to the environment's bounds.

        Raises:
            TeacherMismatch: the observations are of other shapes.
        """
        named = isinstance(observations, Mapping)
        arrays = {n: np.asarray(part) for n, part in observations.items()} if named else {}
        arrays = arrays or {"": np.asarray(observations)}
        single = self._is_single(arrays)
        tensors = {name: _batch(array, single) for name, array in arrays.items()}
        with torch.no_grad():
            policy = self.network.policy(tensors if named else tensors[""])
        actions: np.ndarray = policy.mode()[0].numpy()
        return actions[0] if single else actions

    def _is_single(self, arrays: Mapping[str, np.ndarray]) -> bool:
        """Return whether the arrays are one observation, (*O,), or a batch of them, (B, *O).

        Raises:
            TeacherMismatch: they are neither.
        """
        wanted = self.card.spaces.shapes
        shapes = {name: array.shape for name, array in arrays.items()}
        if shapes == wanted:
            return True
        sizes = {shape[:1] for shape in shapes.values()}
        if {name: shape[1:] for name, shape in shapes.items()} != wanted or len(sizes) > 1:
            listed = ", ".join(f"{name} {shape}".strip() for name, shape in shapes.items())
            raise TeacherMismatch(
                f"teacher '{self.card.name}' has {self.card.spaces}, found observations {listed}"
            )
        return False


def _batch(array: np.ndarray, single: bool) -> torch.Tensor:
    """Return observations with a seed axis, (1, B, *O), as networks read them."""
    tensor = torch.from_numpy(np.ascontiguousarray(array)[None])
    tensor = tensor[None] if single else tensor
    return tensor if tensor.dtype == torch.uint8 else tensor.float()
