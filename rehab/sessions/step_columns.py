"""What each field of a `Step` means: from here exports, API, admin and codebook follow."""

from __future__ import annotations

from typing import NamedTuple


class StepColumn(NamedTuple):
    """What a field of `Step` means, for readers of files and of the API.

    ``exported_as``: its name in files, if that is another one. ``is_channel``: it is a channel of
    the motion data in BIDS, too.
    """

    field: str
    meaning: str
    unit: str = ""
    exported_as: str = ""
    is_channel: bool = False


MEASURE_UNIT = "the measure's unit"
# Every field but the key and the session: what is stored of a step is exported and in the API.
STEP_COLUMNS = (
    StepColumn("number", "Number of the step in its session, from 1, both legs.", is_channel=True),
    StepColumn("time_s", "Time of the step on the source's clock.", "s", "time"),
    StepColumn("received_at", "When the server received it."),
    StepColumn("side", "left or right."),
    StepColumn("value", "What was measured.", MEASURE_UNIT, is_channel=True),
    StepColumn(
        "gain", "Factor between the value and what the patient saw.", "ratio", is_channel=True
    ),
    StepColumn("shown", "gain × value, where a goal was known.", MEASURE_UNIT, is_channel=True),
    StepColumn("goal", "Goal in force at this step.", MEASURE_UNIT, is_channel=True),
    StepColumn("performance", "shown / goal.", "ratio", is_channel=True),
    StepColumn("hit", "true: performance of 1 or more.", is_channel=True),
    StepColumn("close", "true: too uncertain to count as hit or miss."),
    StepColumn("late", "true: it came too late to be shown as live."),
    StepColumn("points", "Points given or taken.", "points", is_channel=True),
    StepColumn("valid", "false: not shown, rewarded or penalized.", is_channel=True),
    StepColumn("reasons", "Why it is not valid."),
    StepColumn("phase", "Number of its phase in the session, from 0.", is_channel=True),
    StepColumn("rules_version", "Version of the rules that judged the step."),
    StepColumn(
        "extra",
        "What else the source measured of it, by name. wearable_foot, wearable_shank: by a sensor "
        "worn there, with the version of its algorithm; sensor_rate_hz: its samples a second; "
        "clock_error_ms: how well its clock is known.",
    ),
)
