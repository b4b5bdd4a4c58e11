// Keeps the tablet's screen on while the page is looked at, where the browser can.

export async function keepAwake() {
  const hold = () => !document.hidden && navigator.wakeLock?.request("screen").catch(() => {});
  document.addEventListener("visibilitychange", hold);
  await hold();
}
