// Says when the server is gone, rings while an alarm stands, and passes keys to the buttons that
// carry their letter.
const LOST_MS = 2000, RING_MS = 5000, OTHER_CLOCK_MS = 60000, TONES = [880, 660], STEPS = { ArrowUp: -1, ArrowDown: 1 };

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

const said = (words, values) => words.replace(/\{(\w+)\}/g, (_, name) => values[name]);

const THEME = "flea-theme";
// A browser may refuse to store anything.
function kept(call, ...words) { try { return localStorage[`${call}Item`](THEME, ...words); } catch { return null; } }

function turn(dark) {
  setDark(dark);  // NiceGUI's
  kept("set", dark ? "dark" : "light");
}

function open(name, alarm) {
  const dialog = document.querySelector(`dialog[data-name="${CSS.escape(name)}"]`);
  if (!dialog) return;
  if (dialog.fleaOpen) dialog.fleaOpen(alarm); else dialog.showModal();
}

// The menu of a narrow bar; false where it was closed already.
function menu(on) {
  const opener = document.querySelector(".bar-top .opener"), rest = opener?.parentElement;
  if (!rest) return false;
  const was = rest.classList.contains("open"), is = on ?? !was;
  rest.classList.toggle("open", is);
  opener.setAttribute("aria-expanded", String(is));
  return was;
}

// Whether a person could not press it anyway; what a closed menu holds has its key all the same.
function hidden(element) {
  return !element.offsetParent && (!element.closest(".rest") || element.classList.contains("hidden"));
}

export default {
  template: "<div><div class='lost-banner' role='alert'></div><p class='other-clock' hidden></p><div class='unseen' role='status' aria-live='polite'></div></div>",
  props: { words: Object },
  mounted() {
    this.title = document.title; this.ringing = 0; this.rang = 0; this.skew = 0;
    this.beat(0);
    this.timer = setInterval(() => {
      const lost = Date.now() - this.last > LOST_MS;
      if (lost) this.$el.firstChild.textContent = said(this.words.lost, { at: new Date(this.last + this.skew).toISOString().slice(11, 19) });
      document.body.classList.toggle("lost", lost);
      if (this.ringing && Date.now() - this.rang >= RING_MS) this.rang = bell.ring() ? Date.now() : 0;
      document.body.classList.toggle("muted", this.ringing > 0 && bell.context?.state !== "running");
    }, 250);
    this.keyed = (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      // For a moment after its dialog was closed a field still has the focus: that key is the page's.
      if (/INPUT|TEXTAREA|SELECT/.test(event.target.tagName) && !hidden(event.target)) return;
      if (document.querySelector("dialog[open]")) return;
      if (event.key in STEPS && this.step(STEPS[event.key])) { event.preventDefault(); return; }
      if (event.key === "Escape" && menu(false)) return;
      const target = [...document.querySelectorAll(`[data-key="${CSS.escape(event.key)}"]`)].find((e) => !hidden(e));
      if (!target || target.disabled) return;
      event.preventDefault();
      if (target.matches("button, a")) target.click();
      else { target.scrollIntoView({ block: "start" }); target.focus({ preventScroll: true }); }
    };
    document.addEventListener("keydown", this.keyed);
    // What the browser does by itself, before the server hears of it.
    this.clicked = (event) => {
      const button = event.target.closest("button");
      if (button && "more" in button.dataset) { menu(); return; }
      menu(false);
      if (!button) return;
      if (button.dataset.opens) open(button.dataset.opens, button.dataset.alarm);
      if ("turn" in button.dataset) turn(!document.body.classList.contains("body--dark"));
      if ("shuts" in button.dataset) button.closest("dialog")?.close();
    };
    document.addEventListener("click", this.clicked);
    const chosen = kept("get");
    if (chosen) turn(chosen === "dark");
  },
  unmounted() {
    clearInterval(this.timer);
    document.removeEventListener("keydown", this.keyed);
    document.removeEventListener("click", this.clicked);
  },
  methods: {
    // Selects the stand above or below in the list of all; false where there is none.
    step(by) {
      const stands = [...document.querySelectorAll("#panel-stands a.stand")];
      if (!stands.length) return false;
      const at = stands.indexOf(document.activeElement);
      stands[at < 0 ? 0 : Math.min(Math.max(at + by, 0), stands.length - 1)].focus();
      return true;
    },
    // A browser with another clock would be misread where its own times stand beside the stand's.
    clocks(skew) {
      this.skew = skew;
      const minutes = Math.round(Math.abs(skew) / 60000), note = this.$el.querySelector(".other-clock");
      note.hidden = Math.abs(skew) < OTHER_CLOCK_MS;
      const words = note.hidden ? "" : said(skew > 0 ? this.words.behind : this.words.ahead, { minutes });
      if (note.textContent !== words) note.textContent = words;
    },
    // The server lives, so many alarms wait to be acknowledged, this is to be read aloud, and so
    // late it is where the server is.
    beat(ringing, aloud, server_ms) {
      this.last = Date.now();
      const spoken = this.$el.lastChild;
      if (aloud !== undefined && spoken.textContent !== aloud) spoken.textContent = aloud;
      if (server_ms !== undefined) this.clocks(server_ms - this.last);
      if (ringing === this.ringing) return;
      if (ringing > this.ringing) this.rang = 0;
      this.ringing = ringing;
      document.title = ringing ? `▲ ${said(this.words.ringing, { count: ringing })} · ${this.title}` : this.title;
      document.body.classList.toggle("ringing", ringing > 0);
    },
  },
};
