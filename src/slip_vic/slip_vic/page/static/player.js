// Time: play, speed, slider and keys.

class Player {
  constructor(model, show) {
    this.model = model;
    this.showFrame = show;
    this.playing = false;
    this.t = 0;
    for (const id of ["play", "slider", "clock", "speed"]) this[id] = document.getElementById(id);
    this.slider.addEventListener("input", () => { this.pause(); this.go(+this.slider.value); });
    this.play.addEventListener("click", () => this.toggle());
    document.addEventListener("keydown", (event) => this.key(event));
  }

  get end() { return this.model.time[this.model.count - 1]; }

  limits() {
    this.slider.min = this.model.time[0];
    this.slider.max = this.end;
  }

  go(t) {
    this.t = Math.min(this.end, Math.max(this.model.time[0], t));
    this.slider.value = this.t;
    const frame = this.frameAt(this.t);
    this.clock.textContent = `${this.model.time[frame].toFixed(3)} s`;
    this.slider.setAttribute("aria-valuetext", this.clock.textContent);
    this.showFrame(frame);
  }

  frameAt(t) {
    const { time, count } = this.model;
    let low = 0, high = count - 1;
    while (low < high) { const middle = (low + high + 1) >> 1; if (time[middle] <= t + 1e-6) low = middle; else high = middle - 1; }
    return low;
  }

  toggle() { if (this.playing) this.pause(); else this.start(); }

  start() {
    if (this.t >= this.end - 1e-6) this.t = this.model.time[0];
    this.playing = true;
    this.label();
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      this.go(this.t + (Math.min(0.25, (now - before) / 1000)) * +this.speed.value);
      before = now;
      if (this.t >= this.end) return this.pause();
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  pause() {
    this.playing = false;
    this.label();
  }

  label() {
    this.play.textContent = this.playing ? "❚❚" : "▶";
    this.play.setAttribute("aria-label", this.playing ? "pause" : "play");
  }

  faster(step) {
    const next = this.speed.selectedIndex + step;
    if (next >= 0 && next < this.speed.options.length) this.speed.selectedIndex = next;
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input:not([type=range]), summary")) return;
    const step = event.shiftKey ? 0.2 : 0.02;
    const move = (t) => { this.pause(); this.go(t); };
    const actions = {
      " ": () => this.toggle(),
      ArrowLeft: () => move(this.t - step),
      ArrowRight: () => move(this.t + step),
      Home: () => move(this.model.time[0]),
      End: () => move(this.end),
      "+": () => this.faster(1),
      "-": () => this.faster(-1),
      r: () => this.onReset(),
      t: () => this.onTheme(),
    };
    const action = actions[event.key];
    if (!action || (event.key === " " && event.target.matches("button"))) return;
    event.preventDefault();
    action();
  }
}
