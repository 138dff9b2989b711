"""The numbers of the model are those of Blizzard's data; seconds there are 16 loops here."""

import pytest

from repaint_cli.envs.starcraft.rts import constants
from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    CLAWS,
    COMMAND_CENTRE,
    DEPOT,
    MARINE,
    RIFLE,
    SCV,
    ZERGLING,
)

UNITS = {
    # minerals, seconds, supply, hit points, armour, radius, sight, units a second
    "SCV": (SCV, 50, 17, 1, 45, 0, 0.375, 8, 2.8125),
    "marine": (MARINE, 50, 25, 1, 45, 0, 0.375, 9, 2.25),
    "zergling": (ZERGLING, 25, 0, 0, 35, 0, 0.375, 8, 2.9531),
    "supply depot": (DEPOT, 100, 30, -8, 400, 1, 1, 9, 0),
    "barracks": (BARRACKS, 150, 65, 0, 1000, 1, 1.5, 9, 0),
    "command centre": (COMMAND_CENTRE, 400, 100, -15, 1500, 1, 2.5, 11, 0),
}
NUMBERS = {
    # seconds of the game's data
    "MINING_LOOPS": 2.786 * 16, "RETURN_LOOPS": 0.5 * 16, "REGENERATION": 0.2734 / 16,
    "RANDOM_DELAY": (-0.0625 * 16, 0.125 * 16),
    # others
    "LOOPS_PER_SECOND": 16, "LOOPS_PER_STEP": 8, "ACCELERATION": 2.5, "TRIP_MINERALS": 5,
    "HANDOVER_LOOPS": 3, "LEG_LOOPS": 2.5, "CENTRE_RADIUS": 2.75, "QUEUE": 5, "SUPPLY_LIMIT": 200,
    "HELP_RADIUS": 4, "LEASH": 21, "LEAST_DAMAGE": 0.5, "START_MINERALS": 50, "SITE_SIGHT": 4,
    "ZERGLINGS_APART": 5, "MARINES_APART": 9, "SCREEN": 84, "MAP_SIZE": 64,
}  # fmt: skip


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_is_as_the_data_says(name):
    unit, cost, seconds, *others, speed = UNITS[name]
    assert unit.cost == cost
    assert unit.build_loops == seconds * 16
    assert unit[2:-1] == tuple(others)
    assert unit.speed == speed / 16


def test_weapons_are_as_the_data_says():
    assert RIFLE[:2] == (6, 5)
    assert RIFLE.period == pytest.approx(0.8608 * 16, abs=0.005)
    assert RIFLE.scan == 5.5
    assert CLAWS[:2] == (5, 0.1)
    assert CLAWS.period == pytest.approx(0.696 * 16, abs=0.005)
    assert (CLAWS.damage_point, CLAWS.scan) == (0.167 * 16, 5)


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_is_as_the_data_says(name):
    assert getattr(constants, name) == NUMBERS[name]
