"""A teacher that acts: observations in, actions out."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

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
            Actions, (B, A) or (B,) numbers of discrete ones; without B for one observation. They
            are not clipped to the environment's bounds.
        """
        first = observations["camera"] if isinstance(observations, dict) else observations
        single = np.ndim(first) == len(self.card.obs_shape)
        if isinstance(observations, dict):
            batch: Any = {name: _batch(part, single) for name, part in observations.items()}
        else:
            batch = _batch(observations, single)
        with torch.no_grad():
            actions: np.ndarray = self.network.policy(batch).mode()[0].numpy()
        return actions[0] if single else actions


def _batch(array: Any, single: bool) -> torch.Tensor:
    """Return observations with a seed axis, (1, B, *O), as networks read them."""
    tensor = torch.from_numpy(np.ascontiguousarray(array)[None])
    tensor = tensor[None] if single else tensor
    return tensor if tensor.dtype == torch.uint8 else tensor.float()
