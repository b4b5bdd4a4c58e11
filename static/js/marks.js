// What was changed or noted, on the PT's chart: a badge for each kind, and a legend of those that are there.

const percent = (share) => `${Math.round(100 * share)} %`;
const LEVELS = { 1: "normal", 0.5: "gentle", 0: "off" };

// kind: [badge, what it is, its value in words]
const KINDS = {
  goal: ["⚑", "goal", (value) => value.toFixed(2)],
  gain: ["G", "gain", (value) => value.toFixed(2)],
  activation_threshold: ["A", "robot acts from", percent],
  robot_intensity: ["R", "robot", (value) => LEVELS[value] ?? value],
  valence: ["N", "next type", (value) => value[0].toUpperCase() + value.slice(1)],
  type: ["T", "feedback type", (value) => value],
  words: ["E", "words edited", () => ""],
  words_shown: ["W", "words", (value) => (value ? "on" : "off")],
  chart_style: ["C", "chart", (value) => value],
  pause: ["‖", "pause", () => ""],
  resume: ["▸", "went on", () => ""],
};
const REMARK = "▲";

export function badge({ kind }) {
  return KINDS[kind]?.[0] ?? REMARK;
}

export const isRemark = ({ kind }) => !(kind in KINDS);

// What a mark means: "gain 0.90", "near fall", "borg 4".
export function say({ kind, value }) {
  const [, name, write] = KINDS[kind] ?? ["", kind.replace("_", " "), (number) => number];
  const words = value === null || value === undefined ? "" : write(value);
  return words === "" ? name : `${name} ${words}`;
}

// One entry a kind: what it is, and of changes the latest value.
export function legend(marks) {
  const latest = new Map();
  for (const mark of marks) latest.set(isRemark(mark) ? REMARK : mark.kind, mark);
  return [...latest.values()].map((mark) => [badge(mark), isRemark(mark) ? "noted" : say(mark)]);
}
