// A panel whose content the server draws. What a person has unfolded, scrolled to or selected stays so.
const NAMES = ["data-name", "data-act", "data-alarm"];

// A selector of the element with the focus, by what the server calls it.
const named = (element) => NAMES.filter((name) => element.hasAttribute(name))
  .map((name) => `[${name}="${CSS.escape(element.getAttribute(name))}"]`).join("");

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
      this.$el.querySelectorAll("details").forEach((d) => { d.open = open.has(d.dataset.name); });
      this.$el.scrollLeft = scrolled;
      if (focused) this.$el.querySelector(focused)?.focus({ preventScroll: true });
    },
  },
};
