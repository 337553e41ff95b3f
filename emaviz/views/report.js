"use strict";
// Draws each figure when it comes into sight, in the colours of light or dark, and all of them for print.
(() => {
  const { themes, figures } = JSON.parse(document.getElementById("figures").textContent);
  const places = [...document.querySelectorAll("[data-figure]")];
  const darkness = matchMedia("screen and (prefers-color-scheme: dark)");
  const config = { displaylogo: false, responsive: true, displayModeBar: "hover",
                   modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
  const drawn = new Set();
  const theme = () => (darkness.matches ? themes.dark : themes.light);

  function draw(place) {
    if (drawn.has(place)) return;
    drawn.add(place);
    const figure = figures[Number(place.dataset.figure)];
    Plotly.newPlot(place, figure.data, { ...figure.layout, template: theme() }, config);
  }

  const sight = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) { draw(entry.target); sight.unobserve(entry.target); }
  }, { rootMargin: "600px" });
  places.forEach((place) => sight.observe(place));
  darkness.addEventListener("change", () => drawn.forEach((place) => Plotly.relayout(place, { template: theme() })));

  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((part) => { part.open = true; });
    places.forEach(draw);
    drawn.forEach((place) => Plotly.Plots.resize(place));
  });
  addEventListener("afterprint", () => opened.forEach((part) => { part.open = false; }));
})();
