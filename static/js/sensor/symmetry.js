// How unequal the steps of both legs are, by the contacts of another phone on the other leg.
//
// As rehab/sources/intake/wearable_pipeline.py: only where both clocks agree within 10 ms.

const AGREE_S = 0.01;
const KEPT = 20;

export class Symmetry {
  #contacts = []; // of the other leg, by the server's clock

  note({ at_s, error_s }) {
    this.#contacts.push({ at_s, error_s });
    if (this.#contacts.length > KEPT) this.#contacts.shift();
  }

  // The difference of a stride's two steps, in percent of the stride; null where it is not known.
  find({ initial_contact_s, end_s }, clock, now_s) {
    const error_s = clock.error_s(now_s);
    if (error_s > AGREE_S) return null;
    const [begin, end] = [clock.toServer(initial_contact_s), clock.toServer(end_s)];
    const inside = this.#contacts.filter(({ at_s }) => at_s > begin && at_s < end);
    if (inside.length !== 1 || inside[0].error_s + error_s > AGREE_S) return null;
    const { at_s } = inside[0];
    return (100 * Math.abs(end - at_s - (at_s - begin))) / (end - begin);
  }
}
