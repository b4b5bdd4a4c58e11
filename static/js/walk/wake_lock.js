// Keep the tablet's screen on while the page is visible, where the browser can.

export async function keepAwake() {
  const hold = () => !document.hidden && navigator.wakeLock?.request("screen").catch(() => {});
  document.addEventListener("visibilitychange", hold);
  await hold();
}

// A paired tablet fills its screen from the first touch on; as an installed app it does so by itself.
export function fillScreen() {
  const fill = () => document.fullscreenElement ?? document.documentElement.requestFullscreen?.().catch(() => {});
  document.addEventListener("pointerup", fill);
}
