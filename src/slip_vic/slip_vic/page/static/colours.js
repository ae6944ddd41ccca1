// Colours are those of the style sheet, so that light and dark are written once.

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

const runColour = (run) => colour(`run-${run.colour}`);

function startTheme(redraw) {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  let chosen = null;
  const apply = () => {
    root.dataset.theme = chosen ?? (system.matches ? "dark" : "light");
    redraw();
  };
  const toggle = () => {
    chosen = root.dataset.theme === "dark" ? "light" : "dark";
    apply();
  };
  system.addEventListener("change", apply);
  document.getElementById("theme").addEventListener("click", toggle);
  root.dataset.theme = system.matches ? "dark" : "light";
  return toggle;
}
