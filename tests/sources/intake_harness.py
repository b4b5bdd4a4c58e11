"""An intake with all that goes in and comes out of it."""

from rehab.gait import LegSamples, measure_strides
from rehab.gait.recordings.column_mapping import REQUIRED, SIDES, SIGNAL_LAYOUTS
from rehab.sources.client import LiveFeed
from rehab.sources.intake import Intake, IntakeSettings
from rehab.training.steps import Side

MASS = 75.0
NAMES = [SIGNAL_LAYOUTS["garry"].legs[side][channel].name for side in SIDES for channel in REQUIRED]


class Time:
    """A monotonic clock that the test sets [s]."""

    now_s = 1000.0

    def __call__(self):
        return self.now_s


class IntakeHarness:
    """An intake with what was reported and the strides that it put out."""

    def __init__(self, **settings) -> None:
        self.time = Time()
        self.said: list[str] = []
        self.feed = LiveFeed(self.time)
        self.feed.start_session(Side.LEFT)
        self.feed.resume()
        how = IntakeSettings(**{"mass_kg": MASS} | settings)
        self.intake = Intake(self.feed, how, self.said.append, self.time)

    def send(self, rows, chunk=20):
        for start in range(0, len(rows), chunk):
            self.intake.add_rows(rows[start : start + chunk])

    def strides(self):
        found = []
        while not isinstance(stride := self.feed.poll(0), float):
            found.append(stride)
        return found


def measure(made, rate_hz=200.0):
    """Return the strides of a whole recording, measured at once."""
    left, right = (
        LegSamples(leg.force_n, leg.moment_nm, leg.angle_rad) for leg in (made.left, made.right)
    )
    return measure_strides(made.t_s, {"left": left, "right": right}, rate_hz=rate_hz, mass_kg=MASS)


def rows_of(table, names=NAMES):
    return [dict(zip(["time_s", *names], row, strict=True)) for row in table.tolist()]
