// The avatar: shows what the robot's program tells it, and never decides anything.

// Of its acts (robot/motion/face_and_arms.py), those that sound glad or sad.
const MOODS = { rest: "rest", celebrating: "celebrate", drooping: "droop" };
// Notes [Hz]: success rises, a miss falls, softly; neither ever has the other's.
const CUES = { calm: [440], celebrate: [523, 659, 784], droop: [392, 330, 262] };
const NOTE_S = 0.16;
const LOUDNESS = { calm: 0.12, celebrate: 0.25, droop: 0.12 };
const RETRY_MS = 500;
const PIXELS_M = 400; // how far the figure goes on the screen for each meter

const body = document.body;
const figure = document.getElementById("figure");
const mouth = document.getElementById("mouth");
const soundButton = document.getElementById("sound");

const isScreen = new URLSearchParams(location.search).has("face");

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

function showLook(look) {
  const { style } = body;
  style.setProperty("--left", `${look.left_deg}deg`);
  style.setProperty("--right", `${look.right_deg}deg`);
  style.setProperty("--nod", `${16 * look.nod}px`);
  style.setProperty("--tilt", `${look.tilt_deg}deg`);
  style.setProperty("--gaze", `${7 * look.gaze}px`);
  style.setProperty("--lids", `${5 * look.nod}px`);
  style.setProperty("--open", Math.max(look.eyes, 0.15));
  style.setProperty("--brows", `${look.brows_deg}deg`);
  style.setProperty("--hand", `${look.hand_deg ?? 0}deg`);
  body.toggleAttribute("data-happy", look.eyes < 0);
  body.toggleAttribute("data-brows", look.brows_deg !== 0);
  body.toggleAttribute("data-hand", look.hand_deg !== null);
  mouth.setAttribute("d", look.path);
  mouth.setAttribute("fill", look.mouth === "laugh" ? "#22313a" : "none");
}

function show({ state, pose, answer, answers, act, look }) {
  const [ahead, aside, turned] = pose;
  const mood = MOODS[act] ?? "calm";
  showLook(look);
  body.dataset.act = act;
  body.dataset.state = state;
  body.dataset.mood = mood;
  // Seen from the front: ahead is towards the viewer, its left is our right, a turn leans it.
  const scale = 1 + ahead;
  if (!isScreen)
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

// On a base's own screen the base moves, and the page shows its head alone.
if (isScreen) {
  body.dataset.view = "face";
  figure.parentElement.setAttribute("viewBox", "94 72 212 150");
}
soundButton.addEventListener("click", allowSound);
connect();
