// Hides the alarms of the list below that are not asked for, now and whenever it is drawn anew.
const PLACE = /\{(\w+)\}/g, SURE_MS = 5000;
const said = (words, values) => words.replace(PLACE, (_, name) => values[name]);

export default {
  template: `
    <div class="filter" role="search">
      <label><span>{{ words.show }}</span>
        <select ref="kind" data-key="f" @change="apply"><option v-for="f in filters" :key="f[0]" :value="f[0]">{{ f[1] }}</option></select></label>
      <label><span>{{ words.with }}</span><input ref="text" type="search" maxlength="100" autocomplete="off" @input="apply"></label>
      <span class="soft" ref="count"></span>
      <button type="button" ref="all" @click="acknowledge">{{ words.all }}</button>
    </div>`,
  props: { filters: Array, words: Object },
  mounted() {
    this.list = this.$el.parentElement.querySelector(".body");
    this.watch = new MutationObserver(() => this.apply());
    this.watch.observe(this.list, { childList: true });
    this.apply();
  },
  unmounted() { this.watch.disconnect(); clearTimeout(this.timer); },
  methods: {
    rows() { return [...this.list.querySelectorAll("[data-is]")].map((mark) => [mark.closest("tr"), mark.dataset.is.split(" ")]); },
    apply() {
      const kind = this.$refs.kind.value || "every", text = this.$refs.text.value.trim().toLowerCase(), rows = this.rows();
      for (const [row, is] of rows) row.hidden = !is.includes(kind) || !row.textContent.toLowerCase().includes(text);
      const shown = rows.filter(([row]) => !row.hidden).length, filtered = shown < rows.length;
      this.$refs.count.textContent = filtered ? said(this.words.count, { shown, count: rows.length }) : "";
      this.$el.hidden = !rows.length;
      this.$refs.all.hidden = this.due().length < 2;
      this.calm();
    },
    // Buttons of the alarms in view that nobody has acknowledged.
    due() { return [...this.list.querySelectorAll("tr:not([hidden]) [data-act=ack]")]; },
    // A second click acknowledges: one slip of the finger must not silence a whole list.
    acknowledge() {
      const due = this.due();
      if (!this.sure) {
        this.sure = true;
        this.$refs.all.textContent = said(this.words.sure, { count: due.length });
        this.timer = setTimeout(() => this.calm(), SURE_MS);
        return;
      }
      this.list.dispatchEvent(new CustomEvent("flea-act", { detail: `acks ${due.map((b) => b.dataset.alarm).join("\n")}` }));
      this.calm();
    },
    calm() {
      clearTimeout(this.timer);
      this.sure = false;
      this.$refs.all.textContent = this.words.all;
    },
  },
};
