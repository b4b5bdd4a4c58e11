// The robot in a replay: how it moved, as its black box recorded it, and else as its gestures were ordered.

import { _ } from "garry/shared/language";
import { describeDecision, describeGesture } from "garry/monitor/robot_text";
import { drawMoment } from "garry/shared/gesture_preview";
import { RobotScene } from "garry/shared/robot_scene";

export function createReplayedRobot({ show }, pieces, player) {
  const scene = new RobotScene(document.getElementById("scene"), { isFollowed: false });
  let decision, breakReason, isStopped;

  function find(at_s) {
    const now = pieces.filter((piece) => piece.at_s <= at_s && at_s < piece.at_s + piece.took_s);
    const [recorded, ordered] = [true, false].map((is) => now.findLast((piece) => piece.recorded === is));
    if (!recorded || !ordered) return recorded ?? ordered;
    // It went as recorded; what it showed meanwhile is what its gesture orders.
    const after_s = ordered.at_s - recorded.at_s;
    const later = (entries) => entries.map(([from_s, ...shown]) => [from_s + after_s, ...shown]);
    const lights = later(ordered.lights);
    return {
      ...recorded,
      lights: recorded.lights.length ? recorded.lights : lights,
      mood: ordered.mood,
      looks: later(ordered.looks),
    };
  }

  return {
    reset() {
      decision = null;
      breakReason = "";
      isStopped = false;
    },
    handleEvent({ kind, report, stopped }) {
      if (kind === "robot_stopped") isStopped = stopped;
      if (report?.kind === "decision") {
        decision = report;
        breakReason = "";
      }
      if (report?.kind === "gesture" && report.phase === "ended" && report.outcome !== "done")
        breakReason = report.outcome;
    },
    draw() {
      const piece = find(player.at_s);
      if (piece) drawMoment(scene, piece, player.at_s - piece.at_s);
      else scene.draw({ poses: [{ x_m: 0, y_m: 0, heading_rad: 0 }] });
      const gesture = piece && !piece.recorded ? `${describeGesture(piece.name)}…` : "";
      show("robot-state", isStopped ? _("stopped") : gesture);
      show("robot-last", describeDecision(decision, breakReason));
      const how = piece?.recorded ? _("As its black box recorded it.") : _("As it was ordered.");
      show("robot-how", piece ? how : "");
    },
  };
}
