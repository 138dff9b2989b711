"""What a card says of a race: track, car, what is on the road, how it is driven.

A default here is the paper's, or what our cards have.
"""

from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from repaint_cli.envs.racer.actions import CardActions
from repaint_cli.envs.racer.tracks import Names, checked_names
from repaint_cli.envs.simulator import Simulator

if TYPE_CHECKING:
    from repaint_cli.envs.racer.dynamics.objects import ObjectSettings


class RacerSettings(Simulator):
    """The racer's settings; what it does is `RacerSimulator`."""

    simulator: Literal["racer"]
    """Which simulator this is."""
    track: Names = "reinvent-like"
    """A shipped track, by name, or the path of a file of waypoints (`my-track.npy`); or a list of
    them, which episodes drive in turn."""
    waypoints: Literal["file", "unique"] = "file"
    """How waypoints are numbered for reward functions and logs: as the rows of the track's file, as
    DeepRacer did until March 2026, or without rows that repeat the one before."""
    car: Literal["sim4", "sim5", "ideal"] = "sim4"
    """`sim4` fits logs of 2021-22 (0.1 m off after a second; on logs of 2026 0.27), `sim5` those of
    2026 (0.11; on those of 2021-22 0.23), `ideal` is a bicycle without lag (0.7 to 0.9)."""
    actions: CardActions = (
        (-30, 0.5), (-15, 0.5), (0, 0.5), (15, 0.5), (30, 0.5),
        (-30, 1), (-15, 1), (0, 1), (15, 1), (30, 1),
    )  # fmt: skip
    """Steering (degrees, left is positive, at most ±30) and speed (0.1 to 4 m/s) to choose from; or
    the ranges of both, { steering_angle = [-30, 30], speed = [0.5, 2] }."""
    sensors: Literal["camera", "camera+lidar", "stereo", "stereo+lidar"] = "camera"
    """What the car sees with: one camera or two, 6 cm apart, and perhaps a lidar looking back."""
    n_bots: int = Field(0, ge=0, le=16)
    """Other cars on the road, each with a lane that it changes every few seconds."""
    n_boxes: int = Field(0, ge=0, le=16)
    """Boxes that stand on the road; not together with bots."""
    crash: Literal["at-fault", "any"] = "at-fault"
    """Which crashes end an episode: those with a bot ahead, as DeepRacer's do, or any. Crashes with
    a box always do."""
    object_places: tuple[tuple[float, Literal[-1, 1]], ...] = ()
    """Where bots start or boxes stand, one after the other: share of the lap, and lane, 1 the inner
    one or -1 the outer. Absent: see `random_objects`."""
    random_objects: bool = True
    """Whether places and lanes of bots or boxes are drawn in every episode; if not, places are
    even, and lanes alternate."""
    object_gap: float = Field(2.0, ge=0)
    """Between bots or boxes, and from the start line to the first, m."""
    bot_speed: float = Field(0.2, ge=0, le=4)
    """Of the bots, m/s."""
    bot_lane_changes: bool = True
    """Whether bots change lanes."""
    bot_waits: tuple[float, float] = (3.0, 5.0)
    """Between its lane changes a bot keeps its lane for a time drawn between these, s."""
    bot_change_length: float = Field(1.0, ge=0.2)
    """Over which a bot changes lanes, m."""
    box_size: tuple[float, float, float] = (0.3, 0.4, 0.25)
    """Of a box: along the road, across it, and its height, m. For crashes it is 0.1 m longer and
    wider, as DeepRacer's."""
    direction: Literal["forward", "reverse", "alternate"] = "forward"
    """Which way the track is driven: as its file says, the other way, or in training by turns, and
    forward otherwise."""
    start_offset: float = Field(0.0, ge=0, lt=1)
    """Where the first episode of training starts, share of the lap."""
    start_spacing: float = Field(0.05, ge=0, lt=1)
    """How much farther on each episode of training starts than the one before, share of the lap."""
    random_light: float = Field(0.0, ge=0, lt=1)
    """In training the pictures of an episode are brighter or darker by up to so much: their grey
    levels are multiplied by 1 + U(-a, a)."""
    random_colours: float = Field(0.0, ge=0, le=1)
    """In training road, lines, field and sky have grey levels of their own in each episode, up to
    so much of the scale from the usual ones; what is between two of them moves along."""
    training_noise: bool = False
    """Whether actions and pictures have the noise of [eval] in training, too."""
    range_min: float = Field(0.12, ge=0, lt=1)
    """What the lidar reads of anything nearer, m."""
    max_steps: int | None = Field(None, gt=0)
    """Time limit of an episode, in steps of 1/15 s; absent: one and a half times what a lap of the
    longest track takes at the slowest of `actions`, and at least 1,500."""

    @field_validator("track", mode="before")
    @classmethod
    def _from_any_folder(cls, track: Any) -> Names:
        """Keep a file's whole path: a run or a teacher is used in other folders too."""
        return checked_names(track)

    @field_validator("bot_waits", "box_size")
    @classmethod
    def _positive(cls, numbers: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if min(numbers) <= 0 or (info.field_name == "bot_waits" and numbers[0] > numbers[1]):
            times = "two times above 0, the shorter one first"
            raise ValueError(f"expected {times if len(numbers) == 2 else 'three lengths above 0'}")
        return numbers

    @model_validator(mode="after")
    def _objects_of_one_kind(self) -> Self:
        if self.n_bots and self.n_boxes:
            raise ValueError(
                f"expected n_bots or n_boxes, as a race has the ones or the others, found "
                f"{self.n_bots} and {self.n_boxes}"
            )
        n_objects, n_places = self.n_objects, len(self.object_places)
        if n_places and n_places != n_objects:
            what = "boxes" if self.n_boxes else "bots"
            raise ValueError(
                f"expected as many object_places as n_{what}, found {n_places} and {n_objects}"
            )
        return self

    @property
    def tracks(self) -> tuple[str, ...]:
        """Its track, or all of them."""
        return (self.track,) if isinstance(self.track, str) else self.track

    @property
    def n_objects(self) -> int:
        """How many bots or boxes there are."""
        return self.n_bots or self.n_boxes

    @property
    def objects(self) -> "ObjectSettings":
        """What is on the road besides the car."""
        from repaint_cli.envs.racer.dynamics.objects import ObjectSettings

        return ObjectSettings(
            n=self.n_objects,
            boxes=self.n_boxes > 0,
            speed=self.bot_speed,
            lane_changes=self.bot_lane_changes,
            waits=self.bot_waits,
            change_length=self.bot_change_length,
            gap=self.object_gap,
            random=self.random_objects,
            places=self.object_places,
            box_size=self.box_size,
        )
