// Confetti: one burst at a time, behind everything, so only ever in the sky.

import { create } from "canvas-confetti";
import { isStill } from "garry/walk/reduced_motion";

const REST_MS = 3_000;
const PIECES = { little: 26, much: 44, most: 64 };
// Plain data: the library's own helper would search a million points for each path's middle.
const SHAPES = [
  "M-7 -3.5h14v7h-14z", // slip
  "M4 0a4 4 0 1 1 -8 0a4 4 0 1 1 8 0z", // dot
  "M-9 3q4.5 -9 9 -3.5t9 -3.5l0 4q-4.5 9 -9 3.5t-9 3.5z", // streamer
].map((path) => ({ type: "path", path, matrix: [1, 0, 0, 1, 0, 0] }));
const LASTS_TICKS = 84; // 1.4 s at 60 frames a second

export function createCelebration(canvas) {
  // Not in a worker: the library starts one from a blob, which our content policy refuses.
  const burst = create(canvas, { resize: true, useWorker: false });
  let last = -REST_MS;

  const clear = () => burst.reset();

  // Start a burst of the amount that the step's band has, in the theme's colors, but not within 3 s of the
  // last one. Return whether it did.
  function celebrate(amount) {
    const now = performance.now();
    if (!PIECES[amount] || isStill() || document.hidden || now - last < REST_MS) return false;
    const colors = getComputedStyle(document.body).getPropertyValue("--confetti").trim();
    if (!colors) return false;
    last = now;
    const scale = Math.min(innerWidth, innerHeight) / 800;
    const y = innerHeight > innerWidth ? 0.26 : 0.14;
    const common = {
      colors: colors.split(" "),
      shapes: SHAPES,
      scalar: 2.8 * scale,
      ticks: LASTS_TICKS,
      gravity: 0.8 * scale,
      particleCount: PIECES[amount] / 2,
      startVelocity: innerWidth / 32,
      decay: 0.93,
      spread: 56,
    };
    burst({ ...common, origin: { x: -0.02, y }, angle: 14 });
    burst({ ...common, origin: { x: 1.02, y }, angle: 166 });
    return true;
  }

  return { celebrate, clear };
}
