"""Numbers of StarCraft II (Legacy of the Void) that the model uses, and where they come from.

XML: Blizzard's game data, SC2Mapster/SC2GameData b7587cca (5.0.14.93333), files
core, liberty, swarm, void, voidmulti GameData/*.xml; they agree with BurnySc2/sc2-techtree b15afbe.
MAP: the scripts and unit data of the two mini-game maps in google-deepmind/pysc2.
FIT: fitted to incomes measured in the game (gist Riketta 298fef87, game version 4.8.2).
Units of length are the game's: one is a cell of its map. A loop is the game's own step.
"""

from typing import NamedTuple

LOOPS_PER_SECOND = 16
"""Loops in a second of the game's own clock ("Normal"), which scripts and data count. XML, MAP."""
LOOPS_PER_STEP = 8
"""Loops between two actions: the `step_mul` of the mini-games. MAP."""
MAP_SIZE = 64
"""Cells of a map, along x and along y. MAP."""
SCREEN = 84
"""Pixels of the screen and of the minimap, along x and along y."""


class UnitData(NamedTuple):
    """What Blizzard's data says of a kind of unit. XML."""

    cost: int
    """Minerals."""
    build_loops: int
    """From the beginning of its training or building to its end, loops."""
    supply: int
    """What it takes of the supply; negative is what it gives."""
    hit_points: float
    """At most."""
    armour: float
    """What each blow at it loses."""
    radius: float
    """Of its disc, units; for structures half the side of its footprint."""
    sight: float
    """Radius in which it lifts the fog, units."""
    speed: float
    """Units a loop; 0 stands."""


SCV = UnitData(50, 17 * 16, 1, 45.0, 0.0, 0.375, 8.0, 2.8125 / 16)
MARINE = UnitData(50, 25 * 16, 1, 45.0, 0.0, 0.375, 9.0, 2.25 / 16)
ZERGLING = UnitData(25, 0, 0, 35.0, 0.0, 0.375, 8.0, 2.9531 / 16)
DEPOT = UnitData(100, 30 * 16, -8, 400.0, 1.0, 1.0, 9.0, 0.0)
BARRACKS = UnitData(150, 65 * 16, 0, 1000.0, 1.0, 1.5, 9.0, 0.0)
COMMAND_CENTRE = UnitData(400, 100 * 16, -15, 1500.0, 1.0, 2.5, 11.0, 0.0)
"""The SCV's speed is what it accelerates to; the others run at once. A zergling's supply is ½."""


class WeaponData(NamedTuple):
    """What Blizzard's data says of a weapon. XML."""

    damage: float
    """Of a blow, hit points, before armour."""
    range: float
    """Between the edges of two discs, units."""
    period: float
    """Between two blows, loops."""
    damage_point: float
    """From the beginning of a blow until it tells, loops."""
    scan: float
    """An idle unit acquires a target whose edge is within this of its own, units."""


RIFLE = WeaponData(6.0, 5.0, 13.77, 0.0, 5.5)
"""The marine's: 0.8608 s. Its damage point, 0.05 s = 0.8 loops, is less than a loop: taken as 0."""
CLAWS = WeaponData(5.0, 0.1, 11.14, 0.167 * 16, 5.0)
"""The zergling's: 0.696 s; the scan is the core default of `MinScanRange`."""
RANDOM_DELAY = (-1.0, 2.0)
"""Added to the period of every blow, uniform, loops: RandomDelayMin −0.0625 s, Max 0.125 s. XML."""
LEAST_DAMAGE = 0.5
"""Of a blow, whatever the armour, hit points. XML."""
REGENERATION = 0.2734 / 16
"""Of a zergling, hit points a loop. XML."""
HELP_RADIUS = 4.0
"""A unit that is hit calls those within this, middle to middle, units. XML."""
LEASH = 21.0
"""A zergling further than this from its home gives up its target, units. XML."""
SCAN_EVERY = 4
"""Units without a target look for one every so many loops."""

ACCELERATION = 2.5
"""Of an SCV, units/s². XML."""
TRIP_MINERALS = 5
"""What an SCV carries home. XML."""
MINING_LOOPS = 2.786 * 16
"""An SCV on a patch, loops. XML (BehaviorResource)."""
RETURN_LOOPS = 8.0
"""Then it stands before it turns home: 0.5 s, loops. XML."""
HANDOVER_LOOPS = 3.0
"""From an SCV's leaving a patch until the next one digs, loops. FIT."""
LEG_LOOPS = 2.5
"""Turning and touching, added to every walk of an SCV, loops. FIT: 16 earn 924.9 in 1344 loops."""
CENTRE_RADIUS = 2.75
"""Of the command centre as a place to bring minerals to, units. XML."""
PATCH_HALF_WIDTH, PATCH_HALF_HEIGHT = 1.0, 0.5
"""Of a mineral patch's box, units. XML."""
MINERAL_HIT_POINTS = 500.0
"""What the game's feature layers show for a mineral patch."""

QUEUE = 5
"""Units that a structure trains or holds waiting. XML (que5)."""
SUPPLY_LIMIT = 200
"""Of supply that is ever given. XML."""
FOUNDATION = 0.1
"""Share of its hit points that a structure begins with; the rest grows evenly. XML."""
SITE_SIGHT = 4.0
"""Of a structure that is being built, units. XML."""

START_MINERALS = 50
"""MAP."""
START_ROWS = (2.5, 1.5, 0.5, -0.5, -1.5, -2.5)
START_COLUMNS = (4.5, 3.5)
"""Where the first twelve SCVs stand, above and to one side of the centre, units. MAP."""
ZERGLINGS_APART = 5.0
"""Between any two zerglings that appear, units. MAP."""
MARINES_APART = 9.0
"""Between zerglings that appear later and any marine, units. MAP."""

MAX_SCVS, MAX_MARINES, MAX_ZERGLINGS = 64, 200, 40
MAX_DEPOTS, MAX_BARRACKS, MAX_PATCHES = 32, 20, 8
"""Places in the arrays of a game; where none is free, the command is unavailable."""

COMMANDS = (
    "build supply depot", "build barracks", "train SCV", "train marine",
    "select point", "attack point", "select army",
)  # fmt: skip
BUILD_DEPOT, BUILD_BARRACKS, TRAIN_SCV, TRAIN_MARINE, SELECT_POINT, ATTACK_POINT, SELECT_ARMY = (
    range(7)
)
"""The first number of an action; the two others, x and y, are pixels of the screen."""

TERMS = (
    "unavailable", "marines_died", "select_miss", "select_hit",
    "scvs_trained", "barracks_built", "marines_built", "zerglings_killed",
)  # fmt: skip
UNAVAILABLE, MARINE_DIED, SELECT_MISS, SELECT_HIT = range(4)
SCV_TRAINED, BARRACKS_BUILT, MARINE_BUILT, ZERGLING_KILLED = range(4, 8)
"""Reward terms φ in order, which cards weigh by name: how often it happened in a step."""

SCREEN_LAYERS = (
    "height_map", "visibility_map", "player_relative", "unit_type", "selected",
    "unit_hit_points", "unit_hit_points_ratio", "unit_density", "unit_density_aa",
)  # fmt: skip
MINIMAP_LAYERS = ("visibility_map", "player_relative", "selected")
MEASUREMENTS = ("minerals", "food_used", "food_cap", "scvs", "army")
"""The numbers beside the layers: minerals, food used, food there is, SCVs, marines."""

EDGE = 1e-9
"""What is on the edge of a disc or a box is in it, however its numbers are rounded, units."""

NONE, SELF, ALLY, NEUTRAL, ENEMY = range(5)
"""What layers of `player_relative` say."""
HIDDEN, SEEN, VISIBLE = range(3)
"""What layers of `visibility_map`, and cells of the fog, say."""
UNIT_TYPES = (
    "nothing", "command centre", "supply depot", "barracks", "SCV", "marine", "zergling", "minerals"
)  # fmt: skip
CENTRE_TYPE, DEPOT_TYPE, BARRACKS_TYPE, SCV_TYPE, MARINE_TYPE, ZERGLING_TYPE, MINERALS_TYPE = range(
    1, 8
)
"""What the layer `unit_type` says."""
