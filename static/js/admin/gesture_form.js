// The page of a gesture: its floor. The list of gestures: those that every robot knows, to be played.

import { setUpPreviews } from "garry/shared/gesture_preview";
import { setUpFloor } from "garry/admin/gesture_floor";

setUpPreviews();
document.querySelectorAll(".gesture-floor").forEach(setUpFloor);
