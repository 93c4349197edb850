// Strip charts on uPlot: the range of each stretch as a band, the estimate with its own band, limits
// dashed, detections and marks as lines across. All charts share one view, one cursor and one clock.
import uPlot from "uplot";

const FINE_S = 60, KEPT_S = 600, DRAW_MS = 300, MANY = 20, MANY_TURNS = 4, BEHIND_S = 0.6, LATELY_MS = 60000;
// In view, the same for all charts: a span that follows the clock, or a stretch that is held.
const flea = { seconds: 30, held: null, blocks: new Set() };
const utc = (s) => uPlot.tzDate(new Date(s * 1000), "Etc/UTC");

// Columns of one kind: fine ones of the last minute, and before them one row a second.
class Store {
  constructor(columns, stretch, kinds) {
    Object.assign(this, { stretch, kinds, fine: table(columns), past: table(columns), last: -1 });
    this.many = Math.round(1 / stretch);
  }
  put(rows) {
    for (const [number, row] of rows) {
      this.last = number;
      append(this.fine, number * this.stretch, row);
    }
    while (this.fine.x.length > FINE_S / this.stretch + this.many) this.coarsen();
  }
  before(rows) { for (const [second, row] of rows) append(this.past, second, row); }
  // What is older than a minute is kept as the range of each second.
  coarsen() {
    const count = this.many, row = this.fine.c.map((column, k) => {
      const values = column.splice(0, count).filter((v) => v !== null);
      if (!values.length) return null;
      return this.kinds[k] === "low" ? Math.min(...values) : this.kinds[k] === "high" ? Math.max(...values) : values[values.length - 1];
    });
    append(this.past, Math.floor(this.fine.x.splice(0, count)[0]), row);
    if (this.past.x.length > KEPT_S) { this.past.x.shift(); this.past.c.forEach((column) => column.shift()); }
  }
  // Times and these columns, from the first moment that the view needs.
  view(from, places) {
    const { fine, past } = this;
    if (!past.x.length || from >= fine.x[0]) return [fine.x, ...places.map((k) => fine.c[k])];
    return [past.x.concat(fine.x), ...places.map((k) => past.c[k].concat(fine.c[k]))];
  }
}
const table = (columns) => ({ x: [], c: Array.from({ length: columns }, () => []) });
function append(to, time, row) {
  if (to.x.length && time <= to.x[to.x.length - 1]) return;
  to.x.push(time);
  to.c.forEach((column, k) => column.push(row[k] ?? null));
}

class Chart {
  constructor(about, store, host, block) {
    Object.assign(this, about, { store, block, seen: false, passed: -Infinity });
    this.root = document.createElement("div");
    this.root.className = "strip";
    this.root.innerHTML = "<header><b></b><output></output></header><div class='plot' role='img'></div>";
    this.root.querySelector("b").textContent = this.root.querySelector("b").title = about.name;
    this.output = this.root.querySelector("output");
    this.place = this.root.querySelector(".plot");
    this.place.setAttribute("aria-label", block.words.of.replace("{name}", about.name));
    this.places = [this.low, this.high, this.estimate, this.sigma, this.limit].filter((k) => k !== undefined);
    host.append(this.root);
  }
  // Low, high, then estimate with its band, or the limits to both sides.
  data(from) {
    const [x, low, high, ...rest] = this.store.view(from, this.places);
    if (this.estimate !== undefined) {
      const [e, s] = rest, side = (sign) => e.map((v, k) => (v === null || s[k] === null ? null : v + 2 * sign * s[k]));
      return [x, low, high, e, side(-1), side(1)];
    }
    if (this.limit !== undefined) return [x, low, high, rest[0], rest[0].map((v) => (v === null ? null : -v))];
    return [x, low, high];
  }
  plot(colours, width) {
    const line = (stroke, more) => ({ stroke, width: 1.3, points: { show: false }, ...more });
    const thin = { width: 1, dash: [5, 4] }, hidden = { width: 0 };
    const series = [{}, line(colours.trace), line(colours.trace)], bands = [{ series: [2, 1], fill: colours.trace }];
    if (this.estimate !== undefined) {
      series.push(line(colours.estimate), line(colours.estimate, hidden), line(colours.estimate, hidden));
      bands.push({ series: [5, 4], fill: `${colours.estimate}44` });
    } else if (this.limit !== undefined) {
      series.push(line(colours.limit, thin), line(colours.limit, thin));
      bands.push({ series: [3, 4], fill: `${colours.ok}14` });
    }
    const axis = { stroke: colours.soft, font: "10px system-ui, sans-serif", grid: { stroke: colours.line, width: 1 }, ticks: { show: false } };
    this.u = new uPlot({
      width, height: 104, legend: { show: false }, tzDate: utc, series, bands,
      scales: { x: { time: true, auto: false }, y: { range: (_, lo, hi) => room(lo, hi) } },
      axes: [{ ...axis, size: 20, space: 90, values: [[1, "{HH}:{mm}:{ss}", null, null, null, null, null, null, 1]] }, { ...axis, size: 44, space: 30, values: (_, vs) => vs.map(short) }],
      cursor: { y: false, points: { show: false }, sync: { key: "flea" }, drag: { setScale: false, x: true } },
      hooks: { setSelect: [(u) => this.zoom(u)], setCursor: [() => this.tell()], draw: [(u) => this.across(u, colours)] },
    }, [[], ...series.slice(1).map(() => [])], this.place);
    this.u.over.addEventListener("dblclick", () => hold(null));
  }
  zoom(u) {
    if (u.select.width < 4) return;
    hold([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")]);
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  }
  // Detections and marks, told apart by line, symbol and colour.
  across(u, colours) {
    const { ctx, bbox } = u, ratio = devicePixelRatio || 1;
    for (const mark of this.block.marks) {
      const x = u.valToPos(mark.at, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      const detected = mark.kind === "detected";
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = detected ? colours.ink : colours.mark;
      ctx.lineWidth = (detected ? 2 : 1) * ratio;
      ctx.setLineDash(detected ? [] : [2 * ratio, 3 * ratio]);
      ctx.beginPath(); ctx.moveTo(x, bbox.top); ctx.lineTo(x, bbox.top + bbox.height); ctx.stroke();
      ctx.font = `${11 * ratio}px system-ui, sans-serif`;
      ctx.textAlign = "center";
      ctx.fillText(detected ? "▼" : "◆", x, bbox.top + 9 * ratio);
      ctx.restore();
    }
  }
  draw(view, colours, width) {
    if (!this.u || this.colours !== colours) { this.u?.destroy(); this.colours = colours; this.plot(colours, width); }
    if (this.u.width !== width) this.u.setSize({ width, height: 104 });
    this.u.setData(this.data(view[0]), false);
    this.u.setScale("x", { min: view[0], max: view[1] });
    this.tell();
  }
  // The values under the cursor, which is that of all charts; the latest ones without it.
  tell() {
    const { fine } = this.store, { data, cursor } = this.u ?? { data: [[]], cursor: {} };
    const under = cursor.idx ?? null, x = under === null ? fine.x : data[0], k = under ?? fine.x.length - 1;
    const of = (place, n) => (under === null ? fine.c[place] : data[n])?.[k] ?? NaN;
    const low = of(this.low, 1), high = of(this.high, 2), limit = this.limit === undefined ? NaN : of(this.limit, 3);
    const value = Math.abs(low) > Math.abs(high) ? low : high, over = Math.abs(value) > limit;
    const shown = this.unit === "σ" ? Number(value.toFixed(2)) + 0 : short(value);
    const when = under === null || x[k] === undefined ? "" : `${new Date(x[k] * 1000).toISOString().slice(11, 21)} `;
    const words = when + (value === value ? `${over ? "▲ " : ""}${shown} ${this.unit}` : this.block.words.none) + (limit === limit ? ` / ${this.block.words.limit} ${short(limit)}` : "");
    if (this.output.textContent !== words) { this.output.textContent = words; this.root.classList.toggle("over", over); }
  }
  // A chart that has lately passed its limit comes first, also one that was not in view.
  note(now) {
    if (this.limit === undefined) return;
    const { fine } = this.store, k = fine.x.length - 1;
    if (Math.max(fine.c[this.high][k], -fine.c[this.low][k]) > fine.c[this.limit][k]) this.passed = now;
    this.root.classList.toggle("noted", now - this.passed < LATELY_MS);
  }
}

function room(lo, hi) {
  if (lo === null || !(lo <= hi)) return [-1, 1];
  const by = 0.08 * (hi - lo) || Math.abs(hi) * 0.05 || 1;
  return [lo - by, hi + by];
}
function short(v) {
  const size = Math.abs(v);
  return size === 0 ? "0" : size >= 1e4 || size < 1e-3 ? v.toExponential(1) : String(Number(v.toPrecision(3)));
}
function hold(view) {
  flea.held = view;
  document.querySelectorAll("[data-strip=pause]").forEach((b) => b.setAttribute("aria-pressed", String(!!view)));
  flea.blocks.forEach((block) => block.paint(true));
}
function save(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${name}_${new Date().toISOString().slice(0, 19).replace(/[-:]/g, "")}Z`;
  link.download += blob.type === "image/png" ? ".png" : ".csv";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// What the buttons above the charts do; each block exports its own charts.
const ACTIONS = {
  pause: (block) => hold(flea.held ? null : block.now()),
  onset: (block) => {
    const at = block.marks.filter((m) => m.kind === "detected").map((m) => m.at).sort((a, b) => a - b).pop();
    if (at !== undefined) hold([at - 0.4 * flea.seconds, at + 0.6 * flea.seconds]);
  },
  all: (block, button) => button.setAttribute("aria-pressed", String(block.$el.classList.toggle("all"))),
  png: (block) => block.picture().toBlob((blob) => save("strips", blob)),
  csv: (block) => save("strips", new Blob([block.values()], { type: "text/csv" })),
};
document.addEventListener("click", (event) => {
  const button = event.target.closest("[data-strip], [data-span]");
  const element = button?.closest("section")?.querySelector(".strips"), block = [...flea.blocks].find((b) => b.$el === element);
  if (!block) return;
  if (button.dataset.strip) { ACTIONS[button.dataset.strip](block, button); return; }
  flea.seconds = Number(button.dataset.span);
  for (const other of document.querySelectorAll("[data-span]")) other.setAttribute("aria-pressed", String(other === button));
  hold(null);
});

export default {
  template: "<div class='strips'></div>",
  mounted() {
    Object.assign(this, { charts: [], store: null, marks: [], offset: null, theme: "", turn: 0 });
    flea.blocks.add(this);
    this.watch = new IntersectionObserver((entries) => entries.forEach((e) => { const c = this.charts.find((one) => one.root === e.target); if (c) c.seen = e.isIntersecting; }), { rootMargin: "80px" });
    this.timer = setInterval(() => this.paint(), DRAW_MS);
  },
  unmounted() { clearInterval(this.timer); this.watch.disconnect(); flea.blocks.delete(this); this.charts.forEach((c) => c.u?.destroy()); },
  methods: {
    // Charts of these columns with what was before; what was drawn until now is another run's.
    describe(charts, columns, stretch, past, words) {
      this.words = words;
      this.watch.disconnect();
      this.charts.forEach((chart) => chart.u?.destroy());
      this.$el.replaceChildren();
      const kinds = Array(columns).fill("last");
      charts.forEach((chart) => { kinds[chart.low] = "low"; kinds[chart.high] = "high"; });
      this.store = new Store(columns, stretch, kinds);
      this.store.before(past);
      this.offset = null;
      this.charts = charts.map((about) => new Chart(about, this.store, this.$el, this));
      this.charts.forEach((chart) => this.watch.observe(chart.root));
    },
    // Rows are [stretch, values]; marks are moments in seconds.
    push(rows, marks) {
      if (marks) this.marks = marks;
      if (!rows.length || !this.store) return;
      this.store.put(rows);
      this.charts.forEach((chart) => chart.note(performance.now()));
      const offset = this.store.last * this.store.stretch - performance.now() / 1000;
      this.offset = this.offset === null || Math.abs(offset - this.offset) > 1 ? offset : this.offset + 0.05 * (offset - this.offset);
    },
    now() {
      const head = Math.min(this.offset + performance.now() / 1000 - BEHIND_S, this.store.last * this.store.stretch);
      return [head - flea.seconds, head];
    },
    paint(anyhow) {
      if (!this.store?.fine.x.length || document.hidden || (flea.held && !anyhow && this.theme === themed())) return;
      if (this.theme !== themed()) { this.theme = themed(); this.colours = colours(); }
      const view = flea.held ?? this.now(), seen = this.charts.filter((chart) => chart.seen);
      // Many at a time are drawn less often: together they stay below a seventh of a core.
      if (!anyhow && seen.length > MANY && ++this.turn % MANY_TURNS) return;
      // One width for all: asking each between two drawings would lay out the page for each.
      const width = seen.length ? seen[0].place.clientWidth : 0;
      if (width) for (const chart of seen) chart.draw(view, this.colours, width);
      if (seen.length) this.$el.frames = (this.$el.frames || 0) + 1;  // for those who measure
    },
    shown() { return this.charts.filter((chart) => chart.root.offsetParent); },
    // The charts in view, one below the other, with their names.
    picture() {
      const drawn = this.shown().filter((chart) => chart.u), canvas = document.createElement("canvas"), step = 20;
      const sizes = drawn.map((chart) => chart.u.ctx.canvas);
      canvas.width = Math.max(300, ...sizes.map((c) => c.width));
      canvas.height = sizes.reduce((sum, c) => sum + c.height + step, step);
      const c = canvas.getContext("2d"), colour = this.colours;
      c.fillStyle = colour.panel; c.fillRect(0, 0, canvas.width, canvas.height);
      c.fillStyle = colour.ink; c.font = "13px system-ui, sans-serif";
      let y = step;
      drawn.forEach((chart, k) => { c.fillText(`${chart.name}  ${chart.output.textContent}`, 6, y - 4); c.drawImage(sizes[k], 0, y); y += sizes[k].height + step; });
      return canvas;
    },
    // Times in UTC, and the range of each chart in view.
    values() {
      const charts = this.shown(), view = flea.held ?? this.now();
      const [x, ...columns] = this.store.view(view[0], charts.flatMap((chart) => [chart.low, chart.high]));
      const head = charts.flatMap((chart) => [`${chart.name} low (${chart.unit})`, `${chart.name} high (${chart.unit})`]);
      const rows = x.map((t, k) => [new Date(t * 1000).toISOString(), ...columns.map((column) => column[k] ?? "")]);
      const inside = rows.filter((_, k) => x[k] >= view[0] && x[k] <= view[1]);
      return [["time (UTC)", ...head], ...inside].map((row) => row.join(",")).join("\n") + "\n";
    },
  },
};

const themed = () => String(document.body.classList.contains("body--dark"));
function colours() {
  const style = getComputedStyle(document.body);
  const names = ["trace", "estimate", "limit", "line", "soft", "mark", "wash", "ink", "panel", "ok"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}
