"""The two layouts of the HEBB study, in which the trained leg is ``i`` and the other one ``c``."""

from __future__ import annotations

import math
import re

from rehab.sources.recording.layout import Layout, make_row_phase
from rehab.sources.recording.table import Row, quote
from rehab.training.phases import PHASE_KINDS, Phase
from rehab.training.steps import InvalidReason

# hebb03: what each part of the protocol in column Task is for (docs/reference/gait.md#columns). A
# number before "A2" is the share of the real value that was shown, in percent: the gain.
_TASK_KINDS = {
    "SSWS": "baseline",
    "Fam": "familiarization",
    "Catch": "catch",
    "WO": "washout",
}
_TASK_GAIN = re.compile(r"(\d{2,3})A2", re.ASCII)


def _read_task(row: Row) -> Phase:
    task = row.text("Task")
    part = task.rpartition("_")[2]
    shown_percent = _TASK_GAIN.fullmatch(part)
    kind = "training" if shown_percent else _TASK_KINDS.get(part)
    if kind is None:
        raise row.error(
            f"the task {quote(task)} is not known. Known tasks: SSWS, SSWS_Fam, SSWS_Catch, "
            "SSWS_WO, and SSWS_85A2 with any number for the gain in percent.",
            "Task",
        )
    gain = int(shown_percent[1]) / 100 if shown_percent else 1.0
    return make_row_phase(row, "Task", kind, task, PHASE_KINDS[kind].feedback, gain)


def _read_use(row: Row) -> tuple[str, ...]:
    use = row.flag_in("iStrideUse")
    if use is None:
        raise row.error("blank. Write 1 for a usable stride, 0 for one that is not.", "iStrideUse")
    return () if use else (InvalidReason.FLAGGED,)


HEBB03 = Layout(
    name="hebb03",
    required=(
        *("Task", "ExpTime", "iStrideCt", "iStrideLeg", "iStrideUse"),
        *("iA2_Target", "iA2_Actual", "iA2_Decr", "iA2_Success"),
    ),
    number="iStrideCt",
    time_s="ExpTime",
    side="iStrideLeg",
    value="iA2_Actual",
    goal="iA2_Target",
    shown="iA2_Decr",
    hit="iA2_Success",
    read_reasons=_read_use,
    read_phase=_read_task,
    # Of 63 columns those that studies ask for (docs/reference/gait.md#outcomes): timing, symmetry,
    # force, and the two factors of A2, moment and velocity. Units: docs/recordings.md.
    extra=(
        *("iHS2", "iSLS_Time", "iSwing_Time"),
        *("iStep_Length", "cStep_Length", "StepLengthSym"),
        *("iGRF_AP_propel", "iGRF_VT_F1", "iAnkMom1_iA2", "iAnkAngVel1_iA2"),
    ),
)

# A contact whose peak stays below a quarter of body weight is no step
# (docs/reference/gait.md#contacts): 0.25 × 9.8 N/kg. Two strides of HEBB_91 are such, and the lab
# counted them as misses.
MIN_CONTACT_N_KG = 2.45


def _read_contact(row: Row) -> tuple[str, ...]:
    force = row.number_in("iVGRF_max")
    # Without a force there was nothing that A2 could have been computed from.
    lost = force is None or not math.isfinite(force) or force < MIN_CONTACT_N_KG
    return (InvalidReason.FORCE_LOST,) if lost else ()


def _read_no_phase(_row: Row) -> Phase:
    kind = PHASE_KINDS["training"]
    return Phase(kind=kind.slug, name=kind.label, feedback=kind.feedback)


HEBB91 = Layout(
    name="hebb91",
    required=("Step Count", "iA2", "A2_Success", "iVGRF_max"),
    number="Step Count",
    # No time column; the same lab's walkers take 1.04-1.10 s (docs/reference/gait.md#phases).
    stride_s=1.10,
    value="iA2",
    hit="A2_Success",
    read_reasons=_read_contact,
    read_phase=_read_no_phase,
    extra=(
        *("iSingle_Support", "cSingle_Support", "iSL", "cSL", "SLS"),
        *("iAPGRF_max", "cAPGRF_max", "iVGRF_max", "cVGRF_max"),
    ),
)
