// Read {place, samples} from standard input; write the strides that the phone's detector finds, and what it knows.
import { readFileSync } from "node:fs";
import { WearableDetector } from "garry/sensor/detector";

const { place, samples } = JSON.parse(readFileSync(0, "utf8"));
const detector = new WearableDetector(place);
const strides = samples.flatMap(([time_s, ax, ay, az, gx, gy, gz]) =>
  detector.add(time_s, [gx, gy, gz], [ax, ay, az]),
);
console.log(JSON.stringify({ strides, left: detector.left, isInDoubt: detector.isInDoubt }));
