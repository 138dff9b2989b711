"""What the racer reports, without arrays: records of a step, reward terms, ends of episodes."""

RECORDS = (
    "x", "y", "heading", "speed", "steering", "progress", "lap_time", "wheels_on", "waypoint",
    "status",
)  # fmt: skip
"""What is known of a car after each step."""

OBJECT_RECORDS = ("objects", "hit")
"""What is known besides of a car among bots or boxes."""

RACE_RECORDS = ("laps", "resets", "penalties")
"""What is known besides of a car in a race."""

TRACK_RECORD = "track"
"""What is known besides where there are several tracks: which it drives, from 0."""

TERMS = frozenset({"lane", "keep", "dprog", "fail"})
"""What every car may be paid for."""

OBJECT_TERMS = frozenset({"clear", "hazard", "camlane"})
"""What a car among bots or boxes may be paid for besides."""

STATUS = (
    "in_progress", "lap_complete", "off_track", "immobilized", "reversed", "time_up", "crashed",
)  # fmt: skip
"""What the record `status` counts off."""

BEAMS = 64
"""Ranges of a lidar."""
