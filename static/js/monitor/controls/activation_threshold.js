// The mean performance of a window from which on the robot acts.

import { percent } from "garry/shared/format";

export function createActivationThreshold({ show, onPress, change }) {
  onPress("[data-threshold]", ({ dataset }, { activation_threshold: threshold }) =>
    change("activation_threshold", Number((threshold + Number(dataset.threshold)).toFixed(2))),
  );

  return {
    draw: ({ activation_threshold: threshold }) => show("threshold", percent(threshold)),
    events: {
      activation_threshold(session, event) {
        session.activation_threshold = event.value;
      },
    },
  };
}
