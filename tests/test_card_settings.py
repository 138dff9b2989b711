"""Settings of cards: in which cards differ, what they read like, and values as TOML."""

import tomllib

import pytest

from repaint_cli.files.toml import toml_key, toml_value
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_settings import differing, setting_text, settings_of


def test_cards_differ_in_what_is_set():
    card = read_task("reacher")
    other = card.with_settings(["ppo.gamma=0.5", "net.hidden=[8]"])
    each = settings_of(card), settings_of(other)
    assert sorted(differing(*each)) == ["net.hidden", "ppo.gamma"]
    assert differing(each[0], each[0]) == []
    assert [setting_text(own, "net.hidden") for own in each] == ["[64, 64]", "[8]"]
    assert not any(name.startswith("net.") for name in settings_of(card, ["net"]))


def test_an_absent_setting_is_one_that_is_none():
    assert differing({"a.x": None, "b.y": 1}, {"b.y": 2}, {"c.z": 3}) == ["b.y", "c.z"]
    assert setting_text({"a.x": None}, "a.x") == setting_text({}, "a.x") == "absent"


def test_values_that_differ_behind_the_cut_differ():
    each = [{"a.x": [0] * 40 + [last]} for last in (1, 2)]
    assert differing(*each) == ["a.x"]
    assert [setting_text(own, "a.x", 10) for own in each] == ["[0, 0, 0,…"] * 2


@pytest.mark.parametrize(
    "value",
    [1, 0.5, 1e20, float("inf"), True, 'a "b" \\ é', "a\x1b\u202e", [1, (2.0,)], [],
     {"a b": 1, "c": {"d": [True]}}, {}],
)  # fmt: skip
def test_values_are_toml(value):
    text = toml_value(value)
    assert text.isprintable()
    wanted = [1, [2.0]] if value == [1, (2.0,)] else value
    assert tomllib.loads(f"x = {text}") == {"x": wanted}


def test_none_is_left_out_and_keys_are_quoted_where_they_must_be():
    assert toml_value({"a": None, "b": 1}) == "{ b = 1 }"
    assert (toml_key("a-b_1"), toml_key("a b")) == ("a-b_1", '"a b"')
