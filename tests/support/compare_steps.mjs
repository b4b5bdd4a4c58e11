// Reads exchanges, contacts and strides; prints the clock's offset and error, and each stride's asymmetry.

import { readFileSync } from "node:fs";
import { ServerClock } from "garry/sensor/clock";
import { Symmetry } from "garry/sensor/symmetry";

const { exchanges, contacts, strides, now_s } = JSON.parse(readFileSync(0, "utf8"));
const clock = new ServerClock();
const symmetry = new Symmetry();
for (const exchange of exchanges) clock.answer(...exchange);
for (const contact of contacts) symmetry.note(contact);
const found = strides.map(([initial_contact_s, end_s]) => symmetry.find({ initial_contact_s, end_s }, clock, now_s));
console.log(JSON.stringify({ offset_s: clock.offset_s, error_s: clock.error_s(now_s), found }));
