"""`--preset paper` and `--preset coach`: the numbers, and whose each of them is."""

import re

import pytest

from repaint_cli.errors import NotFound
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_settings import settings_of
from repaint_cli.tasks.paper import sources
from repaint_cli.tasks.presets import automatic, with_preset

SHARED = {
    "ppo.minibatch_size": 64, "ppo.clip_range": 0.2, "ppo.gae_lambda": 0.95,
    "ppo.learning_rate": 3e-4, "transfer.kickstart_coef": 0.2, "transfer.kickstart_decay": 0.95,
    "transfer.representation": 1, "transfer.instance": 1, "transfer.teacher_min_std": 0,
    "transfer.teacher_temperature": 1, "select.rule": "zeta", "select.scale": "none",
    "select.loss_scale": "raw", "ppo.advantages": "after",
}  # fmt: skip
TABLE_3 = {"ppo.n_steps": 2048, "ppo.n_epochs": 10, "ppo.gamma": 0.99, "ppo.ent_coef": 1e-4}
TABLE_4 = {
    "ppo.n_episodes": 20, "transfer.teacher_episodes": 2, "ppo.n_epochs": 8, "ppo.gamma": 0.999,
    "ppo.ent_coef": 1e-3, "select.threshold": 0.2, "net.pool": 1, "net.conv": "3-layer",
    "eval.episodes": 5, "eval.noise": "paper",
}  # fmt: skip
THE_PAPERS = {
    "reacher": TABLE_3 | {"select.threshold": 0.8, "transfer.iterations": 15, "eval.episodes": 20},
    "ant": TABLE_3 | {"transfer.iterations": 50, "eval.episodes": 5, "ppo.n_iterations": 1000},
    "racer-outer": TABLE_4 | {"transfer.iterations": 4},
    "racer-progress": TABLE_4 | {"transfer.iterations": 20},
}


@pytest.mark.parametrize("task", THE_PAPERS)
def test_the_numbers_are_those_of_the_papers_tables(task):
    settings = settings_of(with_preset(read_task(task), "paper"))
    for name, value in (SHARED | THE_PAPERS[task]).items():
        assert settings[name] == value, name


def test_coach_adds_its_framework_to_the_papers_numbers():
    paper, coach = (settings_of(with_preset(read_task("reacher"), n)) for n in ("paper", "coach"))
    changed = {name: coach[name] for name in paper if paper[name] != coach[name]}
    assert changed == {
        "ppo.time_limit": "terminal", "ppo.vf_coef": 1.0, "ppo.advantages": "before",
        "ppo.clip_decay": 488, "ppo.whole_episodes": True, "ppo.n_envs": 1,
        "select.scale": "teacher-batch", "select.loss_scale": "selected",
        "select.min_samples": 64,
    }  # fmt: skip


def test_whose_a_number_is():
    card = with_preset(read_task("racer-outer"), "paper").with_settings(["ppo.gamma=0.9"])
    whose = dict(sources(card))
    assert whose.keys() == settings_of(card).keys()
    for name, source in {
        "ppo.gamma": "ours", "ppo.n_epochs": "paper", "net.dense": "Coach",
        "ppo.time_limit": "ours", "env.track": "ours", "transfer.iterations": "paper",
    }.items():  # fmt: skip
        assert whose[name] == source, name


def test_a_task_that_is_not_the_papers_has_what_holds_everywhere():
    settings = settings_of(with_preset(read_task("cartpole"), "paper"))
    assert settings["select.scale"] == "none"
    assert settings["ppo.n_steps"] == read_task("cartpole").ppo.n_steps
    assert with_preset(read_task("cartpole"), None) == read_task("cartpole")
    with pytest.raises(NotFound, match="unknown preset 'papr'; did you mean paper"):
        with_preset(read_task("cartpole"), "papr")


@pytest.mark.parametrize("preset", ["paper", "coach"])
def test_every_setting_is_shown_with_its_source(repaint, preset):
    said = repaint("tasks", "show", "ant", "--preset", preset)
    assert said.code == 0
    set_lines = [
        line for line in said.out.splitlines() if re.match(r"(\w+ =|# \w+ is absent)", line)
    ]
    assert all(re.search("  # (paper|Coach|ours)$", line) for line in set_lines[1:])
    assert "n_iterations = 1000  # paper" in set_lines
    assert 'activation = "tanh"  # Coach' in set_lines
    assert "  # paper" not in repaint("tasks", "show", "ant").out


def test_nothing_is_distilled_where_no_policy_moves_alone():
    shared = read_task("racer-outer").with_settings(["net.shared=true"])
    assert automatic(shared, [], "ppo", None).transfer.distill_epochs == 0
    assert automatic(read_task("racer-outer"), [], "ppo", None).transfer.distill_epochs == 40
