// How figures are written on every page.

import { language, number } from "garry/shared/language";

// 0.85 as "85 %"; the space between does not break.
export const percent = (share) => `${number(100 * share)}\u00a0%`;

// What is below a limit never reads as it: 0.9994 of 1 as "99 %".
export const notReaching = (share, limit = 1) => (share < limit ? Math.min(share, limit - 0.01) : share);

export const signed = (points) => (points < 0 ? `−${-points}` : `+${points}`);

// So many seconds ago: "now", "12 sec. ago", "3 min. ago".
export function ago(seconds) {
  const [unit, length] = seconds < 60 ? ["second", 1] : seconds < 3600 ? ["minute", 60] : ["hour", 3600];
  const written = new Intl.RelativeTimeFormat(language, { numeric: "auto", style: "short" });
  return written.format(-Math.floor(seconds / length), unit);
}

// The same of a moment, whole minutes alone.
export const minutesAgo = (moment) => ago(60 * Math.max(0, Math.floor((Date.now() - Date.parse(moment)) / 60_000)));

// Whole seconds as "1:05".
export function clock(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
