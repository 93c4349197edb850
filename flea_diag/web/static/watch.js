// Says when the server is gone, and passes keys to the buttons that carry their letter.
const LOST_MS = 2000;

export default {
  template: "<div class='lost-banner' role='alert'></div>",
  mounted() {
    this.beat();
    this.timer = setInterval(() => {
      const lost = Date.now() - this.last > LOST_MS;
      if (lost) this.$el.textContent = `✕ DISCONNECTED since ${new Date(this.last).toISOString().slice(11, 19)} UTC: what stands below is old. Connecting again …`;
      document.body.classList.toggle("lost", lost);
    }, 250);
    this.keyed = (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || /INPUT|TEXTAREA|SELECT/.test(event.target.tagName)) return;
      const target = document.querySelector(`[data-key="${CSS.escape(event.key)}"]`);
      if (!target) return;
      event.preventDefault();
      if (target.matches("button")) target.click();
      else { target.scrollIntoView({ block: "start" }); target.focus({ preventScroll: true }); }
    };
    document.addEventListener("keydown", this.keyed);
  },
  unmounted() { clearInterval(this.timer); document.removeEventListener("keydown", this.keyed); },
  methods: { beat() { this.last = Date.now(); } },
};
