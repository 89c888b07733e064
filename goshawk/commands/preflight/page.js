"use strict";
// The worst flights on a scrubber: one moment in all pictures. Without a script the page shows the worst one.
(() => {
  const flights = JSON.parse(document.getElementById("flights").textContent);
  const slider = document.getElementById("moment");
  const play = document.getElementById("play");
  const choices = [...document.querySelectorAll("[data-choose]")];
  const views = ["above", "side", "clearance"].map((id) => document.getElementById(id));
  let chosen = 0;
  let timer = 0;

  const pixel = (view, x, y) => [
    Number(view.dataset.x0) + Number(view.dataset.sx) * x,
    Number(view.dataset.y0) + Number(view.dataset.sy) * y,
  ];
  const set = (element, values) => {
    for (const [name, value] of Object.entries(values)) element.setAttribute(name, value);
  };
  const text = (value, digits) => (value === null ? "–" : value.toFixed(digits).replace("-", "−"));

  function put(view, x, y, radius) {
    const [a, b] = pixel(view, x, y);
    set(view.querySelector(".vehicle"), { cx: a, cy: b, r: Math.max(4, radius * Math.abs(Number(view.dataset.sx))) });
    const cursor = view.querySelector(".cursor");
    if (cursor) set(cursor, { x1: a, x2: a, y1: 10, y2: view.viewBox.baseVal.height - 40 });
    return [a, b];
  }

  function show() {
    const flight = flights.tracks[chosen];
    const i = Number(slider.value);
    const [a, b] = put(views[0], flight.x[i], flight.y[i], flights.radius_m);
    put(views[1], flight.p[i], flight.z[i], 0);
    put(views[2], flight.p[i], Math.min(flight.c[i] ?? 2, 2), 0);
    const to = views[0].querySelector(".to");
    const near = flight.obstacle && i === flight.closest;
    const [c, d] = near ? pixel(views[0], flight.obstacle[0], flight.obstacle[1]) : [a, b];
    set(to, { x1: a, y1: b, x2: c, y2: d });
    const values = {
      time: text(flight.t[i], 2), path: text(flight.p[i], 2), clear: text(flight.c[i], 3), error: text(flight.e[i], 2),
      speed: text(speed(flight, i), 1), height: text(flight.z[i], 2),
    };
    for (const [name, value] of Object.entries(values)) document.getElementById(`v-${name}`).textContent = value;
    document.getElementById("v-clear").parentElement.classList.toggle("bad", (flight.c[i] ?? 1) < 0);
    slider.setAttribute("aria-valuetext", `${values.time} s, clearance ${values.clear} m`);
  }

  function speed(flight, i) {
    const j = Math.max(0, i - 1);
    const k = Math.min(flight.t.length - 1, i + 1);
    const way = Math.hypot(flight.x[k] - flight.x[j], flight.y[k] - flight.y[j], flight.z[k] - flight.z[j]);
    return way / Math.max(flight.t[k] - flight.t[j], 1e-6);
  }

  function choose(number) {
    chosen = number;
    const flight = flights.tracks[number];
    slider.max = flight.t.length - 1;
    slider.value = flight.closest;
    document.querySelectorAll("[data-flight]").forEach((e) => {
      e.classList.toggle("on", Number(e.dataset.flight) === number);
    });
    choices.forEach((button) => button.setAttribute("aria-pressed", String(Number(button.dataset.choose) === number)));
    document.getElementById("story").textContent = flight.story;
    show();
  }

  function stop() {
    clearInterval(timer);
    timer = 0;
    play.textContent = "Play";
  }

  function start() {
    if (Number(slider.value) >= Number(slider.max)) slider.value = 0;
    const flight = flights.tracks[chosen];
    const from_s = flight.t[Number(slider.value)];
    const began = performance.now();
    play.textContent = "Pause";
    timer = setInterval(() => {
      const at_s = from_s + (performance.now() - began) / 1000;
      const next = flight.t.findIndex((t) => t >= at_s);
      slider.value = next < 0 ? slider.max : next;
      show();
      if (next < 0) stop();
    }, 33);
  }

  slider.addEventListener("input", () => { stop(); show(); });
  play.addEventListener("click", () => (timer ? stop() : start()));
  choices.forEach((button) => button.addEventListener("click", () => { stop(); choose(Number(button.dataset.choose)); }));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const number = Number(event.key) - 1;
    if (number >= 0 && number < flights.tracks.length) { stop(); choose(number); }
    if (event.key === " " && event.target.tagName !== "BUTTON") { event.preventDefault(); if (timer) stop(); else start(); }
    if (event.target === slider || !["ArrowLeft", "ArrowRight"].includes(event.key)) return;
    stop();
    slider.value = Number(slider.value) + (event.key === "ArrowLeft" ? -1 : 1);
    show();
  });
  views.slice(1).forEach((view) => view.addEventListener("click", (event) => {
    const box = view.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * view.viewBox.baseVal.width;
    const path = (x - Number(view.dataset.x0)) / Number(view.dataset.sx);
    const times = flights.tracks[chosen].p.map((p) => Math.abs(p - path));
    stop();
    slider.value = times.indexOf(Math.min(...times));
    show();
  }));
  document.body.classList.add("live");
  choose(0);
})();
