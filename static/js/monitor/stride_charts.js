// The strides in drawings: the strip of all recent ones with its legend, the last twenty, and the share of hits.

import { _, fill, n_ } from "garry/shared/language";
import { percent } from "garry/shared/format";
import { legendOf } from "garry/monitor/annotations";
import { drawHitRing } from "garry/monitor/hit_ring";
import { drawLastStrides } from "garry/monitor/last_strides";
import { drawStrip, performanceOf } from "garry/monitor/strip";

const LAST = 20;

export function createStrideCharts({ state, show }) {
  const [strip, twenty, ring] = ["strip", "twenty", "ring"].map((id) => document.getElementById(id));
  const legend = document.querySelector(".legend");

  function drawLegend() {
    const entries = legendOf(state.annotations);
    const written = entries.map((entry) => entry.join(" ")).join();
    if (legend.dataset.of === written) return;
    legend.dataset.of = written;
    const items = entries.map(([sign, text]) => {
      const item = document.createElement("li");
      item.append(Object.assign(document.createElement("b"), { textContent: sign }), ` ${text}`);
      return item;
    });
    legend.replaceChildren(...items);
  }

  const isBeforeGoal = ({ goal }) => goal === null && state.strides.every(({ performance }) => performance == null);

  function describeStrip(session) {
    return isBeforeGoal(session) ? fill(_("Strides in %(unit)s, mean ± SD"), session) : _("Strides against the goal");
  }

  function countLast() {
    const judged = state.strides.filter(({ performance }) => performance !== null).slice(-LAST);
    const decided = judged.filter(({ close }) => !close);
    return { judged: judged.length, count: decided.length, hits: decided.filter(({ hit }) => hit).length };
  }

  function describeLast({ judged, count, hits }) {
    return judged ? withClose(fill(_("%(hits)s of %(count)s hit"), { hits, count }), judged - count) : "";
  }

  // Steps that were close are counted apart.
  function withClose(words, close) {
    return close ? `${words}, ${n_("%(count)s close", "%(count)s close", close)}` : words;
  }

  // Of all strides with feedback: a few of the last may have had none.
  function describeRate({ hits, judged, close = 0, target }, last) {
    show("wanted", target.hit_rate ? fill(_("Wanted %(rate)s"), { rate: percent(target.hit_rate) }) : _("No rate set"));
    show(
      "judged",
      judged === undefined || judged < last.judged
        ? ""
        : withClose(fill(_("%(hits)s of %(count)s in all"), { hits, count: judged - close }), close),
    );
  }

  const charts = {
    draw(session) {
      show("strip", describeStrip(session));
      drawStrip(strip, state.strides, state.annotations, session);
      drawLegend();
      const last = countLast();
      show("of-twenty", describeLast(last));
      if (twenty)
        drawLastStrides(twenty, state.strides.slice(-LAST), LAST, performanceOf(state.strides, session), session.span);
      drawHitRing(ring, last.count ? last.hits / last.count : null, session.target.hit_rate);
      describeRate(session, last);
    },
  };
  new ResizeObserver(() => state.session && charts.draw(state.session)).observe(strip); // banners take of its height
  return charts;
}
