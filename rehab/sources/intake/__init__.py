"""From what a lab sends to strides: rows with named cells in, measurements out.

A row is a stride (it has a value) or a sample of raw signals. ``rows`` reads the cells;
``alignment`` brings channels of different rates to one; ``pipeline`` makes strides of them with
``rehab.gait``; ``quality`` summarizes how well the source is received and ``recorder`` writes the
raw signals to a file. ``intake`` is the entry to all of it. ``lines`` and ``addresses`` are for
rows that come as text.
"""

from rehab.sources.intake.addresses import Address, parse_address
from rehab.sources.intake.intake import Intake
from rehab.sources.intake.lines import LineReader
from rehab.sources.intake.measurements import to_measurement
from rehab.sources.intake.pipeline import SignalPipeline
from rehab.sources.intake.rows import BadRow, Cell
from rehab.sources.intake.settings import IntakeSettings, add_signal_arguments

__all__ = [
    "Address",
    "BadRow",
    "Cell",
    "Intake",
    "IntakeSettings",
    "LineReader",
    "SignalPipeline",
    "add_signal_arguments",
    "parse_address",
    "to_measurement",
]
