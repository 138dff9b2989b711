"use strict";
// Draws the learning curves of a page from its data, and shows the target that is chosen.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const chart = document.getElementById("chart");
  const target = document.getElementById("target");
  const chosen = { across: "iteration", up: "return", hidden: new Set() };
  const DASHES = ["", "7 3", "2 3", "9 3 2 3"];
  const MARGIN = { right: 14, top: 14, bottom: 44 };

  const svg = (name, attributes = {}, text = "") => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text) node.textContent = text;
    return node;
  };
  const html = (name, text = "", properties = {}) =>
    Object.assign(document.createElement(name), { textContent: text }, properties);

  const colour = (node, run) => {
    node.classList.add("of-run");
    node.style.setProperty("--light", run.light);
    node.style.setProperty("--dark", run.dark);
    return node;
  };
  const swatch = (run) => {
    const picture = svg("svg", { width: 26, height: 10, class: "swatch", "aria-hidden": "true" });
    picture.append(svg("line", {
      x1: 0, x2: 26, y1: 5, y2: 5, stroke: "currentColor", "stroke-width": 3,
      "stroke-dasharray": DASHES[run.dash],
    }));
    return colour(picture, run);
  };

  // Round steps of 1, 2 or 5 times a power of ten.
  const ticks = (low, high, wanted, least = 0) => {
    const rough = Math.max((high - low) / wanted, least), power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((n) => n * power).find((size) => size >= rough * 0.999);
    const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const list = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) {
      list.push([i * step, (i * step).toFixed(places)]);
    }
    return list;
  };
  // The axis across: its unit grows with its numbers.
  const acrossAxis = (longest) => {
    if (chosen.across === "iteration") return [1, "iteration"];
    if (chosen.across === "env_steps") {
      if (longest >= 2e6) return [1e6, "environment steps [millions]"];
      return longest >= 2e4 ? [1e3, "environment steps [thousands]"] : [1, "environment steps"];
    }
    if (longest >= 7200) return [3600, "time [h]"];
    return longest >= 180 ? [60, "time [min]"] : [1, "time [s]"];
  };
  const short = (value) => (value === null ? "–" : String(Number(value.toPrecision(4))));

  const shown = () =>
    data.runs.filter((run, i) => !chosen.hidden.has(i) && run.up[chosen.up] !== undefined);

  // The chosen target, unless it lies so far away that the curves would be flat.
  const goalWithin = (low, high) => {
    if (chosen.up !== "return") return undefined;
    const goal = data.targets[Number(target.value)], span = high - low || 1;
    return goal > low - span && goal < high + span ? goal : undefined;
  };

  // What is drawn and where: the runs, the ends of both axes, and how numbers become places.
  const layout = () => {
    const width = Math.max(260, chart.clientWidth), height = Math.min(430, 190 + width * 0.36);
    const runs = shown(), known = (value) => value !== null;
    const xs = runs.flatMap((run) => run.across[chosen.across]).filter(known);
    const ys = runs.flatMap((run) => Object.values(run.up[chosen.up]).flat(2)).filter(known);
    if (!xs.length || !ys.length) return { width, height };
    const least = (values) => values.reduce((a, b) => Math.min(a, b));
    const most = (values) => values.reduce((a, b) => Math.max(a, b));
    const goal = goalWithin(least(ys), most(ys));
    if (goal !== undefined) ys.push(goal);
    const room = (most(ys) - least(ys)) * 0.04 || Math.abs(most(ys)) * 0.05 || 1;
    const low = least(ys) - room, high = most(ys) + room;
    const first = chosen.across === "iteration" ? least(xs) : 0, last = most(xs);
    const top = MARGIN.top, bottom = height - MARGIN.bottom, right = width - MARGIN.right;
    const rows = ticks(low, high, Math.max(3, (bottom - top) / 50));
    const left = 34 + 7.2 * most(rows.map(([, label]) => label.length));
    const px = (x) => left + (last > first ? (x - first) / (last - first) : 0.5) * (right - left);
    const py = (y) => bottom - ((y - low) / (high - low)) * (bottom - top);
    return { width, height, runs, goal, first, last, rows, left, right, top, bottom, px, py };
  };

  const axesOf = ({ height, first, last, rows, left, right, top, bottom, px, py }) => {
    const group = svg("g"), [unit, name] = acrossAxis(last);
    const line = (x1, x2, y1, y2, kind) => svg("line", { x1, x2, y1, y2, class: kind });
    const middle = { "text-anchor": "middle" };
    for (const [y, label] of rows) {
      group.append(line(left, right, py(y), py(y), "grid"));
      group.append(svg("text", { x: left - 6, y: py(y) + 4, "text-anchor": "end" }, label));
    }
    const least = chosen.across === "iteration" ? 1 : 0;
    const columns = last > first
      ? ticks(first / unit, last / unit, Math.max(3, (right - left) / 60), least)
      : [[first / unit, short(first / unit)]];
    for (const [x, label] of columns) {
      const at = px(x * unit);
      group.append(line(at, at, bottom, bottom + 4, "axis"));
      group.append(svg("text", { x: at, y: bottom + 17, ...middle }, label));
    }
    group.append(line(left, right, bottom, bottom, "axis"));
    group.append(svg("text", { x: (left + right) / 2, y: height - 6, ...middle }, name));
    const y = (top + bottom) / 2, turned = `rotate(-90 12 ${y})`;
    group.append(svg("text", { x: 12, y, transform: turned, ...middle }, data.axes[chosen.up]));
    return group;
  };

  const draw = () => {
    const place = layout(), { width, height, runs, goal, left, right, px, py } = place;
    const over = `${data.axes[chosen.up]} over ${data.acrosses[chosen.across]}`;
    const picture = svg("svg", {
      viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": over,
    });
    chart.replaceChildren(picture);
    if (!runs) {
      picture.append(svg("text", { x: 20, y: 30 }, "Nothing to draw: choose a run below."));
      return;
    }
    picture.append(axesOf(place));
    const curves = runs.map((run) => curveOf(run, px, py));
    for (const [behind] of curves) picture.append(behind);
    for (const [, front] of curves) picture.append(front);
    if (goal !== undefined) {
      const y = py(goal), text = `target ${short(goal)}`;
      picture.append(svg("line", { x1: left, x2: right, y1: y, y2: y, class: "target" }));
      picture.append(svg("text", { x: left + 4, y: y - 5, class: "on-line" }, text));
    }
    follow(picture, place);
  };

  const curveOf = (run, px, py) => {
    const behind = colour(svg("g"), run), front = colour(svg("g"), run);
    const x = run.across[chosen.across], y = run.up[chosen.up];
    const known = (values) =>
      x.map((at, i) => [at, values[i], i]).filter(([at, v]) => at !== null && v !== null);
    const path = (points) =>
      points.map(([at, v], i) => `${i ? "L" : "M"}${px(at).toFixed(1)} ${py(v).toFixed(1)}`).join("");
    const circle = ([at, v], kind, r) => svg("circle", { cx: px(at), cy: py(v), r, class: kind });
    const low = known(y.low), high = known(y.high), mean = known(y.mean);
    if (low.length > 1) {
      behind.append(svg("path", { d: `${path([...high, ...low.reverse()])}Z`, class: "band" }));
    }
    if (y.seeds.length > 1) {
      for (const seed of y.seeds) behind.append(svg("path", { d: path(known(seed)), class: "seed" }));
    }
    const dash = DASHES[run.dash];
    front.append(svg("path", { d: path(mean), class: "mean", "stroke-dasharray": dash }));
    if (mean.length <= 2) front.append(...mean.map((point) => circle(point, "dot", 3.5)));
    const end = mean.find(([, , i]) => i === run.taught);
    if (end) front.append(circle(end, "left", 4.5));
    return [behind, front];
  };

  // The numbers under the pointer.
  const follow = (picture, { width, runs, last, left, top, bottom, px }) => {
    const [unit, name] = acrossAxis(last);
    const line = svg("line", { y1: top, y2: bottom, class: "cursor", visibility: "hidden" });
    const readout = html("div", "", { id: "readout", hidden: true });
    picture.append(line);
    chart.append(readout);
    const nearest = (run, at) => {
      const far = run.across[chosen.across].map((x) => (x === null ? Infinity : Math.abs(px(x) - at)));
      return far.indexOf(Math.min(...far));
    };
    const sentence = (run, i) => {
      const y = run.up[chosen.up], row = html("p");
      const between = y.low[i] === null ? "" : ` [${short(y.low[i])}, ${short(y.high[i])}]`;
      row.append(swatch(run), `${run.label}: ${short(y.mean[i])}${between}`);
      return row;
    };
    picture.addEventListener("pointerleave", () => {
      line.setAttribute("visibility", "hidden");
      readout.hidden = true;
    });
    picture.addEventListener("pointermove", (event) => {
      const at = event.clientX - picture.getBoundingClientRect().left;
      const near = runs.map((run) => [run, nearest(run, at)]);
      const xs = near.map(([run, i]) => run.across[chosen.across][i]);
      const x = xs.reduce((a, b) => (Math.abs(px(b) - at) < Math.abs(px(a) - at) ? b : a));
      for (const end of ["x1", "x2"]) line.setAttribute(end, px(x));
      line.setAttribute("visibility", "visible");
      readout.replaceChildren(
        html("p", `${name}: ${short(x / unit)}`), ...near.map((pair) => sentence(...pair)),
      );
      readout.hidden = false;
      readout.style.left = px(x) < width / 2 ? "auto" : `${left + 6}px`;
      readout.style.right = px(x) < width / 2 ? `${MARGIN.right}px` : "auto";
    });
  };

  const radios = (place, names, key) => {
    const box = document.getElementById(place), entries = Object.entries(names);
    box.hidden = entries.length < 2;
    for (const [value, name] of entries) {
      const label = html("label"), checked = value === chosen[key];
      const radio = html("input", "", { type: "radio", name: place, value, checked });
      radio.addEventListener("change", () => { chosen[key] = value; draw(); });
      label.append(radio, ` ${name}`);
      box.append(label);
    }
  };

  radios("across", data.acrosses, "across");
  radios("up", data.ups, "up");
  document.getElementById("choices").hidden = false;
  data.runs.forEach((run, i) => {
    const label = html("label");
    if (data.runs.length > 1) {
      const box = html("input", "", { type: "checkbox", checked: true });
      box.addEventListener("change", () => {
        chosen.hidden[box.checked ? "delete" : "add"](i);
        draw();
      });
      label.append(box, " ");
    }
    label.append(swatch(run), run.label);
    document.getElementById("legend").append(label);
  });
  if (data.runs.length > 1) {
    for (const name of document.querySelectorAll("[data-run]")) {
      const run = data.runs.find((one) => one.label === name.dataset.run);
      if (run) name.prepend(swatch(run));
    }
  }
  document.getElementById("choose-target").hidden = target.options.length < 2;
  const show = () => {
    for (const part of document.querySelectorAll("[data-target]")) {
      part.hidden = part.dataset.target !== target.value;
    }
  };
  target.addEventListener("change", () => { show(); draw(); });
  show();  // a browser may keep an earlier choice when a page is loaded again
  let width = 0;
  new ResizeObserver(() => {
    if (chart.clientWidth !== width) {
      width = chart.clientWidth;
      draw();
    }
  }).observe(chart);
})();
