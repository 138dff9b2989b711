"""Views of a teacher: as it is, in the mirror of a symmetry, or the mean of both."""

from collections.abc import Sequence
from typing import NamedTuple

from repaint_cli.errors import CardError, NotFound, TeacherMismatch
from repaint_cli.policies.mirror import BothViews, PolicyNetwork, mirrored
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.symmetry import Symmetry
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.similarity import better_view, cosine
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import TeacherCard
from repaint_cli.zoo.view_names import BOTH, TeacherFile, with_view


class View(NamedTuple):
    """A teacher as it is looked at in a task."""

    policy: PolicyNetwork
    """What acts."""
    network: ActorCritic
    """What a student may start from: the teacher or its mirror image; of both, the teacher."""
    symmetry: Symmetry | None = None
    """In whose mirror it is."""


def symmetry_of(name: str, teacher: TaskCard, view: str, task: TaskCard) -> Symmetry | None:
    """Return the symmetry of a view of a teacher in a task, None as it is.

    Args:
        name: of the teacher, as it is typed.
        teacher: its own task.
        view: as in `TeacherFile`.
        task: the task, whose symmetries count.

    Raises:
        NotFound: the task has no such symmetry.
        TeacherMismatch: both views would contradict each other.
    """
    if not view:
        return None
    known = {symmetry.name: symmetry for symmetry in task.symmetries}
    if not known:
        why = task.why_no_symmetry()
        raise NotFound(f"'{with_view(name, view)}' is not to be had: {why}; use {name}")
    if view == BOTH:
        symmetry = next(iter(known.values()))
        for one in (task, teacher):
            if changing := one.changing_terms(symmetry):
                raise TeacherMismatch(
                    f"teacher '{name}:{BOTH}' would contradict itself: {', '.join(changing)} of "
                    f"task '{one.name}' changes in the mirror; use {name} or "
                    f"{name}:{symmetry.name}"
                )
        return symmetry
    if view not in known:
        views = ", ".join(with_view(name, other) for other in ("", *known, BOTH))
        raise NotFound(f"expected {views}, found the view '{view}'")
    return known[view]


def view_of(network: ActorCritic, card: TeacherCard, file: TeacherFile, task: TaskCard) -> View:
    """Return a teacher as it is looked at in a task, whose `net.mask` and `net.spatial` count.

    Raises:
        As `symmetry_of`.
    """
    name = store.to_type(file.path, card)
    symmetry = symmetry_of(name, card.task, file.view, task)
    network = network.with_actions_of(task.net)
    if symmetry is None:
        return View(network, network)
    reflected = mirrored(network, symmetry)
    if file.view == BOTH:
        return View(BothViews(network, reflected), network)
    return View(reflected, reflected, symmetry)


def hints_of_views(
    cards: Sequence[TeacherCard], files: Sequence[TeacherFile], task: TaskCard
) -> list[str]:
    """Return a sentence for each opposed teacher whose mirror image is similar to a task."""
    sentences = []
    for card, file in zip(cards, files, strict=True):
        value, better = cosine(card.task, task), better_view(card.task, task)
        if file.view or value is None or value > 0 or better is None:
            continue
        name = with_view(store.to_type(file.path, card), better[0])
        sentences.append(
            f"teacher '{card.name}' is opposed to the task (cosine {value:.2f}), its mirror image "
            f"is similar ({better[1]:.2f}): --teacher {name}"
        )
    return sentences


def as_warm_started(card: TaskCard, name: str, teacher: TaskCard, view: str) -> TaskCard:
    """Return a card whose student reads images as the teacher that it starts from does.

    Args:
        card: the target task.
        name: of the teacher, as it is typed.
        teacher: its own task.
        view: as in `TeacherFile`.

    Raises:
        As `symmetry_of`.
        TeacherMismatch: the teacher is no single network.
        CardError: the card says otherwise.
    """
    if view == BOTH:
        raise TeacherMismatch(
            f"a warm start needs one network, and '{name}:{BOTH}' is two; leave out :{BOTH}"
        )
    symmetry = symmetry_of(name, teacher, view, card)
    flips = teacher.net.flip_images ^ (symmetry is not None and symmetry.channels is not None)
    if card.net.flip_images and not flips:
        raise CardError(
            f"net.flip_images follows from the teacher that a student starts from, and "
            f"'{with_view(name, view)}' flips none; leave it out"
        )
    if flips == card.net.flip_images:
        return card
    return card.model_copy(update={"net": card.net.model_copy(update={"flip_images": flips})})
