"""The seven commands as functions of PySC2."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.names import WITH_A_POINT
from repaint_cli.envs.starcraft.rts.constants import (
    ATTACK_POINT,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    SELECT_ARMY,
    SELECT_POINT,
    TRAIN_MARINE,
    TRAIN_SCV,
)

FUNCTIONS = {
    BUILD_DEPOT: ("Build_SupplyDepot_screen", "now"),
    BUILD_BARRACKS: ("Build_Barracks_screen", "now"),
    TRAIN_SCV: ("Train_SCV_quick", "now"),
    TRAIN_MARINE: ("Train_Marine_quick", "now"),
    SELECT_POINT: ("select_point", "select"),
    ATTACK_POINT: ("Attack_screen", "now"),
    SELECT_ARMY: ("select_army", "select"),
}
"""PySC2's name of each command, and its first argument: at once, or alone."""

ARMY = (ATTACK_POINT, SELECT_ARMY)
"""What the paper never has available where there is nothing to attack; the game would."""


def function(command: int) -> Any:
    """Return PySC2's function of a command."""
    from pysc2.lib import actions

    return actions.FUNCTIONS[FUNCTIONS[command][0]]


def availability(function_ids: NDArray[np.int64], has_enemies: bool) -> NDArray[np.uint8]:
    """Return which commands can be carried out, (7,), of what PySC2 says is available."""
    ids = [int(function(command).id) for command in sorted(FUNCTIONS)]
    available = np.isin(ids, function_ids).astype(np.uint8)
    if not has_enemies:
        available[list(ARMY)] = 0
    return available


def call(command: int, x: int, y: int) -> Any:
    """Return a command with its pixel as a call of PySC2's function."""
    point = ((x, y),) if command in WITH_A_POINT else ()
    return function(command)(FUNCTIONS[command][1], *point)


def no_op() -> Any:
    """Return the call that does nothing."""
    from pysc2.lib import actions

    return actions.FUNCTIONS.no_op()
