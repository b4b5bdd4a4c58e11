"""Codes of how a way home goes: what a status report says, and pages put into words."""

from __future__ import annotations

# What it does.
LOOKING = "looking"
DRIVING = "driving"
SEARCHING = "searching"
THERE = "there"
# What keeps it from looking; it may go on by itself.
NO_CAMERA = "no_camera"
CAMERA_DARK = "camera_dark"
CAMERA_SILENT = "camera_silent"
CAMERA_SLOW = "camera_slow"
CAMERA_CHANGED = "camera_changed"  # other frames than those that home was learned with
CAMERA_CODES = (NO_CAMERA, CAMERA_DARK, CAMERA_SILENT, CAMERA_SLOW, CAMERA_CHANGED)
# Why it gave up, until the button is let go.
NO_TAG = "no_tag"
TWO_TAGS = "two_tags"
TAG_MOVES = "tag_moves"
NOT_LEVEL = "tag_not_level"
CONTRADICTED = "tag_contradicted"
UNSURE = "tag_unsure"
TOO_FAR = "too_far"
NOT_REACHED = "home_not_reached"

# What to do about a camera or tag, for who installs it.
CURES = {
    NO_CAMERA: "The camera does not open. Check its cable and name; stop what else uses it.",
    CAMERA_DARK: "The camera sees nothing but black. Take off its cover; put on the light.",
    CAMERA_SILENT: "The camera sends no frames. Unplug it, and plug it in again.",
    CAMERA_SLOW: "The camera sends too few frames. Take another USB port; put on the light.",
    CAMERA_CHANGED: "The camera changed the size of its frames. Start it again.",
    NO_TAG: "Its tag is not in view. Look with `python -m robot tag look`.",
    TWO_TAGS: "Two tags with its number are in view. Take one away.",
    TAG_MOVES: "The tag, or the camera, does not stand still.",
}
