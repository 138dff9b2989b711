"""What a reward function keeps in its variables is noticed."""

import pytest

from repaint_cli.envs.racer.deepracer.reward_file import RewardFunction

KEEPS = {
    "a number": ("n = 0", "global n; n += 1"),
    "a late number": ("", "global n; n = params['steps']"),
    "a list": ("n = [[]]", "n[0].append(1)"),
    "a circle": ("n = []; n.append(n)", "n.append(1)"),
    "an array": ("import numpy; n = numpy.zeros(3)", "n[1] += 1"),
    "an object": ("class N: k = 0\nn = N()", "n.k += 1"),
    "a class": ("class n: k = 0", "n.k += 1"),
    "a function": ("def n(): pass\nn.k = 0", "n.k += 1"),
    "a default": ("def n(k=[]): k.append(1)", "n()"),
    "a closure": (
        "def make():\n    k = [0]\n    def f(): k[0] += 1\n    return f\nn = make()",
        "n()",
    ),
    "a generator": ("import random; n = random.Random(1)", "n.random()"),
    "numpy's": ("import numpy; n = numpy.random.default_rng(1)", "n.random()"),
    "numpy's old": ("import numpy; n = numpy.random.RandomState(1)", "n.rand()"),
    "a counter": ("import itertools; n = itertools.count()", "next(n)"),
    "a queue": ("from collections import deque; n = deque([1, 2])", "n.rotate()"),
}


@pytest.mark.parametrize(("begins", "changes"), KEEPS.values(), ids=KEEPS)
def test_what_a_function_keeps_is_noticed(begins, changes):
    source = f"{begins}\ndef reward_function(params):\n    {changes}\n    return 1\n"
    function = RewardFunction("reward.py", source)
    assert function.remembers() == []
    function({"steps": 1.0}, 0)
    assert function.remembers() == ["n"]


def test_what_stays_is_no_memory():
    source = """
import math, numpy as np
from functools import lru_cache

TABLE, LINE = {1: [2.0, {3}]}, np.arange(6.0)


class Car:
    def __init__(self):
        self.place = (1, 2)


CAR = Car()


@lru_cache
def far(x):
    return math.hypot(x, 1)


def reward_function(params):
    mine = [params["steps"]]
    return far(mine[0]) + TABLE[1][0] + LINE[2] + CAR.place[0]
"""
    function = RewardFunction("reward.py", source)
    for step in range(3):
        function({"steps": float(step)}, 0)
    assert function.remembers() == []
