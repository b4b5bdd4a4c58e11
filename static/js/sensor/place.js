// Whether a phone sits as it did the last time it was worn there: its vertical, while the patient stands.

import { findAngle } from "garry/sensor/orientation";

const SAME_RAD = (12 * Math.PI) / 180; // as what counts as moved (mounting.js)

export class LastPlace {
  #key;

  constructor(place, side) {
    this.#key = `sensor ${place} ${side}`;
  }

  // By how much it sits otherwise [°]; 0 where it does not, or was never worn here.
  compare(upright) {
    const last = JSON.parse(localStorage.getItem(this.#key) ?? "null");
    const angle = last ? findAngle(upright, last) : 0;
    return angle > SAME_RAD ? Math.round((angle * 180) / Math.PI) : 0;
  }

  keep(upright) {
    localStorage.setItem(this.#key, JSON.stringify(upright));
  }
}
