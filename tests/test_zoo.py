"""Teachers: one file each, found by name, told apart when damaged."""

import json
import re
from pathlib import Path
from unittest.mock import Mock

import pytest
import torch
from small_runs import REACHER, add_teacher, weights_of

from repaint_cli.errors import CheckpointError, NotFound, RepaintError, StoreError, TeacherMismatch
from repaint_cli.files.paths import shipped, shipped_tasks
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import Score, check_name, read_card

SHIPPED = sorted(shipped("zoo").glob("*.safetensors"))


@pytest.fixture
def folder(home):
    return home / "home" / "zoo"


def test_a_teacher_acts_after_loading_as_it_did_before_to_the_bit(folder):
    task = read_task("reacher")
    network = ActorCritic(REACHER, task.net, 3)
    network.storage.normal_(generator=torch.Generator().manual_seed(0))
    obs = torch.randn(3, 50, 10, generator=torch.Generator().manual_seed(1))
    for s in range(3):
        network.normalizer.update(s, obs[s] * (s + 1) + s)
    card = read_card(add_teacher(folder))
    path = store.add(network, 1, card, folder)
    loaded, read = store.read_teacher(path, n_seeds=2)
    with torch.no_grad():
        before, after = network.policy(obs), loaded.policy(obs[1].expand(2, -1, -1))
        values, read_values = network.value(obs), loaded.value(obs[1].expand(2, -1, -1))
    for s in range(2):
        assert torch.equal(after.mean[s], before.mean[1])
        assert torch.equal(after.log_std[s], before.log_std[1])
        assert torch.equal(read_values[s], values[1])
    assert read == card


def test_the_users_teacher_comes_before_a_shipped_one_of_the_same_name(home, folder, monkeypatch):
    theirs = add_teacher(home / "shipped", "twin")
    other = add_teacher(home / "shipped", "other")
    monkeypatch.setattr(store, "shipped", lambda kind: home / kind.replace("zoo", "shipped"))
    assert store.teachers() == {"other": other, "twin": theirs}
    mine = add_teacher(folder, "twin")
    assert store.find("twin") == mine
    assert store.find("other") == other
    assert store.find(str(theirs)) == theirs


def test_half_written_files_are_no_teachers(folder):
    add_teacher(folder).rename(folder / ".old-hand-x.safetensors")
    assert not [path for path in store.teachers().values() if path.parent == folder]


@pytest.mark.parametrize("name", ["", "../x", "a b", ".hidden", "x" * 65, "é", "a/b"])
def test_names_that_make_no_file_are_refused(name):
    with pytest.raises(StoreError, match="expected a teacher's name of 1 to 64 letters"):
        check_name(name)


@pytest.mark.parametrize("name", ["a", "Racer-inner_2.1", "x" * 64])
def test_other_names_are_fine(name):
    check_name(name)


def test_an_unknown_teacher_has_its_neighbours_named(folder):
    add_teacher(folder, "old-hand")
    with pytest.raises(NotFound, match="unknown teacher 'oldhand'; did you mean old-hand"):
        store.find("oldhand")
    with pytest.raises(NotFound, match=r"unknown teacher 'no\.safetensors'"):
        store.find("no.safetensors")


def test_a_teacher_of_other_spaces_is_refused_with_both_and_who_fits(folder):
    add_teacher(folder, "fits")
    (folder / "damaged.safetensors").write_bytes(b"\0" * 100)
    small = add_teacher(folder, "small", spaces=Spaces((4,), 3, True))
    message = (
        "teacher 'small' has 4 observations and 3 discrete actions, task 'reacher' has "
        "10 observations and 2 continuous actions; teachers that fit: .*fits"
    )
    with pytest.raises(TeacherMismatch, match=message):
        store.check_fits([read_card(small)], read_task("reacher"), REACHER)


def test_a_teacher_of_other_reward_terms_is_refused(folder):
    path = add_teacher(folder, "run", settings=["reward.run=1"])
    message = "'run' knows the reward terms reward_dist, reward_ctrl, run, task 'reacher' has"
    with pytest.raises(TeacherMismatch, match=message):
        store.check_fits([read_card(path)], read_task("reacher"), REACHER)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda card: card.pop("seed"), "its card does not fit: seed: Field required"),
        (lambda card: card.update(mood="good"), "its card does not fit: unknown key 'mood'"),
        (lambda card: card.update(schema_version=2), "its card does not fit: schema_version"),
        (lambda card: card["task"]["ppo"].update(gamma=2), "its card does not fit: task.ppo.gamma"),
    ],
)
def test_a_card_that_says_something_it_may_not_is_refused(folder, spoil, message):
    path = add_teacher(folder)
    rewritten(path, spoil)
    with pytest.raises(CheckpointError, match=message):
        read_card(path)


def rewritten(path, spoil):
    """Change a teacher's card in its file."""
    from repaint_cli.policies.weights import load, save

    tensors, card = load(path)
    spoil(card)
    save(path, tensors, card)


def test_a_card_of_other_spaces_than_the_weights_is_refused(folder):
    path = add_teacher(folder)
    rewritten(path, lambda card: card.update(n_actions=3))
    message = (
        r"teacher 'old-hand': leaf 'policy.head.weight' is \(64, 2\) float32 in the file, \(64, 3\)"
    )
    with pytest.raises(CheckpointError, match=message):
        store.read_teacher(path)


def test_a_file_cut_short_anywhere_is_refused(folder):
    path = add_teacher(folder)
    whole = path.read_bytes()
    for length in [*range(0, 64), *range(64, len(whole), len(whole) // 40), len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(CheckpointError, match="is not a whole safetensors file"):
            store.read_teacher(path)


def test_a_flipped_bit_in_the_header_is_explained_or_harmless(folder):
    path = add_teacher(folder)
    whole = path.read_bytes()
    header = 8 + int.from_bytes(whole[:8], "little")
    refused = 0
    for i in [*range(16), *range(16, header, header // 200)]:
        for bit in (0, 6):
            flipped = bytearray(whole)
            flipped[i] ^= 1 << bit
            path.write_bytes(flipped)
            try:
                store.read_teacher(path)
            except RepaintError as error:
                assert "\n" not in str(error)  # noqa: PT017 - some flips only change a number
                refused += 1
    assert refused > 200


def test_zoo_verify_names_the_sound_and_the_damaged(repaint, folder):
    add_teacher(folder, "sound")
    (folder / "broken.safetensors").write_bytes(b"\0" * 100)
    said = repaint("zoo", "verify")
    assert "sound: sound\n" in said.out
    assert said.code == CheckpointError.exit_code
    assert "broken: " in said.err
    assert "sound" not in said.err
    assert repaint("zoo", "verify", "sound").code == 0


def test_a_file_is_yours_shipped_or_elsewhere(home, folder, monkeypatch):
    mine = add_teacher(folder, "mine")
    assert (store.own_file("mine"), store.whose(mine)) == (mine, "yours")
    assert store.whose(SHIPPED[0]) == "shipped"
    assert store.whose(add_teacher(home, "other")) == ""
    monkeypatch.chdir(folder)
    assert store.whose(Path("mine.safetensors")) == "yours"
    for name in ("REPAINT_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", Mock(side_effect=RuntimeError))
    assert [store.whose(path) for path in (mine, SHIPPED[0])] == ["", "shipped"]


def test_a_score_reads_alike_everywhere():
    score = Score(mean=-17.034, low=-17.351, high=-16.714, episodes=20)
    assert str(score) == f"{score.interval} over 20 episodes"
    assert score.interval == "-17.03 [-17.35, -16.71]"


def test_zoo_list_survives_a_damaged_file(repaint, folder):
    add_teacher(folder, "mine")
    (folder / "broken.safetensors").write_bytes(b"\0" * 100)
    said = repaint("zoo", "list")
    assert said.code == 0
    rows = {line.split()[0]: line for line in said.out.splitlines()}
    assert "damaged" in rows["broken"]
    assert rows["mine"].split()[-1] == "yours"


def test_zoo_list_can_name_only_those_that_fit(repaint, folder):
    add_teacher(folder, "mine")
    add_teacher(folder, "small", spaces=Spaces((4,), 3, True))
    said = repaint("zoo", "list", "--fits", "reacher")
    assert "mine" in said.out
    assert "small" not in said.out


def test_zoo_show_prints_the_card_as_json(repaint, folder):
    add_teacher(folder, "mine")
    shown = json.loads(repaint("zoo", "show", "mine", "--json").out)
    assert shown["name"] == "mine"
    assert shown["task"]["reward"] == {"reward_dist": 1, "reward_ctrl": 1}


def test_the_shipped_teachers_are_there():
    expected = {
        "racer-avoid", "racer-inner", "racer-outer", "reacher", "reacher-gentle", "reacher-away",
    }  # fmt: skip
    assert expected <= {path.stem for path in SHIPPED}


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_teacher_is_sound_small_scored_and_of_the_task_as_it_is_now(path):
    _, card = store.read_teacher(path)
    assert card.name == path.stem
    assert path.stat().st_size <= (9e6 if card.n_beams else 8e6)  # a lidar has layers of its own
    assert card.score.low <= card.score.mean <= card.score.high
    assert card.task.name in shipped_tasks()
    now = read_task(card.task.name)
    assert (card.task.env.settled(), card.task.reward) == (now.env.settled(), now.reward)
    assert weights_of(path)


def test_the_shipped_racer_laps_its_own_lane(repaint):
    said = repaint("eval", "racer-inner", "--episodes", 5)
    laps = int(re.search(r"(\d) of 5", said.out)[1])
    assert laps >= 4
