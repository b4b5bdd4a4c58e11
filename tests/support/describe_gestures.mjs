// Read names of gestures from standard input; write what the therapist's page says of each.
import { readFileSync } from "node:fs";

globalThis.document = { documentElement: { lang: "en" } };
const { describeGesture } = await import("garry/monitor/robot_text");
process.stdout.write(JSON.stringify(JSON.parse(readFileSync(0, "utf8")).map(describeGesture)));
