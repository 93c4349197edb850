// A dialog that the browser opens by itself: what is typed from the next key on goes into its field.
const AGAIN_MS = 250;
// A page that was just loaded has no ear at the server either, until the two have shaken hands.
const away = () => document.body.classList.contains("lost") || !window.did_handshake;
// What waits for a server outlives the page, which is loaded anew where another server answers.
// A browser may refuse to store anything.
function draft(call, name, ...text) { try { return sessionStorage[`${call}Item`](`flea-draft-${name}`, ...text); } catch { return null; } }

export default {
  template: `
    <dialog class="flea question" :data-name="name" :aria-label="words" @close="closed" @keydown="keyed">
      <form method="dialog" @submit.prevent="save">
        <h2>{{ words }}</h2>
        <p v-if="about" class="soft">{{ about }}</p>
        <label v-if="choices.length"><span>{{ chosen }}</span>
          <select ref="choice"><option v-for="c in choices" :key="c[0]" :value="c[0]">{{ c[1] }}</option></select></label>
        <label><span>{{ field }}</span>
          <textarea ref="field" rows="3" :placeholder="example" maxlength="2000"></textarea></label>
        <p ref="trouble" class="trouble" role="alert"></p>
        <div class="actions">
          <button type="submit" class="primary">{{ save_label }}<kbd aria-hidden="true">Enter</kbd></button>
          <slot></slot>
          <button type="button" @click="$el.close()">{{ cancel_label }}<kbd aria-hidden="true">Esc</kbd></button>
        </div>
      </form>
    </dialog>`,
  props: {
    name: String, words: String, field: String, example: String, preset: String, chosen: String,
    choices: { type: Array, default: () => [] }, save_label: String, cancel_label: String,
    empty_label: String, lost_label: String, about: String,
  },
  emits: ["opened", "said"],
  mounted() {
    this.$el.fleaOpen = (alarm) => this.open(alarm);
    const [alarm, text, choice] = JSON.parse(draft("get", this.name) || "[]");
    if (!text) return;
    this.open(alarm);
    this.$refs.field.value = text;
    if (this.$refs.choice) this.$refs.choice.value = choice;
    this.waiting = setTimeout(() => this.save(), AGAIN_MS);
  },
  methods: {
    open(alarm) {
      if (this.$el.open) return;
      this.alarm = alarm || "";
      this.$refs.field.value = this.preset || "";
      this.$refs.trouble.textContent = "";
      this.$el.showModal();
      this.$refs.field.focus();
      this.$refs.field.select();  // what is typed replaces what stands there
      this.$emit("opened", this.alarm);
    },
    keyed(event) {
      if (!this.$el.open) return;  // the focus has not left it yet, but the key is the page's
      event.stopPropagation();
      if (event.key === "Enter" && !event.shiftKey && !event.isComposing && event.target === this.$refs.field) { event.preventDefault(); this.save(); }
    },
    // Without a server the text waits in the open dialog, and is sent as soon as there is one.
    save() {
      clearTimeout(this.waiting);
      const text = this.$refs.field.value.trim();
      const lost = away();
      this.$refs.trouble.textContent = !text ? this.empty_label : lost ? this.lost_label : "";
      if (!text) return;
      const choice = this.$refs.choice ? this.$refs.choice.value : "";
      if (lost) {
        draft("set", this.name, JSON.stringify([this.alarm, text, choice]));
        this.waiting = setTimeout(() => this.save(), AGAIN_MS);
        return;
      }
      this.$emit("said", { alarm: this.alarm, text, choice });
      this.$el.close();
    },
    closed() { clearTimeout(this.waiting); draft("remove", this.name); this.$refs.field.value = ""; },
  },
};
