// A panel whose content the server draws. What a person has unfolded or scrolled to stays so.
export default {
  template: "<div class='body'></div>",
  props: { content: String },
  emits: ["act"],
  mounted() {
    this.show(this.content);
    this.$el.addEventListener("click", (event) => {
      const button = event.target.closest("[data-act]");
      if (button) this.$emit("act", `${button.dataset.act} ${button.dataset.alarm}`);
    });
  },
  watch: { content(html) { this.show(html); } },
  methods: {
    show(html) {
      const open = new Set([...this.$el.querySelectorAll("details[open]")].map((d) => d.dataset.name));
      const scrolled = this.$el.scrollLeft;
      this.$el.innerHTML = html || "";
      this.$el.querySelectorAll("details").forEach((d) => { d.open = open.has(d.dataset.name); });
      this.$el.scrollLeft = scrolled;
    },
  },
};
