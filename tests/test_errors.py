"""Bad input: one line that says what was wanted, found and to do, the exit code of its class.

And nothing half-written: a command that fails leaves the folder as it was.
"""

import json
import re

import numpy as np
import pytest
from safetensors.numpy import save_file
from small_runs import QUICK, add_teacher, files_below
from test_files import full_disk

from repaint_cli import errors
from repaint_cli.cli.app import main
from repaint_cli.files import atomic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.policies.weights import load, save

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch"]
TRANSFER = ["transfer", "--task", "reacher", "--teacher", "old-hand"]
BY_Q = [*TRANSFER, "--algorithm", "q-learning"]
USAGE, NOT_FOUND, CARD, MISMATCH, CHECKPOINT, STORE = 2, 2, 3, 4, 5, 7


def sets(*settings):
    return [*SCRATCH, *(word for setting in settings for word in ("--set", setting))]


@pytest.fixture
def zoo(home):
    """A zoo with a teacher for Reacher, one for nothing, and one of another network."""
    folder = home / "home" / "zoo"
    add_teacher(folder)
    add_teacher(folder, "stranger", spaces=Spaces((4,), 3, True))
    add_teacher(folder, "narrow", settings=["net.hidden=[32,32]"])
    add_teacher(folder, "runner", settings=["reward.run=1"])
    return folder


def check(repaint, home, words, code, message):
    """Type a command that is to fail, and see how it does."""
    before = files_below(home)
    said = repaint(*words)
    assert said.err.startswith("error: "), said.err
    assert (said.err.count("\n"), said.out) == (1, "")
    assert re.search(message, said.err), said.err
    assert said.code == code
    assert files_below(home) == before
    folders = {path.name for path in home.rglob("*") if path.is_dir()}
    assert folders <= {"home", "zoo", "run", "evaluations"}


NAMES = [
    ([*SCRATCH, "--task", "reachr"],
     r"unknown task 'reachr'; did you mean reacher or .*\? see: repaint tasks list"),
    (["transfer", "--task", "x.toml"],
     "there is no card at 'x.toml'; start one: repaint tasks copy reacher x.toml"),
    (["transfer", "--task", "reacher", "--teacher", "old-hant"],
     r"unknown teacher 'old-hant'; did you mean old-hand\? see: repaint zoo list"),
    (["transfer", "--task", "reacher"],
     r"method 'repaint' needs a teacher: --teacher NAME \(repaint zoo list\)"),
    ([*TRANSFER, "--method", "repain"],
     r"unknown method 'repain'; did you mean repaint or .*\? see: repaint transfer --help"),
    (sets("pop.gamma=0.9"),
     r"unknown setting 'pop.gamma'; did you mean ppo.gamma\? see: repaint tasks show reacher"),
    (sets("ppo.gama=0.9"),
     r"unknown setting 'ppo.gama'; did you mean ppo.gamma\? see: repaint tasks show reacher"),
    (sets("env.track=oval"), "unknown setting 'env.track'; .*see: repaint tasks show reacher"),
    (["transfer", "--task", "racer-inner", "--method", "scratch", "--set", "env.track=ovl"],
     r"unknown track 'ovl'; there are oval, reinvent-like"),
    (["eval"], "expected a run below runs/, found none; train: repaint train-teacher --task"),
    (["eval", "old-hant"], r"unknown teacher 'old-hant'; did you mean old-hand\?"),
    (["eval", "home"], "expected a run's folder with run.json, found none at home"),
    (["similarity", "reacher", "racr-inner"],
     "unknown task or teacher 'racr-inner'; did you mean racer-inner"),
    (["compare", "nowhere"], "expected a run's folder with run.json, found none at nowhere"),
    (["tasks", "show", "qqq"], "unknown task 'qqq'; see: repaint tasks list"),
    (["zoo", "show", "qqq"], "unknown teacher 'qqq'; see: repaint zoo list"),
    ([*TRANSFER, "--algorithm", "q"], "unknown algorithm 'q'"),
    ([*TRANSFER, "--preset", "coatch"],
     "unknown preset 'coatch'; did you mean coach"),
    (["zoo", "verify", "qqq"], "unknown teacher 'qqq'; see: repaint zoo list"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "message"), NAMES, ids=lambda x: "")
def test_unknown_names(repaint, home, zoo, words, message):
    check(repaint, home, words, NOT_FOUND, message)


SETTINGS = [
    (sets("ppo.gamma=2"), "task 'reacher': ppo.gamma: .*less than or equal to 1, found 2"),
    (sets("ppo.gamma=much"), "ppo.gamma: .*valid number, .*found 'much'"),
    (sets("select.scale=some"), "select.scale: .*'teacher-batch', 'student-batch' or 'none'"),
    (sets("reward.reward_dist=nan"), "reward.reward_dist: .*finite number, found nan"),
    (sets("reward.reward_dist=0", "reward.reward_ctrl=0"), "one weight must differ from 0"),
    (sets("reward.run=1"),
     "reports no 'run' in 50 steps; its info has: reward, reward_ctrl, reward_dist"),
    (sets("env.id=Reachr-v5"), "cannot make the environment 'Reachr-v5': .*"),
    (sets("env.id=nothing:Reachr-v5"), "cannot make the environment .*: No module named 'nothing'"),
    (sets("env.id=FrozenLake-v1"), "expected observations in a vector or an image, .* and actions"),
    (sets("net.kind=cnn"), "net.kind 'cnn' reads an image, the task gives 10 observations"),
    (sets("ppo.n_envs=41", "ppo.continue_episodes=false"),
     "n_steps / ppo.n_envs of at least 51 .*; try --set ppo.n_envs=40"),
    (["transfer", "--task", "racer-inner", "--method", "scratch", "--set", "env.car=bus"],
     "env.car: .*'sim4', 'sim5' or 'ideal', found 'bus'"),
    (["transfer", "--task", "racer-inner", "--method", "scratch",
      "--set", "net.conv=[[8,200,1]]"], "net.conv layer 0 needs a larger image: 120×160×1"),
    (["transfer", "--task", "racer-inner", "--method", "scratch",
      "--set", "net.conv=[[8,4,0]]"], "net.conv.*: .*greater than 0, found 0"),
    (sets("net.hidden=[-3]"), "net.hidden.*: .*greater than 0, found -3"),
    (sets("transfer.joint=true"), "transfer.joint: expected False; use --method repaint-joint"),
    (sets("env.backend=envpool", "env.kwargs={reset_noise_scale=0.1}"),
     "expected no env.kwargs with env.backend envpool, found reset_noise_scale"),
    (["eval", "old-hand", "--noise", "paper"], "--noise with a racing task, found 'reacher'"),
    (["tasks", "check", "mine.toml"], "mine.toml: unknown key 'ppo.gama'"),
    (["compare", "home"], "expected runs of one task, found no run"),
    ([*TRANSFER, "--auto", "--eval-episodes", 1], "expected at least 2 episodes per evaluation"),
]  # fmt: skip
SETTINGS += [
    ([*TRANSFER, option, number], f"{key}: .*greater than .*, found {number}")
    for option, number, key in (
        ("--beta", -1, "transfer.kickstart_coef"),
        ("--beta-decay", -0.5, "transfer.kickstart_decay"),
        ("--transfer-iterations", -1, "transfer.iterations"),
        ("--iterations", -1, "ppo.n_iterations"),
        ("--iterations", 0, "ppo.n_iterations"),
        ("--eval-episodes", -1, "eval.episodes"),
    )
]
SETTINGS += [
    (BY_Q, "expected numbered actions for q-learning, found 10 observations and 2 continuous"),
    (["transfer", "--task", "reacher", *["--teacher", "old-hand"] * 4, "--set", "ppo.n_steps=200",
      "--set", "ppo.n_envs=2"], "expected ppo.n_steps of at least 204, which 4 share, .*found 200"),
    ([*TRANSFER, "--threshold", "much"], "select.threshold: .*valid number, .*found 'much'"),
    ([*BY_Q, "--threshold", -1], "q_learning.threshold: .*greater than .*, found -1"),
    ([*TRANSFER, "--beta", "0.2,0.1"],
     r"expected one --beta, or one for each --teacher \(1\), found 2"),
    ([*TRANSFER, "--beta", "0.2,-1"], "transfer.kickstart_coef.*: .*greater than .*, found -1"),
    ([*TRANSFER, "--select", "best"], "select.rule: .*'zeta', 'abs', 'top', .*found 'best'"),
    ([*TRANSFER, "--objective", "ppo"], "ppo.objective: .*'clipped', 'a2c', .*found 'ppo'"),
    ([*TRANSFER, "--set", "transfer.kickstart_schedule=steep"],
     "transfer.kickstart_schedule: .*'geometric', 'linear', .*found 'steep'"),
    (["transfer", "--task", "racer-inner", "--teacher", "racer-inner", "--teacher", "racer-outer",
      "--teacher", "racer-inner"], "expected transfer.teacher_episodes of at least 3, .*found 2"),
    (["transfer", "--task", "racer-inner", "--teacher", "racer-inner", "--select", "rbt"],
     "expected vectors to observe with --select rbt, found 120×160×1 observations"),
    (["transfer", "--task", "racer-outer", "--teacher", "racer-inner", "--method", "warm-start",
      "--set", "transfer.warm_start_log_std=0"],
     "transfer.warm_start_log_std is for continuous actions; leave it out"),
    ([*TRANSFER, "--threshold", "nan"], "select.threshold: .*finite number, found nan"),
    (["eval", "old-hand", "--episodes", -2], "eval.episodes: .*greater than 0, found -2"),
    (["eval", "old-hand", "--episodes", 0], "eval.episodes: .*greater than 0, found 0"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "message"), SETTINGS, ids=lambda x: "")
def test_settings_that_may_not_be(repaint, home, zoo, words, message):
    (home / "mine.toml").write_text('extends = "reacher"\n[ppo]\ngama = 0.9')
    check(repaint, home, words, CARD, message)


USAGES = [
    (sets("gamma=0.9"), "expected --set section.key=value, found 'gamma=0.9'"),
    (sets("ppo.gamma"), "expected --set section.key=value, found 'ppo.gamma'"),
    (["compare", "home", "--jobs", 2], "--jobs is for --task or --resume; leave it out"),
    (["compare", "home", "--target", "much"], "expected --target as a number, several such"),
    (["compare", "home", "--target", "-9,nan"], "such as -9,-8, or auto; found '-9,nan'"),
    (["compare", "home", "--trajectories", "--report", "x"], "--report is for figures of returns"),
    (["compare", "home", "--report", "x", "--output", "y"], "--output is for a single picture"),
    ([*TRANSFER, "--threshold", 0.3, "--select", "top"],
     "--threshold is for --select zeta or abs, found select.rule top"),
    ([*TRANSFER, "--auto", "--beta-decay", 0.9], "β is automatic here; leave out --beta and"),
    (["compare", "home", "--trajectories", "--target", 0], "--target is for figures of returns"),
    (["compare", "home", "--trajectories", "--reference", "x"], "--reference is for figures of"),
    (["compare", "--task", "reacher", "--methods", "scratch", "--reference", "repaint"],
     "expected --reference among what is compared, found 'repaint'"),
    (["compare", "--task", "reacher", "--methods", ""], "expected --methods such as scratch,kick"),
    (["compare", "--task", "reacher", "--methods", "scratch,scratch"], "expected --methods such"),
    (["compare", "--task", "reacher", "--jobs", 0], "and --jobs of at least 1, found .* and 0"),
    ([*BY_Q, "--method", "repaint"],
     "expected --method instance or scratch with --algorithm q-learning, found 'repaint'"),
    ([*TRANSFER, "--threshold", "auto", "--select", "top"],
     "--threshold auto selects by itself; leave out --select top"),
    ([*TRANSFER, "--method", "kickstart", "--auto"],
     "expected an option that method 'kickstart' uses, found --auto"),
    ([*BY_Q, "--ratio", "1:1"],
     "expected an option that method 'instance' of q-learning uses, found --ratio"),
    ([*TRANSFER, "--beta", "0.2,x"], "expected --beta as a number, or one for each teacher"),
    ([*TRANSFER, "--instances-from", "narrow"],
     "expected --instances-from one of old-hand, found 'narrow'"),
    ([*TRANSFER, "--teacher", "narrow", "--method", "warm-start"],
     "expected one --teacher to warm-start from, found 2"),
    ([*TRANSFER, "--seeds", 0], "--seeds of at least 1 and --seed of at least 0, found 0 and 0"),
    ([*TRANSFER, "--seed", -1], "--seeds of at least 1 and --seed of at least 0, found 1 and -1"),
    (["eval", "old-hand", "--seed", -1], "--seed of at least 0, found 1 and -1"),
    (["eval", "old-hand", "--render-offscreen", "--video-episodes", -2],
     "expected --video-episodes of at least 1, found -2"),
]  # fmt: skip
USAGES += [
    ([*TRANSFER, "--ratio", ratio], "expected --ratio R:I, R representation .*such as 1:1 or 2:1")
    for ratio in ("0:0", "0:1", "x", "1", "1:1:1", "-1:1", "1:-1", "1.5:1", "²:1", "")
]
USAGES += [
    ([*TRANSFER, "--method", method, option, value],
     f"expected an option that method '{method}' uses, found {option}; leave it out")
    for method, option, value in (
        ("scratch", "--teacher", "old-hand"),
        ("warm-start", "--transfer-iterations", 3),
        ("instance", "--beta-decay", 0.9),
        ("kickstart", "--threshold", 0.3),
        ("kickstart", "--ratio", "2:1"),
        ("repaint-joint", "--ratio", "2:1"),
    )
]  # fmt: skip
USAGES += [
    ([*SCRATCH, "--beta", 0.1], "method 'scratch' uses, found --beta; leave it out"),
    (["compare", "--task", "reacher", "--methods", "scratch", "--teacher", "old-hand"],
     "expected methods that use a teacher, found scratch; leave out old-hand"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "message"), USAGES, ids=lambda x: "")
def test_options_that_may_not_be(repaint, home, zoo, words, message):
    check(repaint, home, words, USAGE, message)


BOTH = (
    "'stranger' has 4 observations and 3 discrete actions, task 'reacher' has 10 observations and "
    "2 continuous actions; teachers that fit: narrow, old-hand"
)
MISFITS = [
    ([*TRANSFER, "--teacher", "stranger"], BOTH),
    (["eval", "stranger", "--task", "reacher"], BOTH),
    ([*TRANSFER, "--teacher", "runner"],
     "'runner' knows the reward terms reward_dist, reward_ctrl, run, task 'reacher' has"),
    ([*TRANSFER, "--teacher", "runner", "--method", "kickstart", "--beta", "1,1"],
     "'runner' knows the reward terms"),
    (["transfer", "--task", "reacher", "--teacher", "narrow", "--method", "warm-start"],
     r"a warm start needs equal networks: teacher 'narrow': leaf 'policy.0.weight' is \(10, 32\) "
     r"float32 in the file, \(10, 64\) float32 in the network"),
    ([*TRANSFER, "--method", "warm-start", "--set", "net.obs_clip=none"],
     "a warm start needs equal networks: teacher 'old-hand' has net.obs_clip 5.0, task 'reacher' "
     "has none; try --set net.obs_clip=5.0"),
    ([*TRANSFER, "--method", "warm-start", "--set", "net.obs_normalize=false"],
     "a warm start needs equal networks: teacher 'old-hand' has net.obs_normalize true, task "
     "'reacher' has false; try --set net.obs_normalize=true"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "message"), MISFITS, ids=lambda x: "")
def test_teachers_and_tasks_that_do_not_fit(repaint, home, zoo, words, message):
    check(repaint, home, words, MISMATCH, message)


def test_each_misfit_is_named_in_one_line(repaint, home, zoo):
    said = repaint(*TRANSFER, "--teacher", "stranger", "--teacher", "runner")
    assert said.err.startswith("error: teacher " + BOTH.partition(";")[0] + "; teacher 'runner'")
    assert "'runner' knows the reward terms" in said.err
    assert "; teachers that fit: narrow, old-hand, " in said.err
    assert said.err.count("\n") == 1
    assert said.code == MISMATCH


def test_a_run_and_a_task_that_do_not_fit(repaint, lay, home):
    lay(*SCRATCH, *QUICK, "--run", "run")
    message = (
        "policies in run have 10 observations and 2 continuous actions, task 'racer-inner' has "
        "120×160×1 observations and 10 discrete actions"
    )
    check(repaint, home, ["eval", "run", "--task", "racer-inner"], MISMATCH, message)


def cut(path):
    path.write_bytes(path.read_bytes()[:-1])


def flip(path):
    data = bytearray(path.read_bytes())
    data[10] ^= 64
    path.write_bytes(data)


def make_foreign(path):
    save_file({"x": np.zeros(3)}, path)


def make_nan(path):
    tensors, header = load(path)
    tensors["policy.head.bias"][0] = float("nan")
    save(path, tensors, header)


def flip_last(path):
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)


DAMAGES = [
    (cut, "is not a whole safetensors file .*; copy or train it again"),
    (flip, "is not a whole safetensors file .*; copy or train it again"),
    (lambda path: path.write_bytes(b""), "is not a whole safetensors file"),
    (make_foreign, "was not written by repaint: its header has no 'repaint' JSON"),
    (flip_last, "is not what was written: its sha256 does not match; copy or train it again"),
    (make_nan, "leaf '.*' holds numbers that are not finite"),
]
USES = [
    TRANSFER,
    [*TRANSFER, "--method", "warm-start"],
    ["eval", "old-hand"],
    ["zoo", "verify", "old-hand"],
]


@pytest.mark.parametrize("words", USES, ids=" ".join)
@pytest.mark.parametrize(("damage", "message"), DAMAGES, ids=lambda x: "")
def test_damaged_teachers(repaint, home, zoo, words, damage, message):
    damage(zoo / "old-hand.safetensors")
    said = repaint(*words)
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert re.search(message, said.err), said.err
    assert said.code == CHECKPOINT
    assert not (home / "runs").exists()


def test_a_learners_checkpoint_is_no_teacher(repaint, lay, home):
    lay(*SCRATCH, *QUICK, "--run", "run")
    words = ["transfer", "--task", "reacher", "--teacher", "run/checkpoint.safetensors"]
    check(repaint, home, words, CHECKPOINT, "its card does not fit: name: Field required")


STORES = [
    ([*SCRATCH, *QUICK, "--run", "run"], "run exists already; name another with --run"),
    ([*SCRATCH, *QUICK, "--run", "file/run"], "cannot make file/run: file is no folder"),
    (["train-teacher", "--task", "reacher", "--name", "old-hand"],
     "your zoo has a teacher 'old-hand' already; give another name, or --replace it"),
    (["train-teacher", "--task", "reacher", "--name", "a/b"], "expected a teacher's name of"),
    (["tasks", "copy", "reacher", "mine.yaml"], "expected a file that ends in .toml"),
    (["tasks", "copy", "reacher", "mine.toml"], "mine.toml exists already; give another name"),
    (["tasks", "copy", "reacher", "file/mine.toml"], "cannot write file/mine.toml: "),
]  # fmt: skip


@pytest.mark.parametrize(("words", "message"), STORES, ids=lambda x: "")
def test_places_that_cannot_be_written(repaint, home, zoo, words, message):
    (home / "run").mkdir()
    (home / "file").write_text("no folder")
    (home / "mine.toml").write_text("")
    check(repaint, home, words, STORE, message)


def test_a_zoo_that_cannot_be_written_is_found_out_before_training(repaint, home):
    (home / "home").write_text("no folder")
    words = ["train-teacher", "--task", "reacher", *QUICK, "--run", "run"]
    check(repaint, home, words, STORE, "cannot write to .*home/zoo: ")


def test_a_full_disk(repaint, home):
    with full_disk(20_000):
        said = repaint(*SCRATCH, *QUICK, "--run", "run")
    assert said.code == STORE
    assert re.fullmatch(
        r"error: cannot write run/checkpoint.safetensors: File too large\n", said.err
    )
    assert set(files_below(home / "run")) == {"metrics.csv", "run.json"}
    assert json.loads((home / "run" / "run.json").read_text())["iterations"] == 0


def test_a_full_disk_during_copy(repaint, home, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", fail)
    words = ["tasks", "copy", "reacher", "mine.toml"]
    check(repaint, home, words, STORE, "cannot write mine.toml: No space left on device")


def family(kind):
    return [kind, *(grandchild for child in kind.__subclasses__() for grandchild in family(child))]


def test_every_class_has_its_own_code_and_the_tree_on_top_says_so():
    own = [kind for kind in family(errors.RepaintError) if "exit_code" in vars(kind)]
    codes = {kind.__name__: kind.exit_code for kind in own}
    tree = dict(
        re.findall(r"^\W*(\w+) +(\d+) ", errors.__doc__.partition("\nOSError")[0], re.MULTILINE)
    )
    assert {name: int(code) for name, code in tree.items()} == codes
    assert len(set(codes.values())) == len(codes)


def test_brackets_in_a_message_are_printed(repaint):
    assert "found '[n_obs]'" in repaint(*SCRATCH, "--set", "[n_obs]").err


def test_debug_shows_where_it_happened(home, monkeypatch):
    monkeypatch.setattr("sys.argv", ["repaint", "--debug", "tasks", "show", "qqq"])
    with pytest.raises(errors.NotFound):
        main()
