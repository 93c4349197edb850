// Strip charts on canvas: the range of each stretch as a band, the estimate with its own band,
// limits as dashed lines. Between two deliveries of the server the picture goes on by itself.
const KEPT_S = 60, BEHIND_S = 0.25, FRAME_MS = 33, SCALE_EVERY = 5;
const flea = { seconds: 30 };  // in view, the same for all charts

class Chart {
  constructor(about, ring, host) {
    Object.assign(this, about, { ring, seen: true, range: null, aged: 0, passed: -Infinity });
    this.root = document.createElement("div");
    this.root.className = "strip";
    this.root.innerHTML = "<header><b></b><output></output></header><canvas role='img'></canvas>";
    this.root.querySelector("b").textContent = this.root.querySelector("b").title = about.name;
    this.output = this.root.querySelector("output");
    this.canvas = this.root.querySelector("canvas");
    this.context = this.canvas.getContext("2d");
    this.canvas.setAttribute("aria-label", `strip chart of ${about.name}`);
    host.append(this.root);
  }
  // Least and largest value in view, with room above and below; it shrinks slowly, grows at once.
  scale(first, last) {
    const { ring } = this;
    let lo = Infinity, hi = -Infinity;
    for (let k = first; k <= last; k++) {
      const a = ring.at(k, this.low), b = ring.at(k, this.high);
      if (a < lo) lo = a;
      if (b > hi) hi = b;
      if (this.estimate !== undefined) {
        const e = ring.at(k, this.estimate);
        if (e < lo) lo = e;
        if (e > hi) hi = e;
      }
    }
    if (this.limit !== undefined) {
      const limit = ring.at(last, this.limit);
      if (limit === limit) { lo = Math.min(lo, -limit); hi = Math.max(hi, limit); }
    }
    if (!(lo <= hi)) { this.range = this.range || [-1, 1]; return; }
    const room = 0.08 * (hi - lo) || Math.abs(hi) * 0.05 || 1;
    const want = [lo - room, hi + room], had = this.range;
    this.range = had ? [Math.min(want[0], had[0] + (want[0] - had[0]) * 0.2), Math.max(want[1], had[1] + (want[1] - had[1]) * 0.2)] : want;
  }
  draw(head, colours, marks) {
    const ratio = Math.min(devicePixelRatio || 1, 2), { canvas, ring } = this;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width) return;
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const span = flea.seconds / ring.stretch, first = Math.max(Math.floor(head - span), ring.first), last = Math.min(Math.ceil(head), ring.last);
    if (this.aged-- <= 0) { this.scale(first, last); this.aged = SCALE_EVERY; }
    const [lo, hi] = this.range, c = this.context;
    const x = (k) => width * (1 - (head - k) / span), y = (v) => height * (1 - (v - lo) / (hi - lo));
    c.clearRect(0, 0, width, height);
    c.lineWidth = ratio;
    if (lo < 0 && hi > 0) { c.fillStyle = colours.line; c.fillRect(0, Math.round(y(0)), width, ratio); }
    for (const mark of marks) {
      c.fillStyle = mark.kind === "detected" ? colours.limit : colours.mark;
      if (x(mark.at) < 0 || x(mark.at) > width) continue;
      c.fillRect(x(mark.at), 0, ratio, height);
      c.fillText(mark.kind === "detected" ? "▼" : "◆", x(mark.at) - 4 * ratio, 9 * ratio);
    }
    if (this.estimate !== undefined) this.band(c, x, y, first, last, colours.estimate);
    this.trace(c, x, y, first, last, colours.trace, ratio);
    if (this.estimate !== undefined) this.curve(c, x, y, first, last, this.estimate, 1, colours.estimate);
    if (this.limit !== undefined) for (const side of [1, -1]) this.curve(c, x, y, first, last, this.limit, side, colours.limit);
    c.font = `${10 * ratio}px system-ui, sans-serif`;
    for (const [value, at] of [[hi, 11 * ratio], [lo, height - 4 * ratio]]) {
      c.fillStyle = colours.wash;
      c.globalAlpha = 0.75;
      c.fillRect(2 * ratio, at - 9 * ratio, 7 * short(value).length * ratio, 11 * ratio);
      c.globalAlpha = 1;
      c.fillStyle = colours.soft;
      c.fillText(short(value), 4 * ratio, at);
    }
    this.tell(last);
  }
  trace(c, x, y, first, last, colour, ratio) {
    c.strokeStyle = colour; c.lineWidth = 1.3 * ratio; c.lineJoin = "bevel"; c.beginPath();
    let drawn = false;
    for (let k = first; k <= last; k++) {
      const a = this.ring.at(k, this.low), b = this.ring.at(k, this.high);
      if (a !== a) { drawn = false; continue; }
      const px = x(k), py = y(a);
      if (drawn) c.lineTo(px, py); else c.moveTo(px, py);
      if (b !== a) c.lineTo(px, y(b));
      drawn = true;
    }
    c.stroke(); c.lineWidth = ratio;
  }
  // A line that mostly stays where it is (a limit) has few corners, and few are drawn.
  curve(c, x, y, first, last, column, side, colour) {
    c.strokeStyle = colour; c.beginPath();
    let held = NaN;
    for (let k = first; k <= last; k++) {
      const v = this.ring.at(k, column);
      if (v === held && k < last) continue;
      if (held === held) c.lineTo(x(k - 1), y(side * held));
      if (v === v) { if (held === held) c.lineTo(x(k), y(side * v)); else c.moveTo(x(k), y(side * v)); }
      held = v;
    }
    c.stroke();
  }
  // Two standard deviations to either side of the estimate.
  band(c, x, y, first, last, colour) {
    const above = [], below = [];
    for (let k = first; k <= last; k++) {
      const e = this.ring.at(k, this.estimate), s = 2 * this.ring.at(k, this.sigma);
      if (s === s && e === e) { above.push([x(k), y(e + s)]); below.push([x(k), y(e - s)]); }
    }
    if (above.length < 2) return;
    c.globalAlpha = 0.3; c.fillStyle = colour; c.beginPath();
    for (const [px, py] of above) c.lineTo(px, py);
    for (const [px, py] of below.reverse()) c.lineTo(px, py);
    c.fill(); c.globalAlpha = 1;
  }
  tell(last) {
    const now = this.ring.at(last, this.high), limit = this.limit === undefined ? NaN : this.ring.at(last, this.limit);
    const value = Math.abs(this.ring.at(last, this.low)) > Math.abs(now) ? this.ring.at(last, this.low) : now;
    const over = limit === limit && Math.abs(value) > limit;
    const words = (value === value ? `${over ? "▲ " : ""}${this.unit === "σ" ? Number(value.toFixed(2)) + 0 : short(value)} ${this.unit}` : "no value") + (limit === limit ? ` / limit ${short(limit)}` : "");
    if (this.output.textContent !== words) { this.output.textContent = words; this.root.classList.toggle("over", over); }
  }
  // A chart that has lately passed its limit comes first, also one that was not in view.
  note(now) {
    if (this.limit === undefined) return;
    const { ring } = this, at = ring.at(ring.last, this.limit);
    if (Math.max(ring.at(ring.last, this.high), -ring.at(ring.last, this.low)) > at) this.passed = now;
    this.root.classList.toggle("noted", now - this.passed < KEPT_S * 1000);
  }
}

// One minute of rows; a row that was never delivered reads as NaN.
class Ring {
  constructor(columns, stretch) {
    this.columns = columns; this.stretch = stretch; this.first = 0; this.last = -1;
    this.kept = Math.round(KEPT_S / stretch);
    this.data = new Float64Array(columns * this.kept).fill(NaN);
  }
  put(stretch, row) {
    const from = this.last < 0 ? stretch : Math.max(this.last + 1, stretch - this.kept + 1);
    for (let k = from; k < stretch; k++) this.data.fill(NaN, this.place(k), this.place(k) + this.columns);
    for (let j = 0; j < this.columns; j++) this.data[this.place(stretch) + j] = row[j] ?? NaN;
    if (this.last < 0) this.first = stretch;
    this.last = stretch; this.first = Math.max(this.first, stretch - this.kept + 1);
  }
  place(stretch) { return (stretch % this.kept) * this.columns; }
  at(stretch, column) { return this.data[this.place(stretch) + column]; }
}

function short(v) {
  const size = Math.abs(v);
  return size === 0 ? "0" : size >= 1e4 || size < 1e-3 ? v.toExponential(1) : String(Number(v.toPrecision(3)));
}

document.addEventListener("click", (event) => {
  const all = event.target.closest("[data-all]");
  if (all) {
    const on = all.closest("section").querySelector(".strips").classList.toggle("all");
    all.setAttribute("aria-pressed", String(on));
  }
  const button = event.target.closest("[data-span]");
  if (!button) return;
  flea.seconds = Number(button.dataset.span);
  for (const other of button.parentElement.querySelectorAll("[data-span]")) other.setAttribute("aria-pressed", String(other === button));
});

export default {
  template: "<div class='strips'></div>",
  mounted() {
    this.charts = []; this.ring = null; this.marks = []; this.offset = null; this.drawn = 0; this.themed = -Infinity;
    this.watch = new IntersectionObserver((entries) => entries.forEach((e) => { this.charts.find((c) => c.root === e.target).seen = e.isIntersecting; }));
    const loop = (now) => { this.frame = requestAnimationFrame(loop); if (now - this.drawn >= FRAME_MS - 4) { this.drawn = now; this.paint(now); } };
    this.frame = requestAnimationFrame(loop);
  },
  unmounted() { cancelAnimationFrame(this.frame); this.watch.disconnect(); },
  methods: {
    // Charts of these columns; what was drawn before is another run's.
    describe(charts, columns, stretch) {
      this.watch.disconnect();
      this.$el.replaceChildren();
      this.ring = new Ring(columns, stretch); this.offset = null;
      this.charts = charts.map((about) => new Chart(about, this.ring, this.$el));
      this.charts.forEach((chart) => this.watch.observe(chart.root));
    },
    // Rows are [stretch, values]; marks are moments, counted in stretches, too.
    push(rows, marks) {
      for (const [stretch, row] of rows) this.ring.put(stretch, row);
      if (marks) this.marks = marks;
      if (!rows.length) return;
      this.charts.forEach((chart) => chart.note(performance.now()));
      const offset = this.ring.last - performance.now() / 1000 / this.ring.stretch;
      this.offset = this.offset === null || Math.abs(offset - this.offset) * this.ring.stretch > 1 ? offset : this.offset + 0.05 * (offset - this.offset);
    },
    paint(now) {
      if (!this.ring || this.ring.last < 0) return;
      if (now - this.themed > 500) { this.colours = themed(); this.themed = now; }
      const head = Math.min(this.offset + (now / 1000 - BEHIND_S) / this.ring.stretch, this.ring.last);
      const seen = this.charts.filter((chart) => chart.seen);
      for (const chart of seen) chart.draw(head, this.colours, this.marks);
      if (seen.length) this.$el.frames = (this.$el.frames || 0) + 1;  // for those who measure
    },
  },
};

function themed() {
  const style = getComputedStyle(document.body);
  const names = ["trace", "estimate", "limit", "line", "soft", "mark", "wash"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}
