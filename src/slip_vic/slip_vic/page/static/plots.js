// Linked plots: one axis of time, one pointer, one zoom; the line "now" is the slider's time.

const PLOT_HEIGHT = 190;

function shown(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  return size >= 1000 ? value.toFixed(0) : size >= 100 ? value.toFixed(1) : size < 5e-3 ? "0.00" : value.toFixed(2);
}

const GAP = 1; // s: between frames that are further apart nothing was watched, so no line is drawn

function unwatched(u, series, from, to, found) {
  if (!window.slipLive) return found;
  const time = u.data[0], holes = [...found];
  for (let i = from + 1; i <= to; i++) {
    if (time[i] - time[i - 1] > GAP) holes.push([u.valToPos(time[i - 1], "x", true), u.valToPos(time[i], "x", true)]);
  }
  return holes.sort((a, b) => a[0] - b[0]);
}

const gaps = (values, count) => Array.from(values.subarray(0, count), (value) => (Number.isFinite(value) ? value : null));

class Plots {
  constructor(model, place, go) {
    this.model = model;
    this.go = go;
    this.frame = 0;
    this.hover = null;
    this.all = model.plots.map((plot) => this.make(plot, place));
    new ResizeObserver(() => this.resize()).observe(place);
  }

  make(plot, place) {
    const card = document.createElement("div");
    card.className = "plot";
    card.dataset.plot = plot.name;
    card.innerHTML = `<h3><span></span><span class="unit"></span></h3><p class="note"></p><div class="values"></div><div class="chart" role="img"></div>`;
    card.querySelector("h3 span").textContent = plot.title;
    card.querySelector(".note").textContent = plot.note;
    card.querySelector(".note").hidden = !plot.note;
    place.append(card);
    const own = { plot, card, chart: card.querySelector(".chart") };
    this.build(own);
    return own;
  }

  build(own) {
    const { plot, card, chart } = own, model = this.model;
    card.querySelector(".unit").textContent = plot.unit ? `[${plot.unit}]` : "";
    const values = card.querySelector(".values");
    values.replaceChildren(...plot.series.map((series) => {
      const text = document.createElement("span");
      text.style.setProperty("--colour", `var(--run-${model.runs[series.run].colour})`);
      text.style.setProperty("--dash", series.arm ? "dashed" : "solid");
      text.append(nameOf(model, series), document.createElement("b"));
      return text;
    }));
    own.numbers = [...values.querySelectorAll("b")];
    const axis = { stroke: () => colour("soft"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { show: false }, font: "11px system-ui, sans-serif" };
    own.u = new uPlot({
      width: Math.max(200, chart.clientWidth), height: PLOT_HEIGHT,
      legend: { show: false },
      cursor: { sync: { key: "time", setSeries: false }, drag: { x: true, y: false, dist: 4 }, y: false, points: { size: 6 } },
      scales: { x: { time: false }, y: plot.steps.length ? { range: [-0.5, plot.steps.length - 0.5] } : { range: (u, low, high) => this.range(plot, low, high) } },
      axes: [
        { ...axis, size: 26, values: (u, ticks) => ticks.map((t) => `${+t.toFixed(3)} s`) },
        { ...axis, size: plot.steps.length ? 96 : 52, splits: plot.steps.length ? () => plot.steps.map((_, i) => i) : undefined, values: plot.steps.length ? () => plot.steps : (u, ticks) => ticks.map((t) => `${+t.toPrecision(4)}`) },
      ],
      series: [{}, ...plot.series.map((series) => ({ stroke: () => runColour(model.runs[series.run]), width: 1.8, gaps: unwatched, dash: series.arm ? [6, 4] : undefined, points: { show: false }, paths: plot.steps.length ? uPlot.paths.stepped({ align: 1 }) : undefined }))],
      hooks: {
        ready: [(u) => {
          const line = document.createElement("div");
          line.className = "now";
          u.over.append(line);
          let down = null;
          u.over.addEventListener("mousedown", (event) => { down = [event.clientX, event.clientY]; });
          u.over.addEventListener("click", (event) => {
            if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4) this.go(u.posToVal(u.cursor.left, "x"));
          });
          u.over.addEventListener("mouseleave", () => { this.hover = null; this.allValues(); });
        }],
        setCursor: [(u) => { if (u.cursor.event) { this.hover = u.cursor.idx ?? null; this.allValues(); } }],
        setScale: [(u, key) => { if (key === "x") this.zoom(u); }],
        draw: [(u) => this.mark(u, plot)],
      },
    }, this.dataOf(plot), chart);
    this.now(own);
  }

  dataOf(plot) {
    const { time, count } = this.model;
    return [Array.from(time.subarray(0, count)), ...plot.series.map((series) => gaps(series.values, count))];
  }

  range(plot, low, high) {
    if (plot.mark !== null && plot.mark !== undefined) high = Math.max(high, plot.mark);
    if (low === null || high === null || !Number.isFinite(low)) return [0, 1];
    if (low >= 0) return [0, high > 0 ? 1.06 * high : 1];
    const room = 0.06 * (high - low || 1);
    return [low - room, high + room];
  }

  mark(u, plot) {
    if (plot.mark === null || plot.mark === undefined) return;
    const y = u.valToPos(plot.mark, "y", true), pen = u.ctx;
    pen.save();
    pen.strokeStyle = colour("ink");
    pen.setLineDash([3, 3]);
    pen.beginPath();
    pen.moveTo(u.bbox.left, y);
    pen.lineTo(u.bbox.left + u.bbox.width, y);
    pen.stroke();
    pen.restore();
  }

  zoom(from) {
    if (this.zooming || !this.all) return;
    this.zooming = true;
    const { min, max } = from.scales.x;
    for (const { u } of this.all) if (u !== from && (u.scales.x.min !== min || u.scales.x.max !== max)) u.setScale("x", { min, max });
    this.zooming = false;
    for (const own of this.all) this.now(own);
  }

  now(own) {
    const line = own.u.over.querySelector(".now"), at = own.u.valToPos(this.model.time[this.frame], "x");
    if (!line) return;
    line.hidden = !(at >= 0 && at <= own.u.over.clientWidth);
    line.style.left = `${at}px`;
  }

  values(own) {
    const at = this.hover ?? this.frame, { plot } = own;
    plot.series.forEach((series, i) => {
      const value = series.values[at];
      const text = plot.steps.length && Number.isFinite(value) ? plot.steps[Math.round(value)] : shown(value);
      if (own.numbers[i].textContent !== text) own.numbers[i].textContent = text;
    });
  }

  allValues() { for (const own of this.all ?? []) this.values(own); }

  show(frame) {
    this.frame = frame;
    for (const own of this.all) this.now(own);
    this.allValues();
  }

  refresh() { for (const own of this.all) own.u.setData(this.dataOf(own.plot)); }

  repaint() { for (const own of this.all) own.u.redraw(false); }

  resize() {
    for (const own of this.all ?? []) {
      const width = Math.max(200, own.chart.clientWidth);
      if (Math.abs(width - own.u.width) > 1) own.u.setSize({ width, height: PLOT_HEIGHT });
      this.now(own);
    }
  }
}

function nameOf(model, series) {
  const run = model.runs[series.run];
  return run.arms.length > 1 ? `${run.label} ${run.arms[series.arm].name}` : run.label;
}
