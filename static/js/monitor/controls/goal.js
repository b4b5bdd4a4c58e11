// The goal: up and down by a small step, or a first one before the baseline has given it.

import { _, fill, number } from "garry/shared/language";

const ENOUGH_STRIDES = 5; // for a goal from what has been walked so far

// About 2.5 % of the goal, rounded up to 1, 2 or 5 of a decimal place.
function stepOf(goal) {
  const size = 10 ** Math.floor(Math.log10(goal / 40));
  return [1, 2, 5, 10].map((n) => n * size).find((step) => step >= goal / 40);
}

export function createGoal({ state, show, announce, onPress, change }) {
  function setFirst() {
    const values = state.strides.filter(({ valid, value }) => valid && value > 0).map(({ value }) => value);
    if (values.length < ENOUGH_STRIDES) {
      announce(_("The goal follows from the baseline. Walk five steps to set one from them."));
      return;
    }
    const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
    change("goal", Number(mean.toFixed(2)));
  }

  onPress("[data-goal]", ({ dataset }, { goal }) => {
    if (goal === null) {
      setFirst();
      return;
    }
    const step = stepOf(goal);
    change("goal", Number((Math.round(goal / step + Number(dataset.goal)) * step).toFixed(4)));
  });

  return {
    draw: ({ goal }) => show("goal", goal === null ? "–" : number(goal, 2)),
    events: {
      source_goal(_session, event) {
        announce(fill(_("The sensor’s own goal is %(goal)s; yours counts."), { goal: number(event.goal, 2) }));
      },
    },
  };
}
