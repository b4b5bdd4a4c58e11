// Read events of devicemotion from standard input; write the samples that a phone's page makes of them.
import { readFileSync } from "node:fs";
import { Motion } from "garry/sensor/motion";

const motion = new Motion();
const axes = (list, names) => list && Object.fromEntries(list.map((value, n) => [names[n], value]));
const samples = JSON.parse(readFileSync(0, "utf8")).map(([timeStamp, pulls, turns]) =>
  motion.read({
    timeStamp,
    accelerationIncludingGravity: axes(pulls, ["x", "y", "z"]),
    rotationRate: axes(turns, ["beta", "gamma", "alpha"]),
  }),
);
const last = samples.findLast((one) => one !== null);
const trouble = last ? motion.trouble(last.time_s) : "";
const later = last ? motion.trouble(last.time_s + 60) : "";
console.log(JSON.stringify({ samples, rate_hz: motion.rate_hz, trouble, later }));
