// One soft tone a step. Its pitch tells how much of the goal was reached, alike in every feedback type;
// a second tone, higher or lower, tells what the emblem shows: gained or lost.

const GOAL_HZ = 440; // at the goal; an octave for as much again
const LOWEST = 0.5;
const HIGHEST = 1.5;
const SECOND = { gain: 1.5, loss: 0.75 }; // a fifth up, a fourth down
const LASTS_S = 0.22;
const APART_S = 0.13;
const LOUDNESS = 0.25;

export function createSounds(button) {
  let audio;
  let on = button.dataset.on === "yes";

  // A browser plays nothing before the page was touched: until then the button shows it.
  function show() {
    const heard = on && audio?.state === "running";
    button.setAttribute("aria-pressed", String(heard));
    button.classList.toggle("off", !heard);
  }

  function wake() {
    if (!on) return;
    audio ??= new AudioContext();
    audio.onstatechange = show;
    audio.resume().then(show, show);
    show();
  }

  function tone(hz, at_s) {
    const [voice, level] = [audio.createOscillator(), audio.createGain()];
    voice.frequency.value = hz;
    level.gain.setValueAtTime(0, at_s);
    level.gain.linearRampToValueAtTime(LOUDNESS, at_s + 0.015);
    level.gain.exponentialRampToValueAtTime(0.001, at_s + LASTS_S);
    voice.connect(level).connect(audio.destination);
    voice.start(at_s);
    voice.stop(at_s + LASTS_S);
  }

  // The first touch anywhere starts the audio; the button turns sounds on and off.
  document.addEventListener("pointerdown", ({ target }) => button.contains(target) || wake());
  button.addEventListener("click", () => {
    on = !(on && audio?.state === "running");
    if (on) wake();
    show();
  });
  wake();
  show();

  return function sound({ kind, performance, emblem }) {
    if (!on || audio?.state !== "running" || kind !== "step" || performance === null) return;
    const hz = GOAL_HZ * 2 ** (Math.min(Math.max(performance, LOWEST), HIGHEST) - 1);
    tone(hz, audio.currentTime);
    if (SECOND[emblem]) tone(hz * SECOND[emblem], audio.currentTime + APART_S);
  };
}
