// A gesture as its robot would play it: the scene moves, the lights change, the notes sound.

import { WalkerView } from "garry/shared/walker_view";

const LOUDNESS = 0.15;
const FADE_S = 0.02; // so that a note does not click
// What stands for a Kobuki's own melodies, as notes [Hz] of 0.12 s.
const MELODY_HZ = [659, 784];

const sinceOf = (entries, at_s) => entries.findLast(([from_s]) => from_s <= at_s);

// Schedule the notes of a preview on an audio clock; return their oscillators.
export function scheduleNotes(audio, notes) {
  const begins_s = audio.currentTime;
  const oscillators = [];
  const add = (at_s, frequency_hz, duration_s) => {
    const oscillator = audio.createOscillator();
    const gain = audio.createGain();
    oscillator.type = "triangle";
    oscillator.frequency.value = frequency_hz;
    const from_s = begins_s + at_s;
    gain.gain.setValueAtTime(0, from_s);
    gain.gain.linearRampToValueAtTime(LOUDNESS, from_s + FADE_S);
    gain.gain.setValueAtTime(LOUDNESS, from_s + duration_s - FADE_S);
    gain.gain.linearRampToValueAtTime(0, from_s + duration_s);
    oscillator.connect(gain).connect(audio.destination);
    oscillator.start(from_s);
    oscillator.stop(from_s + duration_s);
    oscillators.push(oscillator);
  };
  for (const [at_s, frequency_hz, duration_s, melody] of notes) {
    if (melody) MELODY_HZ.forEach((melody_hz, index) => add(at_s + 0.12 * index, melody_hz, 0.12));
    else add(at_s, frequency_hz, duration_s);
  }
  return oscillators;
}

// Draw a preview (robot/motion/preview.py) as it is at a moment.
export function drawMoment(scene, { took_s, poses, lights, mood, looks = [] }, at_s) {
  const passed = poses.filter(([from_s]) => from_s <= at_s);
  const shown = (passed.length ? passed : poses.slice(0, 1)).map(([, x_m, y_m, heading_rad]) => ({
    x_m,
    y_m,
    heading_rad,
  }));
  const isOver = at_s >= took_s;
  const [, first, second] = (!isOver && sinceOf(lights, at_s)) || [0, "off", "off"];
  const look = isOver ? undefined : sinceOf(looks, at_s)?.slice(1);
  scene.draw({ poses: shown, lights: [first, second], mood: isOver ? "calm" : mood, look });
}

// Play a preview in drawings; `audio` may be missing. Resolves at its end.
export function playPreview(scenes, preview, audio) {
  if (audio) scheduleNotes(audio, preview.notes);
  const began = performance.now();
  return new Promise((resolve) => {
    const step = () => {
      const at_s = (performance.now() - began) / 1000;
      for (const scene of scenes) drawMoment(scene, preview, at_s);
      if (at_s >= preview.took_s) resolve();
      else requestAnimationFrame(step);
    };
    step();
  });
}

// Let each drawing's button play it.
export function setUpPreviews(root = document) {
  for (const place of root.querySelectorAll("[data-preview]")) {
    const preview = JSON.parse(place.dataset.preview);
    const scene = new WalkerView(place.querySelector("svg"));
    const button = place.querySelector("button");
    let audio;
    button.addEventListener("click", async () => {
      button.disabled = true;
      audio ??= new AudioContext();
      await playPreview([scene], preview, audio);
      button.disabled = false;
    });
  }
}
