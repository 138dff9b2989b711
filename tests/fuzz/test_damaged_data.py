"""Runs, tables and cards from elsewhere, beyond reason."""

import json

import pytest
from read_damaged_files import Reading
from read_targets import METADATA
from test_damaged_files import HEAD, record

from repaint_cli.envs.racer.deepracer.model_files import read_model_metadata
from repaint_cli.envs.racer.deepracer.simtrace_reader import read_training
from repaint_cli.errors import CardError, CheckpointError, NotFound
from repaint_cli.files.limits import MAX_BYTES, MAX_CELLS, MAX_DEPTH, read_json
from repaint_cli.runs.reader import read_run
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.similarity import cosine

# ---- runs ----


def run_of(folder, text, table=HEAD + "\n"):
    (folder / "run.json").write_text(text)
    (folder / "metrics.csv").write_text(table)
    return read_run(folder)


RECORDS = {
    "nested": ("[" * 100_000, "expected at most 32 levels"),
    "digits": ('{"seeds": [' + "9" * 10_000 + "]}", "4300 digits"),
    "no object": ("[]", "damaged"),
    "bits": (record(seeds=[2**70]), "at most 64 bits"),
    "a million seeds": (record(seeds=list(range(10**6))), "expected at most 100,000 values"),
    "no seeds": (record(seeds=[]), "seeds: .*at least 1 item"),
    "a seed twice": (record(seeds=[1, 1]), "seeds: expected every seed once"),
    "a negative seed": (record(seeds=[-1]), "seeds.0: .*greater than or equal to 0, found -1"),
    "half a seed": (record(seeds=[0.5]), "seeds.0: .*valid integer, found 0.5"),
    "true": (record(seeds=[True]), "seeds.0: .*valid integer, found True"),
    "infinity": (record(seeds=[float("inf")]), "seeds.0: .*valid integer, found inf"),
    "a folder": (record(method="../x"), "method: expected a method or an algorithm of ours"),
    "another method": (record(algorithm="\x1b[2J"), r"algorithm: .*, found '\\x1b\[2J'"),
    "a teacher's name": (record(teachers=[{"name": "[/]"}]), "teachers.0.name: .*match pattern"),
    "a nameless teacher": (record(teachers=[{}]), "teachers.0.name: Field required"),
    "a surrogate": (record(state="\ud800"), "surrogates not allowed"),
    "a BOM and nothing": ("\ufeff{}", "method: Field required"),
    "another task": (record(task=[]), "task: .*valid dictionary"),
    "an old teacher": (record(schema_version=1, teacher=7), "teachers.0: .*"),
}


@pytest.mark.parametrize("case", RECORDS)
def test_a_record_beyond_reason_is_refused(tmp_path, case):
    text, message = RECORDS[case]
    with pytest.raises((CheckpointError, CardError), match=message):
        run_of(tmp_path, text)


def rows(*places):
    return "".join(f"\n{k},{seed},1,,10,0,," for k, seed in places) + "\n"


def test_a_sound_table_is_read_with_columns_to_spare(tmp_path):
    run = run_of(tmp_path, record(seeds=[3, 5]), HEAD + rows((1, 5), (1, 3), (2, 3)))
    assert run.returns.tolist() == [[1], [1]]  # what only one seed has does not count
    assert run.progress is None
    wide = (HEAD + rows((1, 0))).replace("\n", ",more\n")
    assert run_of(tmp_path, record(), wide).rows["env_steps"].tolist() == [[10]]


TABLES = {
    "nothing": ("", "expected one column 'iteration', found"),
    "a column less": (HEAD.replace("seconds", "x") + "\n", "expected one column 'seconds'"),
    "a column twice": (HEAD + ",seed\n", "expected one column 'seed'"),
    "a cell less": (HEAD + "\n1,0,1,,\n", "expected 8 cells, found 5 in row 1"),
    "a cell more": (HEAD + "\n1,0,1,,10,0,,,\n", "expected 8 cells, found 9 in row 1"),
    "a huge cell": (HEAD + rows((1, "0" * 200_000)), "lines of less than 65,536 characters"),
    "a NUL": (HEAD + rows((1, "\0")), "expected the seeds of run.json, found"),
    "no number": (HEAD + rows((1, 0)).replace("10", "ten"), "could not convert string to float"),
    "no return": (HEAD + rows((1, 0)).replace(",1,", ",,"), "expected a finite eval_return"),
    "infinity": (HEAD + rows((1, 0)).replace(",1,", ",1e999,"), "expected a finite eval_return"),
    "another seed": (HEAD + rows((1, 7)), "expected the seeds of run.json, found '7'"),
    "another order": (HEAD + rows((2, 0), (1, 0)), "expected iterations 1, 2, … of seed 0, found"),
    "a row twice": (HEAD + rows((1, 0), (1, 0)), "expected iterations 1, 2, … of seed 0, found"),
    "too many cells": (",".join([HEAD] + ["x"] * 5_000) + rows((1, 0)) * 900, "cells"),
}


@pytest.mark.parametrize("case", TABLES)
def test_a_table_beyond_reason_is_refused(tmp_path, case):
    table, message = TABLES[case]
    with pytest.raises(CheckpointError, match=message):
        run_of(tmp_path, record(), table)


def test_a_table_has_its_limit(tmp_path, monkeypatch):
    monkeypatch.setattr("repaint_cli.files.limits.MAX_CELLS", 16)
    assert run_of(tmp_path, record(), HEAD + rows((1, 0)))
    with pytest.raises(CheckpointError, match="expected at most 16 cells, found more"):
        run_of(tmp_path, record(), HEAD + rows((1, 0), (2, 0), (3, 0)))


STEPS = (
    "episode,X,Y,yaw,steer,throttle,action,reward,progress,closest_waypoint,episode_status,"
    "tstamp,track_len,steps"
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected one column 'episode'"),
        (f"{STEPS}\n1,x,0,0,0,0,0,0,0,0,off,0,9,1\n", "could not convert"),
        (f"{STEPS}\n1,nan,0,0,0,0,0,0,0,0,off,0,9,1\n", r"numbers within 2\^53"),
        (f"{STEPS}\n1,0,0,0,0,0,1e300,0,0,0,off,0,9,1\n", r"numbers within 2\^53"),
        (f"{STEPS}\n1,0,0\n", "expected 14 cells, found 3"),
    ],
)
def test_a_damaged_log_is_refused(tmp_path, text, message):
    (tmp_path / "training-simtrace").mkdir()
    (tmp_path / "training-simtrace" / "0-iteration.csv").write_text(text)
    with pytest.raises(CheckpointError, match=message):
        list(read_training(tmp_path))


def test_other_files_among_the_logs_are_passed_over(tmp_path):
    for name in ("x-iteration.csv", "²-iteration.csv", "-1-iteration.csv"):
        (tmp_path / "training-simtrace").mkdir(exist_ok=True)
        (tmp_path / "training-simtrace" / name).write_text("")
    assert list(read_training(tmp_path)) == []


LARGE = {
    "one text": json.dumps(["\U0001f600" * 2_000_000], ensure_ascii=False),
    "a wide text": json.dumps("x" * (MAX_BYTES - 8) + "\U0001f600", ensure_ascii=False),
    "objects": json.dumps([{"": 0}] * 49_000),
    "keys": json.dumps({str(n): str(n) for n in range(99_000)}),
}


@pytest.mark.parametrize("case", LARGE)
def test_the_largest_texts_take_their_share_of_memory(tmp_path, case):
    (tmp_path / "x.json").write_text(LARGE[case], encoding="utf-8")
    reading = Reading()
    with reading.watched(case, LARGE[case].encode()):
        assert read_json(tmp_path / "x.json")
    assert reading.failures == []


@pytest.mark.slow
def test_the_largest_tables_take_their_share_of_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("read_damaged_files.SECONDS", 30.0)
    table = HEAD + rows(*((k, 0) for k in range(1, MAX_CELLS // 8 - 1)))
    (tmp_path / "training-simtrace").mkdir()
    steps = range(1, MAX_CELLS // 14 - 1)
    log = f"{STEPS}\n" + "".join(f"1,0,0,0,0,0,0,0,0,0,off,0,9,{n}\n" for n in steps)
    (tmp_path / "training-simtrace" / "0-iteration.csv").write_text(log)
    reading = Reading()
    run_of(tmp_path, record(), table)
    with reading.watched("metrics.csv", table.encode()):
        assert read_run(tmp_path).returns.shape == (1, MAX_CELLS // 8 - 2)
    with reading.watched("a log", log.encode()):
        ((_, (episode,)),) = read_training(tmp_path)
    assert len(episode.trace) == MAX_CELLS // 14 - 2
    assert reading.failures == []


def test_a_log_has_so_many_episodes(tmp_path):
    (tmp_path / "training-simtrace").mkdir()
    log = STEPS + "\n" + "".join(f"{n},0,0,0,0,0,0,0,0,0,off,0,9,1\n" for n in range(10_001))
    (tmp_path / "training-simtrace" / "0-iteration.csv").write_text(log)
    with pytest.raises(CheckpointError, match="expected at most 10,000 episodes, found more"):
        list(read_training(tmp_path))


# ---- cards ----

TOML = {
    "nested": ("x = " + "[" * 30_000, "expected at most 32 levels"),
    "nested tables": ("x = " + "{a = " * 10_000, "expected at most 32 levels"),
    "levels": (f"x = {'[' * 40}{']' * 40}", "expected at most 32 levels"),
    "a long key": ("a." * 30_000 + "b = 1", "expected at most 32 parts in a key"),
    "a long table": ("[" + '"=".' * 10_000 + "b]", "expected at most 32 parts in a key"),
    "a long spaced key": ("a . " * 15_000 + "b = 1", "expected at most 32 parts in a key"),
    "digits": ("x = " + "9" * 10_000, "4300 digits"),
    "hexadecimal": ("x = 0x" + "f" * 10_000, "at most 64 bits"),
    "a date": ("[ppo]\ngamma = 1979-05-27", "ppo.gamma: .*valid number, found datetime.date"),
    "infinity": ("[ppo]\ngamma = inf", "ppo.gamma: .*found inf"),
    "a key twice": ("x = 1\nx = 2", "Cannot overwrite a value"),
    "a surrogate": ('x = "\\ud800"', "not a Unicode scalar value"),
    "NUL": ("x = '\0'", "Found invalid character"),
    "a tenth of a megabyte": ("#" * 100_000, "expected at most 65,536 bytes, found 100,"),
    "itself": ('extends = "mine"', "unknown task 'mine'"),
    "a file": ('extends = "mine.toml"', "unknown task 'mine.toml'"),
    "a list": ("extends = [1]", r"unknown task '\[1\]'"),
    "a folder": ('name = "../../x"', "name: expected a name that a folder can have"),
    "markup": ('name = "[/]"', "name: expected a name that a folder can have"),
}


@pytest.mark.parametrize("case", TOML)
def test_a_card_of_ones_own_beyond_reason_is_refused(home, case):
    text, message = TOML[case]
    base = "" if "extends" in text else 'extends = "racer-inner"\n'
    (home / "mine.toml").write_text(base + text)
    reading = Reading()
    with reading.watched(case, b""), pytest.raises((CardError, NotFound), match=message) as caught:
        read_task("mine.toml")
    assert reading.failures == []
    assert len(str(caught.value)) < 1000


def test_cards_that_extend_each_other_are_no_tasks(home):
    (home / "reacher.toml").write_text('extends = "reacher"')
    assert read_task("reacher.toml") == read_task("reacher")  # the shipped one
    (home / "a.toml").write_text('extends = "b"')
    (home / "b.toml").write_text('extends = "a"')
    with pytest.raises(NotFound, match="unknown task 'b'"):
        read_task("a.toml")


def test_keys_are_as_deep_as_they_may_be(home):
    (home / "mine.toml").write_text("# " + "." * 1000 + "\nx" + ".y" * (MAX_DEPTH - 2) + " = 1.5")
    with pytest.raises(CardError, match=r"unknown key 'x'|Field required"):
        read_task("mine.toml")


def test_weights_beyond_the_squares_of_numbers_are_as_alike_as_others():
    huge, one = (
        read_task("reacher").with_settings([f"reward.reward_dist={w}", f"reward.reward_ctrl={w}"])
        for w in (1.7e308, 1)
    )
    assert cosine(huge, one) == pytest.approx(1)


@pytest.mark.parametrize("weight", [1e-200, 5e-324, 1e300, 1.7e308])
def test_weights_of_any_size_have_a_cosine(weight):
    tiny = read_task("reacher").with_settings([f"reward.reward_dist={weight}"])
    both = read_task("reacher").with_settings(["reward.reward_dist=3", "reward.reward_ctrl=3"])
    assert 0 < cosine(tiny, both) < 1
    assert cosine(tiny, tiny) == pytest.approx(1)
    assert cosine(both, both) == pytest.approx(1)


ACTION = {"steering_angle": 1, "speed": 1}
SPACES = {
    "a million": (json.dumps({"action_space": [ACTION] * 10**6}), "expected at most 8,388,608"),
    "many": (json.dumps({"action_space": [ACTION] * 10**5}), "expected at most 100,000 values"),
    "nested": ('{"action_space": ' + "[" * 90_000, "expected at most 32 levels"),
    "infinity": ('{"action_space": [{"steering_angle": 1e999, "speed": 1}]}', "finite numbers"),
    "a text": ('{"action_space": "' + "x" * 10_000 + '"}', "found 'x{59}$"),
    "numbers": ('{"action_space": [1, 2]}', "to list steering_angle and speed, found"),
    "sensors": (json.dumps(METADATA | {"sensor": ["x"] * 9 + [{}]}), "found x, {}|found {}, x"),
    "digits": ('{"action_space": [' + "9" * 5000 + "]}", "4300 digits"),
}


@pytest.mark.parametrize("case", SPACES)
def test_metadata_beyond_reason_are_refused(tmp_path, case):
    text, message = SPACES[case]
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(CardError, match=message):
        read_model_metadata(tmp_path / "x.json")
