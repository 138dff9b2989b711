"""A seed among others is the seed alone, bit for bit, whatever learns and whoever teaches."""

import pytest
from numpy.testing import assert_array_equal
from small_learners import (
    course_for,
    learner_of,
    teachers_of,
    transfer_config,
    untrained_teacher,
    with_transfer,
)
from small_tasks import guess, reach

from repaint_cli.learn import ppo, q_learning
from repaint_cli.learn.evaluation import evaluate

SEEDS = [3, 0, 7]
WRITTEN = {"compiled": False, "stacked": False}
SHARE = {"select": {"rule": "per"}}
TASKS = {
    "steps": reach(effort=0.3, n_iterations=3),
    "steps, as written": reach(effort=0.3, n_iterations=3, **WRITTEN),
    "one environment": reach(effort=0.3, n_envs=1, n_steps=27, whole_episodes=True),
    "episodes": guess(n_iterations=3),
    "episodes, as written": guess(n_iterations=3, **WRITTEN),
    "episodes, drawn": guess(n_iterations=3, **SHARE),
    "critic first": reach(effort=0.3, advantages="after"),
    "trpo": reach(effort=0.3, objective="trpo", stacked=False),
    "a2c": guess(objective="a2c", stacked=False),
    "images": guess(image=True, n_iterations=3),
}
TEACHING = {
    "scratch": None,
    "kickstart": {"instance": 0},
    "repaint": {},
    "joint": {"joint": True},
    "instance": {"kickstart_coef": 0.0},
}


def learned(task, seeds, trainer, teaching):
    """Train and evaluate; return each seed's weights, returns and metrics, (S, …) each."""
    teachers = [] if teaching is None else [untrained_teacher(task, len(seeds))]
    task = with_transfer(task, transfer_config(**(teaching or {})))
    learner = learner_of(task, seeds)
    course = course_for(task, learner, teachers_of(*teachers))
    stats = list(trainer(task, learner, course))
    played = evaluate(learner.student, task, seeds, 3, iteration=3)
    once = evaluate(learner.student, task, seeds, 1, iteration=3)
    numbers = {
        f"{stat.iteration} {name}": values
        for stat in stats for name, values in stat.metrics.items() if name != "steps_per_second"
    }  # fmt: skip
    return numbers | {
        "weights": learner.student.storage.numpy(),
        "returns": played.returns,
        "terms": once.terms,
        "moments": learner.optimizer.second.numpy(),
    }


def assert_alone(task, trainer=ppo.train, teaching=None):
    together = learned(task, SEEDS, trainer, teaching)
    for s, seed in enumerate(SEEDS):
        alone = learned(task, [seed], trainer, teaching)
        assert alone.keys() == together.keys()
        for name, values in alone.items():
            assert_array_equal(values[0], together[name][s], err_msg=f"seed {seed}: {name}")


@pytest.mark.parametrize("teaching", TEACHING.values(), ids=TEACHING)
@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
def test_a_seed_among_others_is_the_seed_alone(task, teaching):
    if teaching == TEACHING["joint"]:  # which is learned as written
        task = task.with_settings(["ppo.stacked=false"])
    assert_alone(task, teaching=teaching)


@pytest.mark.parametrize("image", [False, True], ids=["vectors", "images"])
@pytest.mark.parametrize("teaching", [None, {}], ids=["scratch", "instances"])
def test_with_q_learning_too(teaching, image):
    task = guess(image=image, n_iterations=3, stacked=image)
    config = task.q_learning.model_copy(update={"gradient_steps": 20, "memory": 50})
    assert_alone(task.model_copy(update={"q_learning": config}), q_learning.train, teaching)
