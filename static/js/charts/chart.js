// Charts of the PT's pages: uPlot for axes, scales and cursor, our own marks on top of it.
import uPlot from "uplot";

export const paths = uPlot.paths;

export function color(name) {
  return getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
}

function axis(extra) {
  const font = `500 14px ${getComputedStyle(document.body).fontFamily}`;
  const lines = { stroke: () => color("border"), width: 1 };
  return { font, stroke: () => color("muted"), grid: lines, ticks: { show: false }, gap: 8, ...extra };
}

// Whether a chart has a phone's width.
export const isNarrow = (element) => element.clientWidth < 500;

// Draw a chart that fills its element and keeps its size. `under(marks)` draws before the series and
// `paint(marks)` after them; `onCursor` gets the index under the pointer; the rest is uPlot's own.
export function draw(element, { data, series, xAxis, yAxis, under, paint, onCursor, ...more }) {
  const hooks = {
    drawClear: under ? [(chart) => under(new Marks(chart))] : [],
    draw: paint ? [(chart) => paint(new Marks(chart))] : [],
    setCursor: onCursor ? [(chart) => onCursor(chart.cursor.idx)] : [],
  };
  const size = () => ({ width: element.clientWidth, height: element.clientHeight });
  const options = {
    ...size(),
    series: [{}, ...series],
    axes: [axis({ size: 34, grid: { show: false }, ...xAxis }), axis({ size: isNarrow(element) ? 36 : 56, ...yAxis })],
    legend: { show: false },
    hooks,
    ...more,
    cursor: { ...more.cursor, move: (_chart, ...place) => place.map((part) => part / (element.currentCSSZoom ?? 1)) },
  };
  const chart = new uPlot(options, data, element);
  new ResizeObserver(() => chart.setSize(size())).observe(element);
  new MutationObserver(() => chart.redraw()).observe(document.documentElement, { attributeFilter: ["data-pt"] });
  return chart;
}

// Shapes at places of a chart, in its own values. Shape repeats the meaning of color.
export class Marks {
  constructor(chart) {
    this.chart = chart;
    this.ctx = chart.ctx;
    this.unit = devicePixelRatio;
    this.box = chart.bbox;
  }

  x(value) {
    return this.chart.valToPos(value, "x", true);
  }

  y(value) {
    return this.chart.valToPos(value, "y", true);
  }

  disc(x, y, size, fill) {
    this.ctx.fillStyle = fill;
    this.ctx.beginPath();
    this.ctx.arc(this.x(x), this.y(y), size * this.unit, 0, 7);
    this.ctx.fill();
  }

  square(x, y, size, fill, shift = 0) {
    const half = size * this.unit;
    this.ctx.fillStyle = fill;
    this.ctx.fillRect(this.x(x) - half + shift * this.unit, this.y(y) - half, 2 * half, 2 * half);
  }

  // A short level line through x, at most as wide as its room [px].
  dash(x, y, stroke, room) {
    const half = Math.min(34, 0.4 * room) * this.unit;
    this.line(this.x(x) - half, this.y(y), this.x(x) + half, this.y(y), stroke, 3);
  }

  bar(x, low, high, stroke) {
    this.line(this.x(x), this.y(low), this.x(x), this.y(high), stroke, 2);
  }

  line(x0, y0, x1, y1, stroke, width, dashes = []) {
    const { ctx, unit } = this;
    ctx.save();
    ctx.strokeStyle = stroke;
    ctx.lineWidth = width * unit;
    ctx.setLineDash(dashes.map((dash) => dash * unit));
    ctx.beginPath();
    ctx.moveTo(x0, y0);
    ctx.lineTo(x1, y1);
    ctx.stroke();
    ctx.restore();
  }

  #setFont(weight, size) {
    this.ctx.font = `${weight} ${size * this.unit}px ${getComputedStyle(document.body).fontFamily}`;
  }

  // Draw text at device pixels; return its width.
  text(content, x, y, { size = 14, weight = 500, fill = color("muted"), align = "center" } = {}) {
    this.#setFont(weight, size);
    this.ctx.fillStyle = fill;
    this.ctx.textAlign = align;
    this.ctx.textBaseline = "alphabetic";
    this.ctx.fillText(content, x, y);
    return this.ctx.measureText(content).width;
  }

  // Draw text from above to below, with a rim of the color behind it.
  upright(content, x, y, rim) {
    this.ctx.save();
    this.ctx.translate(x, y);
    this.ctx.rotate(Math.PI / 2);
    Object.assign(this.ctx, { strokeStyle: rim, lineWidth: 3 * this.unit, lineJoin: "round" });
    this.#setFont(500, 13);
    this.ctx.strokeText(content, 4 * this.unit, 0);
    this.text(content, 4 * this.unit, 0, { size: 13, align: "left" });
    this.ctx.restore();
  }

  widthOf(content, size = 14) {
    this.#setFont(700, size);
    return this.ctx.measureText(content).width;
  }
}
