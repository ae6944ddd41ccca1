// `slip-vic watch`: the server sends the same model with room for one frame, then frames; see live.py.

const KEPT = 3000; // frames; when they are full the older half is dropped
const PLOTS_MS = 200;

class Live {
  constructor() {
    document.body.classList.add("live");
    this.since = 0;
    this.connect();
  }

  connect() {
    const socket = new WebSocket(`ws://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (this.over) return; // the page is on its way out
      if (data === "model") {
        this.over = this.page !== undefined;
        if (this.over) location.reload(); // another run: start again
      } else if (typeof data === "string") this.status(JSON.parse(data));
      else if (this.page) this.frame(new Float32Array(data));
      else this.begin(unpack(data));
    };
    socket.onclose = () => {
      if (this.over) return;
      this.over = true;
      problem("The connection is lost; trying again.");
      setInterval(() => fetch("/").then(() => location.reload(), () => {}), 1000);
    };
  }

  begin(model) {
    this.model = model;
    this.arrays = [];
    const roomy = (owner, key) => {
      const width = owner[key].length, values = new Float32Array(KEPT * width).fill(NaN);
      values.set(owner[key]);
      owner[key] = values;
      this.arrays.push([values, width]);
    };
    roomy(model, "time");
    for (const run of model.runs) {
      for (const arm of run.arms) { roomy(arm, "q"); roomy(arm, "slip"); }
      if (run.object) roomy(run.object, "pose");
    }
    for (const plot of model.plots) for (const series of plot.series) roomy(series, "values");
    model.count = 1;
    this.page = build(model);
    window.slipPage = this.page;
    document.getElementById("problem").hidden = true;
  }

  // What no number says: {arm, mode: text} or {ended: why nothing arrives, "" where something does}.
  status({ arm, mode, ended }) {
    if (!this.page) return;
    if (mode !== undefined) {
      this.model.runs[0].arms[arm].modes.push([this.page.player.end, mode]);
      this.page.player.go(this.page.player.t);
    }
    if (ended !== undefined) {
      document.body.classList.toggle("ended", ended !== "");
      if (ended) problem(ended);
      else document.getElementById("problem").hidden = true;
    }
  }

  frame(numbers) {
    const { model, page } = this, { player, scenes } = page;
    const again = numbers[0] < player.end; // a bag that is looped, a run that restarts
    const atEnd = again || player.t >= player.end - 1e-6;
    if (again) this.drop(model.count);
    else if (model.count === KEPT) this.drop(KEPT / 2);
    let at = 0;
    for (const [values, width] of this.arrays) {
      values.set(numbers.subarray(at, at + width), model.count * width);
      at += width;
    }
    model.count++;
    for (const scene of scenes) scene.follow(model.count - 1, model.count);
    if (again) player.pause();
    const now = performance.now();
    if (again || now - this.since > PLOTS_MS) {
      this.since = now;
      page.plots.refresh();
      page.views?.fit(page.views.moved);
    }
    player.limits();
    if (atEnd && !player.playing) player.go(player.end);
    else player.slider.value = player.t;
  }

  drop(frames) {
    const { model, page } = this;
    for (const [values, width] of this.arrays) values.copyWithin(0, frames * width);
    model.count -= frames;
    if (!model.count) for (const run of model.runs) for (const arm of run.arms) arm.modes = arm.modes.slice(-1).map(([, text]) => [0, text]);
    for (const scene of page.scenes) {
      for (const own of scene.arms) {
        own.walked.cut(frames);
        own.trace.cut(frames);
        own.known &&= model.count > 0;
      }
    }
  }
}
