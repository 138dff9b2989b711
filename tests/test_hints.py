"""Messages that lead on: names of other libraries, words without options, and completion."""

import os
import subprocess
import sys

import pytest
from small_runs import add_teacher

from repaint_cli.cli import completion
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.setting_names import SYNONYMS, did_you_mean
from repaint_cli.tasks.similarity import obstacle

SET = ["transfer", "--task", "reacher", "--method", "scratch", "--set"]


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ([*SET, "ppo.lr=1"], "unknown setting 'ppo.lr'; did you mean ppo.learning_rate? see: "),
        ([*SET, "ppo.clip=1"], "did you mean ppo.clip_range?"),
        ([*SET, "ppo.batch_size=1"], "did you mean ppo.minibatch_size?"),
        ([*SET, "train.gamma=1"], "unknown setting 'train.gamma'; did you mean ppo.gamma?"),
        ([*SET, "ppo.hidden=1"], "did you mean net.hidden?"),
        ([*SET, "ppo.grad_clip=1"], "did you mean ppo.max_grad_norm?"),
        ([*SET, "net.norm_obs=false"], "did you mean net.obs_normalize?"),
        ([*SET, "ppo.leraning_rate=1"], "did you mean ppo.learning_rate or "),
        ([*SET, "pop.gama=1"], "unknown section 'pop'; did you mean ppo?"),
        ([*SET, "lr=1e-3"], "expected --set section.key=value, found 'lr=1e-3'; did you mean "
         "ppo.learning_rate=1e-3?"),
        ([*SET, "nonsense"], "expected --set section.key=value, found 'nonsense'\n"),
        (["transfer", "--lr", 3], "No such option: --lr; did you mean --set ppo.learning_rate="),
        (["train-teacher", "--n-epochs", 3], "did you mean --set ppo.n_epochs=VALUE?"),
        (["transfer", "--sedes", 3], "No such option: --sedes (Possible options: --seed, "),
        (["transfer", "A", "B"], "expected options, found A B; did you mean: repaint transfer "
         "--teacher A --task B?"),
        (["transfer", "A", "B b", "C"], "repaint transfer --teacher A --teacher 'B b' --task C?"),
        (["transfer", "--task", "reacher", "A"], "repaint transfer --teacher A?"),
        (["train-teacher", "reacher"], "did you mean: repaint train-teacher --task reacher?"),
        (["eval", "one", "two"], "expected POLICY and options, found also: two."),
        (["zoo", "show", "one", "two"], "expected TEACHER and options, found also: two."),
        (["zoo", "list", "one"], "expected options alone, found also: one."),
    ],
    ids=lambda x: "",
)  # fmt: skip
def test_a_message_says_what_was_meant(repaint, words, meant):
    said = repaint(*words)
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert meant in said.err


def test_a_card_says_it_too(repaint, home):
    (home / "my.toml").write_text('extends = "reacher"\n[ppo]\nlr = 1\n')
    said = repaint("tasks", "show", "my.toml")
    assert said.err == ("error: my.toml: unknown key 'ppo.lr'; did you mean ppo.learning_rate?\n")
    (home / "my.toml").write_text('extends = "racer-inner"\n[env]\nmax_episode_steps = 1\n')
    assert "did you mean env.max_steps?" in repaint("tasks", "show", "my.toml").err


def test_names_stand_for_settings_that_there_are_each_for_one():
    cards = [read_task(name).model_dump() for name in ("reacher", "racer-inner")]
    known = {f"{s}.{k}" for card in cards for s, part in card.items() if s != "reward"
             if isinstance(part, dict) for k in part}  # fmt: skip
    assert set(SYNONYMS) <= known
    words = " ".join(SYNONYMS.values()).split()
    assert len(set(words)) == len(words)
    assert did_you_mean("ppo.qqqq", known) == ""


@pytest.mark.parametrize(
    ("one", "other", "reason"),
    [
        ("racer-inner", "reacher", "other simulators: racer and gymnasium"),
        ("ant", "reacher", "other environments: id Ant-v5 and Reacher-v5"),
        ("racer-inner", "racer-avoid",
         "other reward terms: camlane, clear, hazard only in the second"),
    ],
)  # fmt: skip
def test_similarity_says_why_there_is_none(repaint, one, other, reason):
    said = repaint("similarity", one, other)
    assert said.out == f"{one} → {other}  not comparable: {reason}\n"
    assert obstacle(read_task(one), read_task(one)) is None
    matrix = repaint("similarity", one, other, "cartpole").out
    assert f"  {one}, {other}: {reason}\n" in matrix


def test_terms_that_only_one_task_names_are_the_reason():
    card = read_task("reacher")
    other = card.model_copy(update={"reward": {"reward_dist": 1.0, "bonus": 2.0}})
    assert obstacle(card, other) == (
        "other reward terms: reward_ctrl only in the first; bonus only in the second"
    )


def complete(words, **env):
    """What a shell is offered for a command line, and which libraries that took."""
    code = (
        "import atexit, sys; sys.argv[0] = 'repaint'\n"
        "slow = {'torch', 'numba', 'numpy', 'gymnasium', 'rich.table'}\n"
        "atexit.register(lambda: print(*slow & set(sys.modules), file=sys.stderr))\n"
        "from repaint_cli.cli.app import main; main()"
    )
    last = len(words.split(" ")) - 1
    asked = {"_REPAINT_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(last)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | asked, capture_output=True, text=True
    )
    return done.stdout.split(), done.stderr.split()


def test_a_shell_completes_names_without_slow_imports(home):
    assert complete("repaint transfer --task racer-o") == (["racer-outer", "racer-outer-soft"], [])
    assert complete("repaint transfer --method rep") == (["repaint", "repaint-joint"], [])
    add_teacher(home / "home" / "zoo", "racer-mine")
    names, slow = complete("repaint eval racer-")
    assert ("racer-mine" in names, "racer-inner" in names, slow) == (True, True, [])


def test_what_each_completes(home):
    assert completion.tasks("reacher-") == ["reacher-away", "reacher-gentle"]
    (home / "mine.toml").touch()
    assert completion.tasks("mi") == ["mine.toml"]
    (home / "runs" / "reacher" / "one").mkdir(parents=True)
    (home / "runs" / "reacher" / "one" / "run.json").touch()
    assert completion.policies("r")[-1] == "runs/reacher/one"
    assert completion.runs("runs/reacher/t") == []
    add_teacher(home / "home" / "zoo", "reacher")
    assert completion.teachers("reacher@") == ["reacher@shipped"]
    assert completion.tasks_and_teachers("reacher")[-1] == "reacher@shipped"
    assert completion.methods("warm") == [("warm-start", "PPO from the teacher's weights")]
    assert completion.algorithms("q") == ["q-learning"]
    (home / "home" / "zoo").rename(home / "home" / "gone")
    assert "reacher" in completion.teachers("")
