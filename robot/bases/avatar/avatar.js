// The avatar: shows what the robot's program tells it, and never decides anything.

const MOUTHS = {
  rest: "M176 164 Q200 168 224 164",
  calm: "M180 164 Q200 164 220 164",
  celebrate: "M168 156 Q200 190 232 156",
  droop: "M176 172 Q200 152 224 172",
};
// Notes [Hz]: success rises, a miss falls, softly; neither ever has the other's.
const CUES = { calm: [440], celebrate: [523, 659, 784], droop: [392, 330, 262] };
const NOTE_S = 0.16;
const LOUDNESS = { calm: 0.12, celebrate: 0.25, droop: 0.12 };
// How it holds its arms, head and eyes: [left °, right °, nod px, tilt °, gaze px, lids px]. The variants
// of a gesture take these by turns.
const ACTS = {
  rest: [[0, 0, 0, 0, 0, 0]],
  celebrate: [
    [130, -130, -14, 0, 0, 0],
    [150, -20, -10, -7, -4, -3],
    [20, -150, -10, 7, 4, -3],
    [80, -80, -18, 0, 0, -4],
  ],
  droop: [
    [-8, 8, 22, 9, 0, 6],
    [-4, 4, 18, -9, -5, 6],
    [-8, 8, 26, 0, 0, 8],
  ],
  trying: [
    [35, -35, 4, -8, 4, 0],
    [35, -35, 4, 8, -4, 0],
    [60, -10, 0, 0, 5, -2],
  ],
  waving: [
    [0, -150, -6, 6, 0, 0],
    [150, 0, -6, -6, 0, 0],
  ],
  resting: [[0, 0, 10, 0, 0, 5]],
  nodding: [[0, 0, 16, 0, 0, 2]],
  swaying: [[25, 25, 0, -10, -5, 0]],
};
// Which of them each gesture is; those that a clinic composed follow their answer.
const GESTURES = {
  joy: "celebrate",
  streak_3: "celebrate",
  streak_5: "celebrate",
  streak_10: "celebrate",
  comeback: "celebrate",
  celebrate: "celebrate",
  disappointment: "droop",
  droop: "droop",
  near_miss: "trying",
  effort: "trying",
  greeting: "waving",
  farewell: "waving",
  rest: "resting",
  nod: "nodding",
  sway: "swaying",
};
const PARTS = ["left", "right", "nod", "tilt", "gaze", "lids"];
const UNITS = ["deg", "deg", "px", "deg", "px", "px"];
const RETRY_MS = 500;
const PIXELS_M = 400; // how far the figure goes on the screen for each meter

const body = document.body;
const figure = document.getElementById("figure");
const mouth = document.getElementById("mouth");
const soundButton = document.getElementById("sound");

let sound = null; // the AudioContext; browsers allow it after a tap only
let playing = [];
let heard = null; // number of the last answer that was given

function allowSound() {
  sound ??= new AudioContext();
  sound.resume();
  soundButton.hidden = true;
}

function silence() {
  for (const tone of playing) tone.stop();
  playing = [];
  speechSynthesis.cancel();
}

function say(words) {
  if (sound !== null && words) speechSynthesis.speak(new SpeechSynthesisUtterance(words));
}

function play(mood) {
  silence();
  if (sound === null) return;
  CUES[mood].forEach((frequency, index) => {
    const tone = sound.createOscillator();
    const volume = sound.createGain();
    const begins = sound.currentTime + index * NOTE_S;
    tone.type = "sine";
    tone.frequency.setValueAtTime(frequency, begins);
    volume.gain.setValueAtTime(0, begins);
    volume.gain.linearRampToValueAtTime(LOUDNESS[mood], begins + 0.02);
    volume.gain.linearRampToValueAtTime(0, begins + NOTE_S);
    tone.connect(volume).connect(sound.destination);
    tone.start(begins);
    tone.stop(begins + NOTE_S);
    playing.push(tone);
  });
}

// Its act, and how to hold it; only what answers a strong window may look glad.
function read(answer) {
  if (answer === null) return ["rest", ACTS.rest[0]];
  const [, gesture, number = 1] = /^(.*?)(?:_(\d+))?$/.exec(answer.gesture);
  const usual = answer.glad ? "celebrate" : "droop";
  const found = GESTURES[gesture] ?? usual;
  const act = found === "celebrate" ? usual : found;
  return [act, ACTS[act][(number - 1) % ACTS[act].length]];
}

function show({ state, pose, answer, answers }) {
  const [ahead, aside, turned] = pose;
  const [act, parts] = read(answer);
  const mood = act in MOUTHS ? act : "calm";
  parts.forEach((value, part) => body.style.setProperty(`--${PARTS[part]}`, value + UNITS[part]));
  body.dataset.act = act;
  body.dataset.state = state;
  body.dataset.mood = mood;
  mouth.setAttribute("d", MOUTHS[mood]);
  // Seen from the front: ahead is towards the viewer, its left is our right, a turn leans it.
  const scale = 1 + ahead;
  figure.setAttribute(
    "transform",
    `translate(${aside * PIXELS_M + 200} 360) rotate(${-20 * Math.sin(turned)}) scale(${scale}) translate(-200 -360)`,
  );
  if (state === "stopped") silence();
  const isNew = heard !== null && answers !== heard;
  heard = answers;
  if (isNew && answer !== null && !answer.quiet) {
    play(mood);
    say(answer.words);
  }
}

function connect() {
  const socket = new WebSocket(`ws://${location.host}/avatar`);
  socket.onmessage = ({ data }) => {
    delete body.dataset.lost;
    show(JSON.parse(data));
  };
  socket.onclose = () => {
    body.dataset.lost = "";
    silence();
    heard = null; // what was missed meanwhile is past
    setTimeout(connect, RETRY_MS);
  };
}

soundButton.addEventListener("click", allowSound);
connect();
