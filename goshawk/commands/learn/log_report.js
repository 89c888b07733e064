// Draws the streams of a flight log: drag to zoom, wheel to zoom about the cursor, double click for all of it.
"use strict";
(() => {
  const page = JSON.parse(document.getElementById("data").textContent);
  const colours = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf"];
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const time = new Float64Array(bytes(page.time));
  const whole = [time[0], time[time.length - 1]];
  const left = 62, right = 8, bottom = 18;
  let view = whole.slice(), cursor = null, drag = null;

  const panels = page.panels.map((panel) => {
    const holder = document.createElement("section");
    holder.innerHTML = "<h3></h3><canvas></canvas>";
    const title = holder.querySelector("h3");
    title.append(panel.title + (panel.unit ? ", " + panel.unit : ""));
    const values = panel.streams.map((stream, i) => {
      const legend = document.createElement("span");
      legend.style.color = colours[i % colours.length];
      title.append(" ", legend);
      return { label: stream.label, sparse: stream.sparse, data: new Float32Array(bytes(stream.data)), legend };
    });
    document.getElementById("panels").append(holder);
    return { values, canvas: holder.querySelector("canvas") };
  });

  const xOf = (t, width) => left + ((t - view[0]) / (view[1] - view[0])) * (width - left - right);
  const tOf = (x, width) => view[0] + ((x - left) / (width - left - right)) * (view[1] - view[0]);

  function index(t) {  // of the last instant not after t
    let low = 0, high = time.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (time[middle] <= t) low = middle; else high = middle - 1;
    }
    return low;
  }

  function ticks(low, high, about) {
    const rough = (high - low) / about, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
    const found = [];
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) found.push(Math.abs(v) < step / 1e6 ? 0 : v);
    return found;
  }

  const short = (v) => String(Number(v.toPrecision(5)));

  function range(panel, first, last) {
    let low = Infinity, high = -Infinity;
    for (const { data } of panel.values)
      for (let i = first; i <= last; i++) {
        if (data[i] < low) low = data[i];
        if (data[i] > high) high = data[i];
      }
    if (low > high) return [0, 1];
    const room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 1;
    return [low - room, high + room];
  }

  function draw(panel) {
    const { canvas } = panel, scale = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * scale; canvas.height = height * scale;
    const c = canvas.getContext("2d");
    c.scale(scale, scale);
    c.font = "11px sans-serif";
    const first = Math.max(index(view[0]) - 1, 0), last = Math.min(index(view[1]) + 1, time.length - 1);
    const [low, high] = range(panel, first, last);
    const yOf = (v) => 4 + ((high - v) / (high - low)) * (height - bottom - 4);
    for (const mark of page.marks) {
      c.fillStyle = mark.level === "error" ? "rgba(214,39,40,.18)" : "rgba(255,165,0,.18)";
      for (const [a, b] of mark.spans) {
        const x = xOf(a, width), wide = Math.max(xOf(b, width) - x, 2);
        if (x + wide > left) c.fillRect(Math.max(x, left), 4, wide, height - bottom - 4);
      }
    }
    c.fillStyle = "#555"; c.strokeStyle = "#e4e4e4"; c.lineWidth = 1;
    for (const v of ticks(low, high, 5)) {
      c.beginPath(); c.moveTo(left, yOf(v)); c.lineTo(width - right, yOf(v)); c.stroke();
      c.textAlign = "right"; c.fillText(short(v), left - 5, yOf(v) + 4);
    }
    for (const t of ticks(view[0], view[1], width / 110)) {
      c.textAlign = "center"; c.fillText(short(t) + " s", xOf(t, width), height - 4);
    }
    c.save();
    c.beginPath(); c.rect(left, 0, width - left - right, height); c.clip();
    panel.values.forEach(({ data, sparse }, k) => {
      c.strokeStyle = colours[k % colours.length];
      c.beginPath();
      let pen = false;
      for (let i = first; i <= last; i++) {
        if (Number.isNaN(data[i])) { pen = pen && sparse; continue; }
        const x = xOf(time[i], width), y = yOf(data[i]);
        if (pen) c.lineTo(x, y); else { c.moveTo(x, y); c.lineTo(x + 0.5, y); }
        pen = true;
      }
      c.stroke();
    });
    if (drag) {
      c.fillStyle = "rgba(31,119,180,.15)";
      c.fillRect(xOf(drag[0], width), 0, xOf(drag[1], width) - xOf(drag[0], width), height);
    }
    if (cursor !== null) {
      c.strokeStyle = "#333"; c.beginPath();
      c.moveTo(xOf(cursor, width), 0); c.lineTo(xOf(cursor, width), height - bottom); c.stroke();
    }
    c.restore();
    const at = cursor === null ? -1 : index(cursor);
    for (const { label, data, legend } of panel.values)
      legend.textContent = label + (at < 0 ? "" : " " + (Number.isNaN(data[at]) ? "none" : short(data[at])));
  }

  function redraw() {
    panels.forEach(draw);
    document.getElementById("at").textContent = cursor === null ? "" : cursor.toFixed(3) + " s";
  }

  function zoom(a, b) {
    const least = (whole[1] - whole[0]) * 1e-5;
    view = b - a > least ? [Math.max(a, whole[0]), Math.min(b, whole[1])] : view;
    redraw();
  }

  for (const { canvas } of panels) {
    const timeAt = (event) => tOf(event.clientX - canvas.getBoundingClientRect().left, canvas.clientWidth);
    canvas.addEventListener("mousedown", (event) => { drag = [timeAt(event), timeAt(event)]; event.preventDefault(); });
    canvas.addEventListener("mousemove", (event) => { cursor = timeAt(event); if (drag) drag[1] = cursor; redraw(); });
    canvas.addEventListener("mouseleave", () => { cursor = null; redraw(); });
    canvas.addEventListener("dblclick", () => zoom(...whole));
    canvas.addEventListener("wheel", (event) => {
      const t = timeAt(event), factor = event.deltaY > 0 ? 1.25 : 0.8;
      zoom(t - (t - view[0]) * factor, t + (view[1] - t) * factor);
      event.preventDefault();
    }, { passive: false });
  }
  window.addEventListener("mouseup", () => {
    const done = drag;
    drag = null;
    if (done) zoom(Math.min(...done), Math.max(...done));
  });
  document.querySelectorAll("[data-span]").forEach((button) => button.addEventListener("click", () => {
    const [a, b] = button.dataset.span.split(",").map(Number), room = Math.max(b - a, 0.5);
    zoom(a - room, b + room);
  }));
  document.getElementById("all").addEventListener("click", () => zoom(...whole));
  window.addEventListener("resize", redraw);
  redraw();
})();
