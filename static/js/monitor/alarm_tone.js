// An alarm that is heard and felt: two short tones, twice, and a vibration where the device has one.

const TONES_HZ = [880, 660, 880, 660];
const APART_S = 0.18;
const LOUDNESS = 0.3;
const VIBRATION_MS = [300, 120, 300];

let audio;

// A browser plays nothing, and does not vibrate, before its page was touched.
function wake() {
  audio ??= new AudioContext();
  audio.resume().catch(() => {});
}
for (const touch of ["pointerdown", "keydown"]) document.addEventListener(touch, wake);

function play(hz, at_s) {
  const [voice, level] = [audio.createOscillator(), audio.createGain()];
  voice.frequency.value = hz;
  level.gain.setValueAtTime(LOUDNESS, at_s);
  level.gain.exponentialRampToValueAtTime(0.001, at_s + APART_S);
  voice.connect(level).connect(audio.destination);
  voice.start(at_s);
  voice.stop(at_s + APART_S);
}

export function soundAlarm() {
  if (navigator.userActivation?.hasBeenActive !== false) navigator.vibrate?.(VIBRATION_MS);
  if (audio?.state !== "running") return;
  TONES_HZ.forEach((hz, index) => play(hz, audio.currentTime + index * APART_S));
}
