"""Export of a teacher for other programs: its file, its card as JSON and as a page, and ONNX."""

import json
import logging
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import torch
from torch import Tensor

from repaint_cli.errors import RepaintError
from repaint_cli.files.atomic import as_json, atomic_write, write_text
from repaint_cli.files.foreign import check_replaceable
from repaint_cli.policies.distributions import Gaussian
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.zoo.model_card import markdown
from repaint_cli.zoo.store import SUFFIX, read_teacher
from repaint_cli.zoo.teacher_card import TeacherCard

OPSET = 20


def export(path: Path, folder: Path, *, onnx: bool = False, replace: bool = False) -> list[Path]:
    """Write a teacher's file, card.json and README.md into a folder, and maybe its policy as ONNX.

    Args:
        path: of the teacher's file.
        folder: to write to.
        onnx: whether to write NAME.onnx too, see `write_onnx`.
        replace: whether files that repaint did not write may be replaced.

    Returns:
        The paths written.

    Raises:
        CheckpointError: the teacher's file is damaged.
        RepaintError: the package onnx or onnxscript is not installed.
        StoreError: the folder cannot be written, or holds files of the same names.
    """
    network, card = read_teacher(path)
    if onnx:
        _require_onnx()
    name = path.stem
    files = [folder / f"{name}{SUFFIX}", folder / "card.json", folder / "README.md"]
    files += [folder / f"{name}.onnx"] if onnx else []
    check_replaceable(files, replace, "name another folder, or --replace it")
    with atomic_write(files[0]) as temporary:
        shutil.copyfile(path, temporary)
    write_text(files[1], as_json(card.model_dump(mode="json")))
    write_text(files[2], markdown(card, path))
    if onnx:
        write_onnx(network, card, files[-1])
    return files


def _require_onnx() -> None:
    if find_spec("onnx") is None or find_spec("onnxscript") is None:
        raise RepaintError("--onnx needs ONNX: pip install onnx onnxscript")


class _Policy(torch.nn.Module):
    """One seed's policy as a module: observations of the environment in, its distribution out."""

    def __init__(self, network: ActorCritic) -> None:
        super().__init__()
        self._network = network

    def forward(self, *obs: Tensor) -> tuple[Tensor, ...]:
        """Return mean (B, A) and log σ (A,), or log π (B, A), for observations (B, *O)."""
        names = self._network.spaces.shapes
        batch = {name: x.unsqueeze(0) for name, x in zip(names, obs, strict=True)}
        only = batch.get("")
        distribution = self._network.policy(batch if only is None else only)
        if isinstance(distribution, Gaussian):
            return distribution.mean.squeeze(0), distribution.log_std.reshape(-1)
        return (distribution.log_probs.squeeze(0),)


def write_onnx(network: ActorCritic, card: TeacherCard, path: Path) -> None:
    """Write a policy as ONNX, in float32; its card is in the model's metadata under `repaint`.

    Inputs are `obs`, float32 (B, O) or uint8 (B, H, W, C), and `lidar` (B, beams) where there is
    one, or several images and vectors by their names; outputs `mean` (B, A) and `log_std` (A,), or
    `log_probs` (B, A), of a compound action those of each number one behind the other.

    Raises:
        StoreError: the file cannot be written.
    """
    spaces = network.spaces
    inputs = [
        torch.zeros(2, *shape, dtype=torch.uint8 if len(shape) == 3 else torch.float32)
        for shape in spaces.shapes.values()
    ]
    names = [name for name, _ in spaces.parts] or ["obs", "lidar"][: len(inputs)]
    batch, policy = torch.export.Dim("batch"), _Policy(network.in_precision("float32"))
    with _quietly():
        program = torch.onnx.export(
            policy.eval(), tuple(inputs), dynamo=True, verbose=False, opset_version=OPSET,
            input_names=names,
            output_names=["log_probs"] if spaces.discrete else ["mean", "log_std"],
            dynamic_shapes=(tuple({0: batch} for _ in inputs),),
        )  # fmt: skip
    assert program is not None
    program.model.metadata_props["repaint"] = json.dumps(card.model_dump(mode="json"))
    with atomic_write(path) as temporary:
        program.save(temporary, external_data=False)


@contextmanager
def _quietly() -> Iterator[None]:
    """Keep the exporter's logs and warnings from the screen."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
