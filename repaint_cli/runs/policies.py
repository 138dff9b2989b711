"""The policies of a run as teachers' files."""

from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from repaint_cli.errors import CheckpointError
from repaint_cli.files.provenance import versions
from repaint_cli.learn.learner import Learner
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.teachers import RunTeachers
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import TeacherCard, read_card


def write_policy(path: Path, plan: Plan, teachers: RunTeachers, learner: Learner, s: int) -> Path:
    """Write the policy of one of the seeds, counted from 0; return where it is.

    Raises:
        StoreError: the file cannot be written.
    """
    spaces = learner.student.spaces
    card = TeacherCard(
        name=path.stem,
        task=plan.task,
        obs_shape=spaces.obs_shape,
        n_actions=spaces.n_actions,
        discrete=spaces.discrete,
        n_beams=spaces.n_beams,
        parts=dict(spaces.parts),
        sizes=spaces.sizes,
        uses=spaces.uses,
        algorithm=plan.algorithm,
        method=plan.method,
        seed=plan.seeds[s],
        iteration=learner.iteration,
        env_steps=int(learner.env_steps[s]),
        versions=versions(),
        parents=tuple(teacher.sha256 for teacher in teachers.records),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    return store.add(learner.student, s, card, path.parent)


def is_of_iteration(path: Path, k: int) -> bool:
    """Tell whether a policy's file is whole and of iteration k."""
    with suppress(CheckpointError):
        return read_card(path).iteration == k
    return False
