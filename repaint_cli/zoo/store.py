"""The zoo: teachers in a local folder, a file each, with the card in the file's header."""

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.errors import CheckpointError, NotFound, StoreError, TeacherMismatch, some
from repaint_cli.files.headers import read_hash
from repaint_cli.files.paths import shipped, user_zoo
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo.teacher_card import NAME, TeacherCard, check_name, read_card

if TYPE_CHECKING:
    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.policies.spaces import Spaces

FEW = 8
"""Teachers that a message names."""

SUFFIX = ".safetensors"
"""Of a teacher's file."""

SHIPPED = "@shipped"
"""Behind a name: the shipped teacher, also where the user has one of the same name."""


def teachers() -> dict[str, Path]:
    """Return all teachers by name, the user's own first.

    A shipped one whose name the user has given to another is NAME@shipped. Links that lead out of
    their folder are left out.

    Raises:
        StoreError: a folder cannot be read.
    """
    paths: dict[str, Path] = {}
    for folder in (user_zoo(), shipped("zoo")):
        if folder.is_dir():
            for name in sorted(_names(folder)):
                key = f"{name}{SHIPPED}" if name in paths else name
                paths[key] = folder / f"{name}{SUFFIX}"
    return paths


def _names(folder: Path) -> Iterator[str]:
    try:
        entries = os.scandir(folder)
    except OSError as error:
        raise StoreError(f"cannot read {folder}: {error.strerror}") from error
    with entries:
        for entry in entries:
            name = entry.name.removesuffix(SUFFIX)
            if name == entry.name or not NAME.fullmatch(name):
                continue
            if not entry.is_symlink() or not _leads_out(folder / entry.name):
                yield name


def _leads_out(path: Path) -> bool:
    """Return whether a link leads out of its folder, or nowhere."""
    folder = Path(os.path.realpath(path.parent))
    return not os.path.exists(path) or folder not in Path(os.path.realpath(path)).parents


def find(name: str) -> Path:
    """Return the file of a teacher, by its name, as NAME@shipped, or by its path.

    Raises:
        NotFound: there is no teacher of this name, or its file is a link that leads out of the zoo.
    """
    if name.endswith(SUFFIX) and os.path.exists(name):
        return Path(name)
    known = teachers()
    if name not in known:
        if name.endswith(SHIPPED) and (path := shipped_file(name.removesuffix(SHIPPED))):
            return path
        path = own_file(name)
        if NAME.fullmatch(name) and path.is_symlink():
            raise NotFound(
                f"teacher '{name}' is a link that leads out of your zoo, to {path.readlink()}; "
                f"add what is there: repaint zoo add {name} FILE"
            )
        raise NotFound.named("teacher", name, known, "repaint zoo list")
    return known[name]


def own_file(name: str) -> Path:
    """Return where a teacher of the user's own lies, or would lie.

    Raises:
        StoreError: there is no home for it.
    """
    return user_zoo() / f"{name}{SUFFIX}"


def shipped_file(name: str) -> Path | None:
    """Return the file of a shipped teacher, None where there is none of this name."""
    path = shipped("zoo") / f"{name}{SUFFIX}"
    return path if NAME.fullmatch(name) and path.is_file() else None


def shipped_namesake(path: Path) -> str | None:
    """Return the NAME@shipped that a file of the user's zoo stands before, or None."""
    before = path.suffix == SUFFIX and shipped_file(path.stem) and whose(path) == "yours"
    return f"{path.stem}{SHIPPED}" if before else None


def whose(path: Path) -> str:
    """Return "yours" or "shipped" of a teacher's file in a zoo, "" of one that is elsewhere."""
    folder = path.parent.absolute()
    with suppress(StoreError):  # there is no home, and no zoo of the user's
        if folder == user_zoo().absolute():
            return "yours"
    return "shipped" if folder == shipped("zoo").absolute() else ""


def name_of(path: Path, card: TeacherCard) -> str:
    """Return the name by which a teacher's file is found: NAME@shipped behind one of the user's."""
    if whose(path) == "shipped" and own_file(path.stem).exists():
        return f"{path.stem}{SHIPPED}"
    return card.name


def to_type(path: Path, card: TeacherCard) -> str:
    """Return what is typed for a teacher's file: its name, or the path of one outside the zoo."""
    return name_of(path, card) if whose(path) else str(path)


def remove(name: str) -> Path:
    """Remove one of the user's own teachers; return the path that it had.

    Raises:
        NotFound: there is no teacher of this name.
        StoreError: the teacher is shipped, or its file cannot be removed.
    """
    path = own_file(name)
    if not NAME.fullmatch(name) or not os.path.lexists(path):
        if name in teachers() or name.endswith(SHIPPED):
            raise StoreError(f"'{name}' comes with repaint; only your own teachers can be removed")
        raise NotFound.named("teacher", name, teachers(), "repaint zoo list")
    try:
        path.unlink()
    except OSError as error:
        raise StoreError(f"cannot remove {path}: {error.strerror}") from error
    return path


def read_teacher(path: Path, n_seeds: int = 1) -> "tuple[ActorCritic, TeacherCard]":
    """Read a teacher's networks, copied for each of S seeds, and its card.

    Raises:
        CheckpointError: the file is damaged, or its leaves are not those of its card's networks.
        CardError: the card's networks do not read the card's observations.
    """
    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.policies.weights import check_networks, load, load_policy

    card = read_card(path)
    where = f"teacher '{card.name}'"
    check_networks(path, card.spaces, card.task.net, 1, where)
    tensors, _ = load(path)
    network = ActorCritic(card.spaces, card.task.net, n_seeds)
    load_policy(network, tensors, where)
    return network, card


def add(
    network: "ActorCritic",
    seed_number: int,
    card: TeacherCard,
    folder: Path,
    *,
    replace: bool = True,
) -> Path:
    """Write one seed's networks and their card as a teacher file; return its path.

    Args:
        network: S policies and critics.
        seed_number: the index of the one to write, from 0.
        card: of the teacher.
        folder: of the zoo.
        replace: whether another file of this name may be replaced; one of the same contents stays.

    Raises:
        StoreError: the card's name is invalid or taken, or the folder cannot be written.
    """
    from repaint_cli.policies.weights import content_hash, policy_tensors, save

    check_name(card.name)
    path = folder / f"{card.name}{SUFFIX}"
    tensors, header = policy_tensors(network, seed_number), card.model_dump(mode="json")
    try:
        save(path, tensors, header, new=not replace)
    except StoreError:
        if not _has_hash(path, content_hash(tensors, header)):
            raise
    return path


def _has_hash(path: Path, content_hash: str) -> bool:
    """Return whether a file's header has this hash of its contents."""
    with suppress(CheckpointError):
        return read_hash(path) == content_hash
    return False


def check_fits(cards: Sequence[TeacherCard], task: TaskCard, spaces: "Spaces") -> None:
    """Check that teachers can act in a task and be compared with it.

    Raises:
        TeacherMismatch: a teacher does not fit; the message says why of each of them, and names
            some teachers that fit.
    """
    problems = [problem for card in cards if (problem := mismatch(card, task, spaces))]
    if problems:
        fit = list(islice(fitting(task, spaces), FEW + 1))
        rest = f" and others (repaint zoo list --fits {task.name})" if len(fit) > FEW else ""
        named = ", ".join(fit[:FEW]) or "none yet"
        raise TeacherMismatch(f"{some(problems, between='; ')}; teachers that fit: {named}{rest}")


def fitting(task: TaskCard, spaces: "Spaces") -> Iterator[str]:
    """Yield the names of the teachers that fit a task; damaged files fit none."""
    for name, path in teachers().items():
        with suppress(CheckpointError):
            if not mismatch(read_card(path), task, spaces):
                yield name


def mismatch(card: TeacherCard, task: TaskCard, spaces: "Spaces") -> str | None:
    """Return why a teacher does not fit a task, or None."""
    if card.spaces != spaces:
        of_which = ", of which others count" if str(card.spaces) == str(spaces) else ""
        return f"teacher '{card.name}' has {card.spaces}, task '{task.name}' has {spaces}{of_which}"
    own, others = (env.choices or () for env in (card.task.env, task.env))
    if own != others:
        same = sorted(own) == sorted(others)
        what = "the same [env] actions in another order" if same else "other [env] actions"
        which = "" if spaces.discrete else f": {' and '.join(own)}, not {' and '.join(others)}"
        return f"teacher '{card.name}' and task '{task.name}' choose among {what}{which}"
    strange = card.task.reward.keys() - task.terms | task.reward.keys() - card.task.terms
    if strange and not (card.task.reward_code or task.reward_code):  # which have none to compare
        return (
            f"teacher '{card.name}' knows the reward terms {', '.join(card.task.reward)}, "
            f"task '{task.name}' has {', '.join(task.reward)}"
        )
    return None
