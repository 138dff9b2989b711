"""Teachers play a task, untrained, and are ranked by what they earn."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_runs import QUICK, add_teacher

from repaint_cli.cli.transfer_options import TransferOptions
from repaint_cli.errors import NotFound, UsageError
from repaint_cli.learn.evaluation import evaluate, play
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.seeding import Purpose
from repaint_cli.learn.transfer.courses import affordable
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs.measured_teachers import Choice, chosen
from repaint_cli.runs.measuring import first_length, measurements_of
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.record_parts import RankedRecord
from repaint_cli.runs.with_teachers import with_teachers
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.presets import ENDLESS
from repaint_cli.zoo import store
from repaint_cli.zoo.played import Played, Player
from repaint_cli.zoo.ranking import Ranking, rank, views_worth_playing
from repaint_cli.zoo.teacher_card import read_card
from repaint_cli.zoo.view_names import TeacherFile, find

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at


def played(name, returns, **known):
    returns = np.array(returns, float)
    nothing = np.zeros(len(returns), bool)
    return Played(name, returns, np.full(len(returns), 50), None, nothing, 0.5, **known)


@pytest.mark.parametrize(
    ("teacher", "task", "views"),
    [
        ("reacher", "reacher", ["", "both"]),  # its image earns what it earns
        ("ant", "ant", ["", "both", "front-back"]),  # from left to right, too
        ("racer-inner", "racer-outer", ["", "mirrored"]),  # both would contradict each other
        ("racer-avoid", "racer-advanced", ["", "mirrored", "both"]),  # the track has other bends
    ],
)
def test_only_views_that_may_differ_are_played(teacher, task, views, tmp_path):
    spaces = Spaces((10,), 2, False)
    shipped = teacher.startswith("racer")
    path = store.find(teacher) if shipped else add_teacher(tmp_path, "mine", teacher, spaces)
    card = read_card(path)
    assert views_worth_playing(card, read_task(task)) == views


def test_who_earns_more_is_first_and_what_they_earn_is_an_evaluation():
    task = read_task("reacher")
    ranking = rank(task, 3, 20)
    assert {one.name for one in ranking.teachers} == {
        name + view
        for name in ("reacher", "reacher-gentle", "reacher-away")
        for view in ("", ":both")
    }
    means = [one.returns.mean() for one in ranking.teachers]
    assert means == sorted(means, reverse=True)
    (gentle,) = (one for one in ranking.teachers if one.name == "reacher-gentle")
    network, _ = store.read_teacher(store.find("reacher-gentle"))
    wanted = evaluate(network, task, [3], 20, purpose=Purpose.SCORE).returns[0]
    np.testing.assert_array_equal(gentle.returns, wanted)
    assert gentle.cosine == pytest.approx(0.894, abs=5e-4)
    assert gentle.same_networks
    assert gentle.better > 0.6 > ranking.teachers[-1].better
    assert ranking.best is not None
    assert ranking.best.name.startswith("reacher")
    assert len(ranking.untrained.returns) == 20


@pytest.mark.parametrize(
    ("best", "untrained", "taken"),
    [
        ([9.0, 10, 11, 10], [1.0, 2, 1, 2], True),
        ([9.0, 10, 11, 10], [9.0, 10, 11, 10], False),
        ([5.0, 20, -9, 10], [1.0, 2, 1, 2], False),  # by chance
        ([5.0, 5, 5, 5], [1.0, 1, 1, 1], True),  # no spread at all
        ([-0.6] * 4, [-0.6000000000000003] * 4, False),  # a difference of rounding
        ([1.0, 1, 1, 1], [5.0, 5, 5, 5], False),
    ],
)
def test_a_teacher_is_taken_where_its_lead_is_more_than_chance(best, untrained, taken):
    teachers = (played("old-hand", best), played("other", [0.0] * 4))
    ranking = Ranking(read_task("reacher"), played("untrained", untrained), teachers)
    assert (ranking.best is not None) == taken


def test_networks_are_alike_where_weights_mean_the_same():
    net = NetConfig(hidden=(8, 8))
    same = [{"log_std_init": -1.0}, {"value_hidden": (8, 8)}, {"pool": 4}]
    assert all(net.alike(net.model_copy(update=change)) for change in same)
    others = [{"activation": "relu"}, {"obs_clip": 9.0}, {"hidden": (8,)}, {"kind": "cnn"}]
    assert not any(net.alike(net.model_copy(update=change)) for change in others)
    car = NetConfig(kind="cnn")
    layers = ((32, 8, 4), (64, 4, 2), (64, 3, 1))
    same = [{"precision": "bf16"}, {"flip_images": True}, {"conv": layers}]
    assert all(car.alike(car.model_copy(update=change)) for change in same)
    assert not car.alike(car.model_copy(update={"pool": 1}))


def test_the_command_says_whom_to_take_and_what_to_type(repaint, home):
    said = repaint("zoo", "rank", "--task", "reacher", "--episodes", 4)
    assert said.code == 0, said.err
    *_, lead, verdict, following = lines = said.out.splitlines()
    assert max(map(len, lines[:-1])) <= 80
    assert lead.startswith("the best, reacher")
    assert verdict.startswith("take reacher")
    assert following.startswith("next: repaint transfer --teacher reacher")
    assert lines[0].split()[:4] == ["teacher", "return", "[95", "%"]
    data = json.loads(repaint("zoo", "rank", "--task", "reacher", "--episodes", 4, "--json").out)
    assert data["take"] in verdict
    assert len(data["policies"]) == 7
    assert data["policies"][-1]["name"] == "untrained"
    assert data["policies"][-1]["steps"] == 200
    assert not (home / "runs").exists()


def test_nobody_is_taken_where_nobody_leads(repaint, home, monkeypatch):
    add_teacher(home / "home" / "zoo")  # an untrained one
    only = {"old-hand": store.find("old-hand")}
    monkeypatch.setattr(store, "teachers", lambda: only)
    said = repaint("zoo", "rank", "--task", "reacher", "--episodes", 4)
    assert "the best, old-hand" in said.out
    assert said.out.splitlines()[-2] == "take nobody, that is no more than chance"
    assert said.out.splitlines()[-1] == "next: repaint transfer --task reacher --method scratch"


def test_without_a_teacher_that_fits_one_line_says_what_to_do(repaint, home):
    said = repaint("zoo", "rank", "--task", "cartpole")
    assert said.code == NotFound.exit_code
    assert said.err == (
        "error: no teacher in the zoo fits task 'cartpole' (4 observations and 2 discrete "
        "actions); train one: repaint train-teacher --task TASK\n"
    )
    said = repaint("zoo", "rank", "--task", "reacher", "--episodes", 1)
    assert said.err == "error: expected --episodes of at least 2, found 1\n"


def test_ways_round_are_apart_in_races(repaint, home):
    card = home / "short.toml"
    card.write_text('extends = "racer-advanced"\nenv.max_steps = 4\n')
    said = repaint("zoo", "rank", "--task", "short.toml", "--episodes", 4)
    assert said.code == 0, said.err
    assert said.out.splitlines()[0].split()[5:7] == ["forward", "reverse"]
    assert "racer-avoid:both" in said.out
    assert max(map(len, said.out.splitlines()[:4])) <= 80


def test_a_ranking_of_equal_leads_has_no_interval():
    ranking = Ranking(read_task("reacher"), played("untrained", [1.0] * 3), ())
    assert ranking.lead(replace(ranking.untrained, returns=np.full(3, 4.0))) == (3.0, 3.0, 3.0)


def test_the_best_teacher_is_taken_and_what_was_measured_is_kept(repaint, home):
    words = ["transfer", "--task", "reacher", *QUICK, "--method", "kickstart", "--run", "run"]
    said = repaint(*words, "--teacher", "auto")
    assert said.code == 0, said.err
    record = json.loads((home / "run" / "run.json").read_text())
    names = [one["name"] for one in record["ranked"]]
    assert len(names) == 7
    assert names[-1] == "untrained"
    (taken,) = record["teachers"]
    assert f"{taken['name']}:{taken['view']}".rstrip(":") == names[0]
    assert "note: 6 views of teachers, and untrained policies, played 7,000 steps" in said.out
    plain = [*words[:-1], "plain", "--teacher", names[0]]
    assert repaint(*plain).code == 0
    auto, alone = (read_run(home / name).rows["env_steps"] for name in ("run", "plain"))
    assert (auto - alone == 7000).all()
    assert repaint("transfer", "--resume", "run", "--iterations", 3).code == 0
    assert read_run(home / "run").rows["env_steps"][0, 2] > 7000
    assert len(json.loads((home / "run" / "run.json").read_text())["ranked"]) == 7


def test_nobody_is_taken_where_nobody_leads_and_nothing_is_written(repaint, home, monkeypatch):
    add_teacher(home / "home" / "zoo")
    only = {"old-hand": store.find("old-hand")}
    monkeypatch.setattr(store, "teachers", lambda: only)
    said = repaint("transfer", "--task", "reacher", "--teacher", "auto", "--run", "run", *QUICK)
    assert said.code == NotFound.exit_code
    assert "nobody earns more on 'reacher' than chance (the best, old-hand" in said.err
    assert said.err.endswith("try --method scratch\n")
    assert not (home / "run").exists()


def test_the_view_of_a_teacher_is_the_one_that_earns_most(repaint, home):
    words = ["transfer", "--task", "reacher", *QUICK, "--method", "instance", "--run", "run"]
    said = repaint(*words, "--teacher", "reacher-gentle", "--view", "auto")
    assert said.code == 0, said.err
    record = json.loads((home / "run" / "run.json").read_text())
    assert [one["name"] for one in record["ranked"]] == [
        "reacher-gentle", "reacher-gentle:both", "untrained"
    ]  # fmt: skip
    assert record["teachers"][0]["view"] == ""
    assert "2 views of teachers, and untrained policies, played" in said.out


def test_only_open_views_are_measured(home):
    files = [find(name) for name in ("reacher-away", "reacher-gentle:auto", "reacher:both")]
    choice = chosen(read_task("reacher"), files, 0)
    assert [file.name for file in choice.files] == [
        "reacher-away",
        "reacher-gentle",
        "reacher:both",
    ]
    assert len(choice.ranked) == 3
    assert [one.teachers for one in choice.ranked] == [(1,), (), ()]
    assert chosen(read_task("reacher"), files[:1], 0) == Choice((files[0],))


def test_methods_are_compared_with_a_measured_teacher(repaint, home):
    words = ["compare", "--task", "reacher", "--seeds", 2, *QUICK[:2], *QUICK[4:]]
    words += ["--methods", "scratch,kickstart", "--set", "eval.episodes=2"]
    said = repaint(*words, "--teacher", "reacher-gentle:auto", "--report", "report")
    assert said.code == 0, said.err
    (folder,) = (home / "runs" / "reacher").iterdir()
    runs = [read_run(folder / name) for name in ("scratch", "kickstart")]
    assert [len(run.record.ranked) for run in runs] == [0, 3]
    gap = runs[1].rows["env_steps"] - runs[0].rows["env_steps"]
    assert (gap == sum(one.steps for one in runs[1].record.ranked)).all()
    spent = sum(one.seconds for one in runs[1].record.ranked)
    assert runs[1].rows["seconds"].min() > spent > 0


def test_the_best_of_many_equal_teachers_is_taken_by_chance_in_one_ranking_of_twenty():
    rng, task = np.random.default_rng(0), read_task("reacher")
    taken = 0
    for _ in range(400):
        teachers = sorted(
            (played(str(i), rng.normal(0, 1, 20)) for i in range(8)),
            key=lambda one: -one.returns.mean(),
        )
        untrained = played("untrained", rng.normal(0, 1, 20))
        taken += Ranking(task, untrained, tuple(teachers)).best is not None
    assert taken / 400 < 0.06  # each by itself at 95 %: some 0.13


def test_untrained_policies_are_as_good_as_each_other(home):
    """By one critic, not each by its own."""
    task = read_task("reacher")
    player = Player.of(task, Spaces((10,), 2, False), 1, 20)
    fresh = Learner.fresh(ActorCritic(player.critic.spaces, task.net, 1), [2], 1.0).student
    rollout, _ = play(fresh, task, [2], 10, purpose=Purpose.SCORE)
    assert player._better(rollout) == pytest.approx(0.5, abs=0.05)


def test_auto_is_alone_and_no_name(repaint, home):
    words = ["transfer", "--task", "reacher", *QUICK, "--teacher", "auto", "--teacher", "reacher"]
    said = repaint(*words)
    assert said.err == "error: --teacher auto stands alone, found reacher beside it\n"
    said = repaint("train-teacher", "--task", "reacher", "--name", "auto", *QUICK)
    assert "expected another name than auto" in said.err


@pytest.mark.parametrize(
    ("steps", "episodes"),
    [
        (0, {2}),  # two are played whatever they cost
        (2 * 50 * 2 + 6 * 50 + 2 * 50, {2, 4}),  # 2 more of the best
        (10**6, {2, 5}),
    ],
)
def test_measuring_goes_on_with_those_that_may_be_the_best(steps, episodes):
    task, lengths = read_task("reacher"), []

    def affordable(length):
        lengths.append(length)
        return steps

    among = [find("reacher-gentle"), find("reacher-away")]
    ranking = rank(task, 0, 5, among=among, affordable=affordable)
    assert lengths == [50]
    assert {len(one.returns) for one in ranking.teachers} == episodes
    assert len(ranking.teachers[-1].returns) == 2  # away, which is hopeless
    best = ranking.teachers[0]
    assert len({*best.returns.tolist()}) == len(best.returns)  # each episode is another
    assert len(best.lengths) == len(best.reverse) == len(best.returns)


def test_measuring_costs_a_twentieth_of_the_run_or_1500_steps():
    reacher = read_task("reacher").with_settings(["ppo.n_steps=2000", "ppo.n_iterations=10"])
    assert affordable(reacher, 50.0) == 1500
    longer = reacher.with_settings(["ppo.n_iterations=100"])
    assert affordable(longer, 50.0) == 10_000
    racer = read_task("racer-outer").with_settings(["ppo.n_iterations=20"])  # of 20 episodes
    assert affordable(racer, 200.0) == 4000
    assert affordable(racer.with_settings(["ppo.max_steps=2500"]), 200.0) == 2500


@pytest.mark.parametrize(
    ("teacher", "settings", "starts"),
    [
        ("reacher-gentle", [], True),
        ("reacher-away", [], False),  # worse than nobody
        ("reacher-gentle", ["net.hidden=[32,32]"], False),  # its weights do not fit
    ],
)
def test_a_student_starts_from_a_teacher_with_equal_networks_in_the_lead(teacher, settings, starts):
    card = read_task("reacher").with_settings(["transfer.start=auto", *settings])
    choice = chosen(card, [find(teacher)], 0)
    assert choice.settled(card).transfer.start == ("teacher" if starts else "untrained")
    fixed = card.with_settings(["transfer.start=teacher"])
    assert choice.settled(fixed) == fixed


def test_an_automatic_student_begins_as_a_teacher_who_leads(repaint, home):
    words = ["transfer", "--task", "reacher", *QUICK, "--run", "run", "--auto"]
    said = repaint(*words, "--teacher", "reacher-gentle", "--seeds", 2)
    assert said.code == 0, said.err
    record = json.loads((home / "run" / "run.json").read_text())
    assert record["transfer"]["start"] == "teacher"
    assert record["transfer"]["iterations"] == 0  # PPO alone goes on
    assert [one["teachers"] for one in record["ranked"]].count([0]) == 1
    run = read_run(home / "run")
    assert (run.returns[:, 0] > -9).all()  # an untrained policy earns -12
    assert set(run.rows["kickstart_coef"].ravel()) == {0.0}  # it is as good as the teacher
    assert repaint("transfer", "--resume", "run", "--iterations", 3).code == 0


def test_an_automatic_student_with_other_networks_imitates_first(repaint, home):
    words = ["transfer", "--task", "reacher", *QUICK, "--run", "run", "--auto"]
    said = repaint(*words, "--teacher", "reacher-gentle", "--set", "net.hidden=[32,32]")
    assert said.code == 0, said.err
    run = read_run(home / "run")
    assert run.record.transfer["start"] == "untrained"
    assert run.rows["kickstart_coef"][0, 0] > 0.5
    assert "distill_cross_entropy" in (home / "run" / "metrics.csv").read_text()


def test_two_tasks_are_compared_by_what_a_teacher_earns(repaint, home):
    said = repaint("similarity", "reacher-gentle", "reacher", "--measure")
    assert said.code == 0, said.err
    assert "reacher-gentle → reacher  0.894  similar" in said.out
    rows = [line.split()[0] for line in said.out.splitlines() if "[" in line][1:4]
    assert rows == ["reacher-gentle", "reacher-gentle:both", "untrained"]
    assert "take reacher-gentle; the plain command starts from its weights" in said.out
    found = json.loads(
        repaint("similarity", "reacher-gentle", "reacher", "--measure", "--json").out
    )
    assert [one["name"] for one in found[0]["measured"]["policies"]] == rows
    refused = repaint("similarity", "reacher", "--measure")
    assert refused.code == UsageError.exit_code
    assert "--measure needs a teacher and a task, found 1 names" in refused.err


def test_the_first_rollout_of_who_starts_from_a_teacher_is_as_long_as_its_episodes(tmp_path):
    ranked = RankedRecord(
        name="old-hand", mean=1.0, low=1.0, high=1.0, better=0.5, cosine=None, steps=500,
        returns=(1.0, 1.0), teachers=(0,),
    )  # fmt: skip
    card = read_task("racer-outer").with_settings(["ppo.max_steps=750"])
    plan = Plan(card, "repaint", [0, 1], tmp_path, ranked=(ranked,))
    assert first_length(plan) == 250
    assert first_length(replace(plan, ranked=())) == 0
    assert first_length(replace(plan, task=read_task("racer-outer"))) == 0


CAR = read_task("racer-outer").with_settings(
    ["transfer.start=auto", f"transfer.iterations={ENDLESS}"]
)
ONE, TWO = TeacherFile(Path("one")), TeacherFile(Path("two"))


@pytest.mark.parametrize(
    ("choice", "settings"),
    [
        (Choice((ONE,), leads=True, starts=True), ("teacher", 0, 750)),
        (Choice((ONE, TWO), leads=True, starts=True), ("teacher", ENDLESS, 750)),
        (Choice((ONE,), leads=True), ("untrained", ENDLESS, 750)),
        (Choice((ONE,)), ("untrained", 0, None)),  # as from scratch
    ],
)
def test_what_is_settled_before_a_run(choice, settings):
    card = choice.settled(CAR)
    assert (card.transfer.start, card.transfer.iterations, card.ppo.max_steps) == settings


def test_what_is_decided_by_hand_is_not_settled():
    choice = Choice((ONE,), leads=True, starts=True)
    card = choice.settled(CAR.with_settings(["transfer.iterations=5", "ppo.max_steps=3000"]))
    assert (card.transfer.iterations, card.ppo.max_steps) == (5, 3000)
    arm = read_task("reacher").with_settings(["transfer.start=auto"])
    assert choice.settled(arm).ppo.max_steps is None  # its rollouts count steps


def test_weights_are_taken_where_both_images_are_hardly_better():
    """On Reacher both images together may earn more by chance, and have no weights to start as."""
    card = read_task("reacher").with_settings(["transfer.start=auto"])
    views = {chosen(card, [find("reacher-gentle:auto")], seed).files[0].view for seed in range(6)}
    assert views == {""}


def test_two_teachers_may_become_one_view():
    card = read_task("reacher").with_settings(["transfer.kickstart_schedule=auto"])
    files = [find("reacher-gentle"), find("reacher-gentle")]
    choice = chosen(card, files, 0)
    assert choice.files == tuple(files)
    assert choice.ranked[0].teachers == (0, 1)
    plan = Plan(card, "kickstart", [0], Path("run"), choice.files, ranked=choice.ranked)
    measurements = measurements_of(plan)
    assert measurements is not None
    assert measurements.betas().shape == (2, 1)


def test_a_teacher_who_leads_nobody_leaves_scratch_bit_for_bit(repaint, home):
    words = ["transfer", "--task", "reacher", *QUICK]
    said = repaint(*words, "--teacher", "reacher-away", "--run", "run")
    assert said.code == 0, said.err
    assert "automatic: no student learns from reacher-away" in said.out
    assert repaint(*words, "--method", "scratch", "--run", "scratch").code == 0
    runs = [read_run(home / name) for name in ("run", "scratch")]
    np.testing.assert_array_equal(runs[0].returns, runs[1].returns)
    gap = runs[0].rows["env_steps"] - runs[1].rows["env_steps"]
    assert (gap == sum(one.steps for one in runs[0].record.ranked)).all()


@pytest.mark.slow
def test_the_inner_lane_s_driver_teaches_the_outer_lane_in_the_mirror(tmp_path):
    open_plan = Plan(CAR, "repaint", [100, 101], tmp_path)
    plan = with_teachers(open_plan, ["racer-inner:auto"])
    assert [file.view for file in plan.teachers] == ["mirrored"]
    assert plan.task.transfer.start == "teacher"
    assert plan.task.net.flip_images
    assert sum(one.steps for one in plan.ranked) < 1700  # two episodes each, and what 1,500 allow
    by_q = with_teachers(
        replace(open_plan, method="instance", algorithm="q-learning"), ["racer-inner"]
    )
    assert by_q.ranked == ()
    assert by_q.transfer.start == "untrained"


HOW = [
    ["--method", "repaint"], ["--algorithm", "q-learning"], ["--preset", "paper"],
    ["--ratio", "1:1"], ["--beta", "0.2"], ["--beta-decay", "0.9"], ["--select", "top"],
    ["--threshold", "0.5"],
    ["--objective", "a2c"], ["--transfer-iterations", "3"], ["--instances-from", "old-hand"],
    ["--set", "transfer.alpha_2=0.5"], ["--set", "select.min_samples=3"],
]  # fmt: skip


@pytest.mark.parametrize("how", HOW, ids=" ".join)
def test_a_transfer_is_automatic_where_nothing_says_how(how):
    values = {name[2:].replace("-", "_"): value for name, value in [how]}
    options = TransferOptions(None, task="reacher", teacher=["old-hand"])
    assert options.automatic
    for name in ("set", "instances_from"):
        if name in values:
            values[name] = [values[name]]
    if "transfer_iterations" in values:
        values["transfer_iterations"] = 3
    assert not options._replace(**values).automatic
    assert options._replace(**values, auto=True).automatic
    assert options._replace(set=["ppo.n_iterations=3"], seeds=2, run="run").automatic
    assert options._replace(set=["transfer.teacher_episodes=3"]).automatic


def test_what_an_option_says_beside_auto_is_not_measured(repaint, home):
    words = ["--auto", "--select", "top", *QUICK[:2], *QUICK[4:], "--dry-run"]
    said = repaint("transfer", "--task", "reacher", "--teacher", "reacher-gentle", *words)
    assert said.code == 0, said.err
    assert 'rule = "top"' in said.out
    assert 'kickstart_schedule = "auto"' in said.out
