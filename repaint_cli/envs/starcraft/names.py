"""What the mini-games tell and take by name, without arrays."""

from repaint_cli.envs.starcraft.rts.constants import (
    ATTACK_POINT,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    SELECT_POINT,
)

WITH_A_POINT = (BUILD_DEPOT, BUILD_BARRACKS, SELECT_POINT, ATTACK_POINT)
"""The commands that use the other two numbers of an action, a pixel's column and row."""

TERMS = (
    "unavailable", "marines_died", "select_miss", "select_hit", "scvs_trained", "barracks_built",
    "marines_built", "zerglings_killed",
)  # fmt: skip
"""What is counted of a step, and paid for: the terms φ in order."""

MEASUREMENTS = ("minerals", "food_used", "food_cap", "scvs", "army")
"""The numbers beside the pictures, in order."""

SUMS = ("marines_built", "marines_died", "zerglings_killed", "barracks_built")
"""The terms whose sums since an episode began are recorded, as `sum_` and their name."""

RECORDS = (*MEASUREMENTS, *(f"sum_{name}" for name in SUMS), "minerals_mined", "seconds")
"""What is recorded after each step."""
