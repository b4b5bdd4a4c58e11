// The last half minute of samples: they stay on this phone, until a person saves them for support.
//
// As a file that `python -m rehab.gait wearable` reads.

const KEPT_S = 30;
const HEADER = "time_s,ax,ay,az,gx,gy,gz";

export class RecentSamples {
  #rows = [];

  add({ time_s, rate, acceleration }) {
    this.#rows.push([time_s, ...acceleration, ...rate]);
    let old = 0;
    while (this.#rows[old][0] < time_s - KEPT_S) old += 1;
    if (old > 600) this.#rows.splice(0, old); // cut now and then: it moves all others
  }

  toText() {
    const begin_s = this.#rows.length ? this.#rows[this.#rows.length - 1][0] - KEPT_S : 0;
    const rows = this.#rows.filter(([time_s]) => time_s >= begin_s);
    return [HEADER, ...rows.map(([time_s, ...six]) => [time_s.toFixed(4), ...six.map((one) => one.toFixed(5))])].join(
      "\n",
    );
  }

  save(name) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([this.toText()], { type: "text/csv" }));
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
  }
}
