"""The seven commands as functions of PySC2."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.names import COMMANDS, WITH_A_POINT

FUNCTIONS = {
    "supply depot": ("Build_SupplyDepot_screen", "now"),
    "barracks": ("Build_Barracks_screen", "now"),
    "train SCV": ("Train_SCV_quick", "now"),
    "train marine": ("Train_Marine_quick", "now"),
    "select point": ("select_point", "select"),
    "attack point": ("Attack_screen", "now"),
    "select army": ("select_army", "select"),
}
"""PySC2's name of each command, and its first argument: at once, or alone."""

BUILDS = tuple(COMMANDS.index(name) for name in ("supply depot", "barracks"))
SELECT_POINT = COMMANDS.index("select point")
ARMY = tuple(COMMANDS.index(name) for name in ("attack point", "select army"))
"""What the paper never has available where there is nothing to attack; the game would."""


def function(command: int) -> Any:
    """Return PySC2's function of a command."""
    from pysc2.lib import actions

    return actions.FUNCTIONS[FUNCTIONS[COMMANDS[command]][0]]


def availability(function_ids: NDArray[np.int64], has_enemies: bool) -> NDArray[np.uint8]:
    """Return which commands can be carried out, (7,), of what PySC2 says is available."""
    ids = [int(function(command).id) for command in range(len(COMMANDS))]
    available = np.isin(ids, function_ids).astype(np.uint8)
    if not has_enemies:
        available[list(ARMY)] = 0
    return available


def call(command: int, x: int, y: int) -> Any:
    """Return a command with its pixel as a call of PySC2's function."""
    name = COMMANDS[command]
    first = FUNCTIONS[name][1]
    point = ((x, y),) if name in WITH_A_POINT else ()
    return function(command)(first, *point)


def no_op() -> Any:
    """Return the call that does nothing."""
    from pysc2.lib import actions

    return actions.FUNCTIONS.no_op()
