"""A lab's C3D file: uploaded, checked, confirmed, and walked with, all in a browser."""

from __future__ import annotations

import json
import re
import sqlite3
import time

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.gait.c3d import write_c3d
from tests.gait.walks import make_walk
from tests.support.browsers import Visit, picture
from tests.support.data import signals
from tests.support.servers import Server
from tests.support.walk_seed import make_walks

pytestmark = pytest.mark.browser

MASS_KG = 75.0
CHECKED_MS = 90_000  # numpy is loaded and a file measured, however busy the machine


@pytest.fixture(scope="module")
def walk():
    return make_walk(rate_hz=200, jitter_s=0.0, strides=25, mass_kg=MASS_KG)[0]


@pytest.fixture
def page(server: Server, visit: Visit) -> Page:
    (ready,) = make_walks(server, {})
    with sqlite3.connect(server.folder / "garry.sqlite3") as database:
        database.execute("UPDATE rehab_patient SET body_mass_kg = ?", (MASS_KG,))
        database.execute("UPDATE rehab_trainingsession SET state = 'finished'")
    return visit("/recordings/check/", ready, "laptop", has_touch=True)


def upload(page: Page, *paths) -> None:
    page.set_input_files("#file", paths)
    page.fill("#mass", str(MASS_KG))
    page.click("text=Check the files")


def test_a_c3d_file_is_checked_and_then_walked_with(page, server, walk, tmp_path):
    path = tmp_path / "Lab walk 7.c3d"
    write_c3d(path, walk)
    upload(page, path)

    # Proposed: columns, units, signs and legs; a person looks at them.
    force = page.locator("select[name='left.force.column']")
    expect(force).to_have_value("Fz1", timeout=CHECKED_MS)
    expect(page.locator("input[name='left.force.factor']")).to_have_value("-1")
    expect(page.locator("input[name='right.moment.factor']")).to_have_value("0.001")
    expect(page.locator("input[name='right.angle.factor']")).to_have_value("0.0174532925")
    expect(page.locator("main")).to_contain_text("strides are valid, 75.0 kg, 200 samples a second")

    # What is wrong is refused, with what was seen, and nothing is stored.
    page.fill("input[name='left.force.factor']", "1")
    page.select_option("select[name='left.angle.column']", "LAnkleMoment.X")
    page.click("text=That is right")
    refused = page.get_by_role("alert").first
    words = "left.force=Fz1: its sign is turned. Give a factor of -1."
    expect(refused).to_contain_text(words, timeout=CHECKED_MS)
    expect(refused).to_contain_text("LAnkleAngles.X looks like it, LAnkleMoment.X does not.")
    assert not list(server.folder.glob("recordings/*"))

    # Confirmed, it is a source of steps.
    page.fill("input[name='left.force.factor']", "-1")
    page.select_option("select[name='left.angle.column']", "LAnkleAngles.X")
    page.click("text=That is right")
    stored = page.get_by_role("status")
    expect(stored).to_contain_text("lab-walk-7.csv is ready to walk with", timeout=CHECKED_MS)
    assert [file.name for file in server.folder.glob("recordings/*")] == ["lab-walk-7.csv"]
    assert not list(server.folder.glob("uploads/*"))  # what was uploaded is gone

    page.click("text=Choose a patient")
    page.goto("/patients/1/new/")
    page.check("input[name=source][value='recording lab-walk-7.csv']", force=True)
    page.check("input[name=station] >> nth=0", force=True)
    page.click("button[name=then][value=walk]")
    page.wait_for_url("**/sessions/*/")
    session = int(page.url.rstrip("/").split("/")[-1])
    page.tap("[data-change=start]")
    page.wait_for_function("() => document.body.dataset.step >= 4")

    measured = {round(s.a2_w_kg, 3) for s in walk.both_legs(look_ahead_s=0.05) if s.a2_w_kg}
    with sqlite3.connect(server.folder / "garry.sqlite3") as database:
        rows = database.execute(
            "SELECT value, reasons FROM rehab_step WHERE session_id = ? ORDER BY number", (session,)
        ).fetchall()
    valid = [value for value, reasons in rows if not json.loads(reasons)]
    assert len(valid) >= 3
    for value in valid:  # half of its channels came at half of the rate
        assert min(abs(value / one - 1) for one in measured) < 0.02


@pytest.mark.parametrize("file", ["gaitalytics_treadmill_events.c3d", "UnpertPre_data.csv"])
def test_step_5_of_a_labs_first_day(page, server, browser, file):
    """docs/first-day.md: from a file of the lab's own to feedback within half a minute."""
    folder, kg, goal = {
        "gaitalytics_treadmill_events.c3d": ("lab_files", "55.3", "3"),
        "UnpertPre_data.csv": ("moore2013_s15_pre", "82.2", "1.5"),
    }[file]
    if file.endswith(".c3d"):
        pytest.importorskip("ezc3d")
    page.set_input_files("#file", signals(folder) / file)
    page.get_by_role("button", name="Check the files").click()
    right = page.get_by_role("button", name="That is right")
    expect(right).to_be_visible(timeout=CHECKED_MS)
    expect(page.locator("main")).to_contain_text(re.compile(r"Left: A2 \d\.\d\d W/kg"))
    picture(page, f"first-day-{kg}-checked")
    right.click()
    expect(page.get_by_role("status")).to_contain_text("is ready", timeout=CHECKED_MS)
    picture(page, f"first-day-{kg}-stored")
    stored = page.get_by_role("status").get_by_role("heading").inner_text().split()[0]
    page.get_by_role("link", name="Choose a patient").click()
    page.get_by_role("link", name="New patient").click()
    page.locator("[name=nickname]").fill(f"Test {kg}")
    page.locator("[name=code]").fill(f"T-{kg}")
    page.locator("[name=body_mass_kg]").fill(kg)
    page.get_by_label("Left", exact=True).check()
    page.get_by_role("button", name="Continue").click()
    page.get_by_text("Ten minutes at 60 %").click()
    page.locator("label:has([name=goal_by][value=value])").click()
    page.locator("[name=goal_value]").fill(goal)
    page.get_by_text(stored).click()
    picture(page, f"first-day-{kg}-set-up")
    page.locator("button[name=then][value=walk]").click()
    page.wait_for_url("**/sessions/*/")
    began = time.monotonic()
    page.tap("[data-change=start]")
    page.wait_for_selector("body[data-look=feedback]", timeout=30_000)
    print(f"{file}: feedback after {time.monotonic() - began:.0f} s")
    picture(page, f"first-day-{kg}-feedback")


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("walk.exe", b"MZ", "Choose a file of .c3d"),
        ("walk.c3d", b"\x02\x50" + bytes(2000), "This file cannot be read|is no C3D file"),
        ("walk.csv", b"a,b\n1,2\n", "No column is a time"),
    ],
)
def test_files_that_nothing_can_be_measured_from(page, tmp_path, name, data, said):
    path = tmp_path / name
    path.write_bytes(data)
    upload(page, path)
    expect(page.get_by_role("alert").filter(visible=True)).to_contain_text(
        re.compile(said), timeout=CHECKED_MS
    )


def test_files_of_one_walk_are_uploaded_together(page, walk, tmp_path):
    forces, joints = tmp_path / "forces.csv", tmp_path / "joints.csv"
    for path, names, channels in (
        (forces, "time,Fz1,Fz2", (walk.left[0], walk.right[0])),
        (joints, "time,LAnkleMoment.X,LAnkleAngles.X", walk.left[1:]),
    ):
        np.savetxt(
            path, np.column_stack([walk.t_s, *channels]), "%.6g", ",", header=names, comments=""
        )
    upload(page, forces, joints)
    for channel, column in (
        ("force", "Fz1"),
        ("moment", "LAnkleMoment.X"),
        ("angle", "LAnkleAngles.X"),
    ):
        chosen = page.locator(f"select[name='left.{channel}.column']")
        expect(chosen).to_have_value(column, timeout=CHECKED_MS)
