// How lively the robot may be.

import { markPressed } from "garry/monitor/controls/button_group";

export function createRobotLevel({ onPress, change }) {
  const group = document.querySelector("[data-levels]");

  onPress("[data-levels] button", ({ value }) => change("robot_intensity", Number(value)));

  return {
    draw: ({ robot_intensity: intensity }) => markPressed(group, intensity),
    events: {
      robot_intensity(session, event) {
        session.robot_intensity = event.value;
      },
    },
  };
}
