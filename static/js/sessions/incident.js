// The report of a robot's incident: reasons in words, and where it went, played again.

import { describeReason } from "garry/monitor/robot_text";
import { playPreview } from "garry/shared/gesture_preview";
import { RobotScene } from "garry/shared/robot_scene";

for (const place of document.querySelectorAll("[data-reason]"))
  place.textContent = describeReason(place.dataset.reason);

for (const place of document.querySelectorAll("[data-replay]")) {
  const replay = JSON.parse(document.getElementById(place.dataset.replay).textContent);
  const scene = new RobotScene(place.querySelector("svg"), { isFollowed: false });
  const button = place.querySelector("button");
  // On paper, and before it is played: all of its way.
  scene.draw({ poses: replay.poses.map(([, x_m, y_m, heading_rad]) => ({ x_m, y_m, heading_rad })) });
  button.addEventListener("click", async () => {
    button.disabled = true;
    await playPreview([scene], replay);
    button.disabled = false;
  });
}
