// A panel whose content the server draws. What a person has unfolded, scrolled to or selected stays so.
const NAMES = ["data-name", "data-act", "data-opens", "data-alarm"];

// A selector of the element with the focus, by what the server calls it.
const named = (element) => NAMES.filter((name) => element.hasAttribute(name))
  .map((name) => `[${name}="${CSS.escape(element.getAttribute(name))}"]`).join("");

// The local time of a moment with its zone; nothing where that is UTC.
function local(time) {
  const at = new Date(time.dateTime), words = at.toLocaleTimeString([], { hour12: false, timeZoneName: "short" });
  if (at.getTimezoneOffset() === 0) return;
  time.title = `${at.toLocaleDateString()} ${words}`;
  if (!time.classList.contains("both")) return;
  const added = document.createElement("span");
  added.className = "local";
  added.textContent = ` · ${words}`;
  time.append(added);
}

export default {
  template: "<div class='body'></div>",
  props: { content: String },
  emits: ["act"],
  mounted() {
    this.show();
    this.$el.addEventListener("click", (event) => {
      const button = event.target.closest("[data-act]");
      if (button) this.$emit("act", `${button.dataset.act} ${button.dataset.alarm}`);
    });
    this.$el.addEventListener("flea-act", (event) => this.$emit("act", event.detail));
    // A button that were drawn anew between press and release would not be clicked.
    this.$el.addEventListener("pointerdown", () => { this.pressed = true; });
    this.released = () => { if (this.pressed) setTimeout(() => { this.pressed = false; this.show(); }); };
    ["pointerup", "pointercancel"].forEach((name) => document.addEventListener(name, this.released));
  },
  unmounted() { ["pointerup", "pointercancel"].forEach((name) => document.removeEventListener(name, this.released)); },
  watch: { content() { this.show(); } },
  methods: {
    show() {
      if (this.pressed || this.shown === this.content) return;
      this.shown = this.content;
      const open = new Set([...this.$el.querySelectorAll("details[open]")].map((d) => d.dataset.name));
      const scrolled = this.$el.scrollLeft;
      const focused = this.$el.contains(document.activeElement) ? named(document.activeElement) : "";
      this.$el.innerHTML = this.content || "";
      this.$el.querySelectorAll("time").forEach(local);
      this.$el.querySelectorAll("details").forEach((d) => { d.open = open.has(d.dataset.name); });
      this.$el.scrollLeft = scrolled;
      // What can be scrolled to the side can be reached by the keyboard.
      const scrolls = !!this.$el.closest(".scroll") && this.$el.scrollWidth > this.$el.clientWidth;
      if (scrolls) this.$el.tabIndex = 0; else this.$el.removeAttribute("tabindex");
      if (focused) this.$el.querySelector(focused)?.focus({ preventScroll: true });
    },
  },
};
