// The page: build everything from the model, then show one frame after the other.

const READOUTS = [["slip_mm", "slip", "mm"], ["slip_deg", "turned", "deg"], ["slip_speed", "slip speed", "mm/s"], ["error_mm", "tracking error", "mm"]];

function problem(text) {
  const place = document.getElementById("problem");
  place.textContent = text;
  place.hidden = false;
}

function seriesOf(model, name, run, arm) {
  const plot = model.plots.find((found) => found.name === name);
  return plot?.series.find((series) => series.run === run && series.arm === arm)?.values;
}

function runCard(model, run, number) {
  const card = document.createElement("article");
  card.className = "run";
  card.dataset.run = run.label;
  card.style.setProperty("--colour", `var(--run-${run.colour})`);
  card.innerHTML = `<h2><span class="label"></span><span class="mode"></span></h2><div class="views"><canvas class="arm" role="img"></canvas></div>`;
  card.querySelector(".label").textContent = run.label;
  const views = card.querySelector(".views"), readouts = [];
  views.dataset.arms = run.arms.length;
  run.arms.forEach((arm, k) => {
    const canvas = document.createElement("canvas");
    canvas.className = "grasp";
    canvas.setAttribute("role", "img");
    views.append(canvas);
    const list = document.createElement("dl");
    list.className = "readouts";
    for (const [name, label, unit] of READOUTS) {
      const values = seriesOf(model, name, number, k);
      if (!values) continue;
      const term = document.createElement("dt"), text = document.createElement("dd"), value = document.createElement("span"), small = document.createElement("small");
      term.textContent = run.arms.length > 1 ? `${label}, ${arm.name}` : label;
      small.textContent = ` ${unit}`;
      value.dataset.value = name;
      text.append(value, small);
      const pair = document.createElement("div");
      pair.append(term, text);
      list.append(pair);
      readouts.push({ values, value });
    }
    card.append(list);
  });
  document.getElementById("runs").append(card);
  const modeOf = (arm, k, frame) => {
    const modes = arm.modes.filter(([from]) => from <= model.time[frame] + 1e-6);
    const text = modes.length ? modes[modes.length - 1][1] : "";
    const coded = window.slipLive && seriesOf(model, "mode", number, k); // live a text may come after the number that it explains
    if (!coded || !Number.isFinite(coded[frame])) return text;
    const name = model.plots.find((plot) => plot.name === "mode").steps[Math.round(coded[frame])];
    return text.startsWith(name) ? text : name;
  };
  const modeAt = (frame) => {
    const texts = run.arms.map((arm, k) => modeOf(arm, k, frame));
    return new Set(texts).size === 1 ? texts[0] : run.arms.map((arm, k) => `${arm.name}: ${texts[k]}`).join("; ");
  };
  const joints = run.arms[0].joints.length;
  const say = (frame) => {
    let last = frame; // a run that is over shows what it ended with
    while (last > 0 && !Number.isFinite(run.arms[0].q[joints * last])) last--;
    for (const { values, value } of readouts) value.textContent = shown(values[last]);
    const over = last < frame - 1 ? ` (ended at ${model.time[last].toFixed(2)} s)` : "";
    card.querySelector(".mode").textContent = modeAt(frame) + over;
    const text = `${run.label} at ${model.time[frame].toFixed(2)} s: ` + [...card.querySelectorAll(".readouts > div")].map((pair) => `${pair.children[0].textContent} ${pair.children[1].textContent}`).join(", ");
    for (const canvas of views.children) canvas.setAttribute("aria-label", text);
  };
  return { arm: views.querySelector(".arm"), grasp: [...views.querySelectorAll(".grasp")], say };
}

function largest(model) { // slip speed of all runs, which the longest arrow stands for [m/s]
  let most = window.slipLive ? 0.05 : 0;
  for (const run of model.runs) {
    for (const arm of run.arms) {
      for (let i = 0; i < 6 * model.count; i += 6) {
        const speed = Math.hypot(arm.slip[i], arm.slip[i + 1], arm.slip[i + 2]);
        if (speed > most) most = speed;
      }
    }
  }
  return most;
}

function build(model) {
  const cards = model.runs.map((run, number) => runCard(model, run, number));
  const fastest = largest(model);
  let views = null, scenes = [], asked = false, frame = 0;
  const draw = () => {
    if (views?.renderer.busy) return void requestAnimationFrame(draw);
    asked = false;
    for (const scene of scenes) scene.show(frame);
    views?.draw();
    document.body.dataset.frame = frame;
  };
  const redraw = () => { if (!asked) { asked = true; requestAnimationFrame(draw); } };
  const show = (next) => {
    frame = next;
    for (const card of cards) card.say(frame);
    plots?.show(frame);
    redraw();
  };
  let plots = null;
  const player = new Player(model, show);
  const toggle = startTheme(() => {
    for (const scene of scenes) scene.paint();
    plots?.repaint();
    redraw();
  });
  try {
    scenes = model.runs.map((_, number) => new RunScene(model, number, fastest));
    views = new Views(scenes, cards, redraw);
    for (const scene of scenes) { scene.follow(0, model.count); scene.paint(); }
    views.fit();
  } catch (error) {
    views = null;
    scenes = [];
    problem(`No 3D pictures: ${error.message}. Plots and numbers are complete. (Is WebGL switched off?)`);
  }
  player.onReset = () => views?.reset();
  player.onTheme = toggle;
  player.limits();
  player.go(window.slipLive ? player.end : model.time[0]);
  draw();
  plots = new Plots(model, document.getElementById("plots"), (t) => { player.pause(); player.go(t); });
  plots.show(frame);
  new ResizeObserver(redraw).observe(document.getElementById("runs"));
  if (!window.slipLive && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.start();
  document.body.dataset.ready = performance.now().toFixed(0);
  return { player, plots, scenes, views, redraw };
}

async function main() {
  if (window.slipLive) {
    problem("Waiting for joint states and robot_description.");
    new Live();
    return;
  }
  const model = unpack(await inflate(document.getElementById("data").textContent));
  model.count = model.time.length;
  window.slipPage = build(model); // for the browser's console, and for tests
}

main().catch((error) => { console.error(error); problem(`This page cannot be shown: ${error.message}`); });
