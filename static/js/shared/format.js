// How figures are written on every page.

import { number } from "garry/shared/language";

// 0.85 as "85 %"; the space between does not break.
export const percent = (share) => `${number(100 * share)}\u00a0%`;

export const signed = (points) => (points < 0 ? `−${-points}` : `+${points}`);

// Whole seconds as "1:05".
export function clock(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
