// Says when the server is gone, rings while an alarm stands, and passes keys to the buttons that
// carry their letter.
const LOST_MS = 2000, RING_MS = 5000, TONES = [880, 660], STEPS = { ArrowUp: -1, ArrowDown: 1 };

// Two tones. A browser lets a page sound only after somebody has touched it; until then it is mute.
const bell = {
  rung: 0, context: null,
  ring() {
    this.context ??= new AudioContext();
    if (this.context.state !== "running") { this.wake(); return false; }
    this.rung += 1;
    TONES.forEach((hertz, k) => {
      const tone = this.context.createOscillator(), volume = this.context.createGain();
      const from = this.context.currentTime + 0.25 * k;
      tone.frequency.value = hertz;
      volume.gain.setValueAtTime(0.2, from);
      volume.gain.exponentialRampToValueAtTime(0.001, from + 0.24);
      tone.connect(volume).connect(this.context.destination);
      tone.start(from); tone.stop(from + 0.25);
    });
    return true;
  },
  // What is asked for before that touch is never answered, and would pile up by four a second.
  wake() { if (navigator.userActivation?.hasBeenActive ?? true) this.context.resume().catch(() => {}); },
};
window.fleaBell = bell;

export default {
  template: "<div class='lost-banner' role='alert'></div>",
  mounted() {
    this.title = document.title; this.ringing = 0; this.rang = 0;
    this.beat(0);
    this.timer = setInterval(() => {
      const lost = Date.now() - this.last > LOST_MS;
      if (lost) this.$el.textContent = `✕ DISCONNECTED since ${new Date(this.last).toISOString().slice(11, 19)} UTC: the content below is outdated. Reconnecting …`;
      document.body.classList.toggle("lost", lost);
      if (this.ringing && Date.now() - this.rang >= RING_MS) this.rang = bell.ring() ? Date.now() : 0;
      document.body.classList.toggle("muted", this.ringing > 0 && bell.context?.state !== "running");
    }, 250);
    this.keyed = (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || /INPUT|TEXTAREA|SELECT/.test(event.target.tagName)) return;
      const dialog = document.querySelector(".q-dialog");
      if (event.key in STEPS && !dialog && this.step(STEPS[event.key])) { event.preventDefault(); return; }
      const target = document.querySelector(`[data-key="${CSS.escape(event.key)}"]`);
      if (!target || !target.offsetParent || (dialog && !dialog.contains(target))) return;
      event.preventDefault();
      if (target.matches("button, a")) target.click();
      else { target.scrollIntoView({ block: "start" }); target.focus({ preventScroll: true }); }
    };
    document.addEventListener("keydown", this.keyed);
  },
  unmounted() { clearInterval(this.timer); document.removeEventListener("keydown", this.keyed); },
  methods: {
    // Selects the stand above or below in the list of all; false where there is none.
    step(by) {
      const stands = [...document.querySelectorAll("#panel-stands a.stand")];
      if (!stands.length) return false;
      const at = stands.indexOf(document.activeElement);
      stands[at < 0 ? 0 : Math.min(Math.max(at + by, 0), stands.length - 1)].focus();
      return true;
    },
    // The server lives, and so many alarms wait to be acknowledged.
    beat(ringing) {
      this.last = Date.now();
      if (ringing === this.ringing) return;
      if (ringing > this.ringing) this.rang = 0;
      this.ringing = ringing;
      document.title = ringing ? `▲ ${ringing} not acknowledged · ${this.title}` : this.title;
      document.body.classList.toggle("ringing", ringing > 0);
    },
  },
};
