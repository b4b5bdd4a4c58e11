// This phone's clock on the server's, by exchanges as of NTP (RFC 5905, 8): the error is half a round trip, and grows.

const DRIFT = 50e-6; // between two quartz clocks at most

export class ServerClock {
  #best = null; // { offset_s, error_s, at_s }

  // We asked at `asked_s`, the server's clock said `server_s`, the answer came at `now_s`.
  answer(asked_s, server_s, now_s) {
    const error_s = Math.max(0.0001, (now_s - asked_s) / 2); // clocks of browsers are as coarse as that
    if (error_s > this.error_s(now_s)) return;
    this.#best = { offset_s: (asked_s + now_s) / 2 - server_s, error_s, at_s: now_s };
  }

  error_s(now_s) {
    return this.#best ? this.#best.error_s + DRIFT * (now_s - this.#best.at_s) : Infinity;
  }

  // How far this clock is ahead of the server's [s]; null before the first answer.
  get offset_s() {
    return this.#best && this.#best.offset_s;
  }

  toServer(time_s) {
    return time_s - this.#best.offset_s;
  }
}
