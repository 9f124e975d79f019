// Findings aloud. Browsers, and pilots, want to be asked: it is off until it is turned on.

// Hertz and seconds.
const TONES = {
  critical: [
    [880, 0.14],
    [660, 0.14],
    [880, 0.14],
    [660, 0.14],
  ],
  warning: [
    [740, 0.16],
    [740, 0.16],
  ],
  stale: [[440, 0.25]],
};
const PAUSE = 0.06;

export const sound = () => {
  let context = null;
  const play = (tones) => {
    let at = context.currentTime + 0.02;
    for (const [hertz, seconds] of tones) {
      const tone = context.createOscillator(),
        volume = context.createGain();
      tone.frequency.value = hertz;
      tone.type = "triangle";
      volume.gain.setValueAtTime(0, at);
      volume.gain.linearRampToValueAtTime(0.22, at + 0.015);
      volume.gain.setValueAtTime(0.22, at + seconds - 0.03);
      volume.gain.linearRampToValueAtTime(0, at + seconds);
      tone.connect(volume).connect(context.destination);
      tone.start(at);
      tone.stop(at + seconds);
      at += seconds + PAUSE;
    }
  };
  return {
    get on() {
      return context != null;
    },
    toggle() {
      if (context) {
        context.close();
        context = null;
        return;
      }
      context = new AudioContext();
      play([[660, 0.08]]);
    },
    // The worst of what is new, once.
    tell(notes) {
      if (!context) return;
      const levels = notes.filter((note) => note.kind === "finding").map((note) => note.level);
      const worst = ["critical", "warning", "stale"].find((level) => levels.includes(level));
      if (worst) play(TONES[worst]);
    },
  };
};
