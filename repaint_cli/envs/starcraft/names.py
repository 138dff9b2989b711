"""What the mini-games tell and take by name, without arrays."""

from repaint_cli.envs.starcraft.rts.constants import (
    ATTACK_POINT,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    MEASUREMENTS,
    SELECT_POINT,
)

WITH_A_POINT = (BUILD_DEPOT, BUILD_BARRACKS, SELECT_POINT, ATTACK_POINT)
"""The commands that use the other two numbers of an action, a pixel's column and row."""

SUMS = ("marines_built", "marines_died", "zerglings_killed", "barracks_built")
"""The terms whose sums since an episode began are recorded, as `sum_` and their name."""

RECORDS = (*MEASUREMENTS, *(f"sum_{name}" for name in SUMS), "minerals_mined", "seconds")
"""What is recorded after each step."""
