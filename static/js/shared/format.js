// How figures are written on every page.

import { number } from "garry/shared/language";

// 0.85 as "85 %"; the space between does not break.
export const percent = (share) => `${number(100 * share)}\u00a0%`;

// What is below a limit never reads as it: 0.9994 of 1 as "99 %".
export const notReaching = (share, limit = 1) => (share < limit ? Math.min(share, limit - 0.01) : share);

export const signed = (points) => (points < 0 ? `−${-points}` : `+${points}`);

// Whole seconds as "1:05".
export function clock(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
