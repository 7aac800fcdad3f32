"use strict";
// Plots with zoom; plots over time zoom together. Each is drawn when it comes into view, or before printing.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  // Values of at most this number of lines are read out together; otherwise only of the line nearest to the pointer.
  const MOST_READ = 8;
  const drawn = [];
  // By word that links plots: their whole range, and the part that is shown.
  const ranges = new Map();
  let colours = new Map();

  function colour(look) {
    if (!colours.has(look)) {
      colours.set(look, getComputedStyle(document.documentElement).getPropertyValue(`--${look}`).trim());
    }
    return colours.get(look);
  }

  // Strokes and gaps, and width of a line, px; the style sheet states those that are neither solid nor usual.
  const dash = (look) => colour(`${look}-dash`).split(" ").filter(Boolean).map(Number);
  const width = (look) => Number(colour(`${look}-width`)) || 1.4;

  const decoded = [];
  function numbers(place) {
    if (!decoded[place]) {
      const bytes = Uint8Array.from(atob(data.arrays[place]), (sign) => sign.charCodeAt(0));
      const view = new DataView(bytes.buffer);
      decoded[place] = Array.from({ length: bytes.length / 4 }, (_, k) => {
        const value = view.getFloat32(4 * k, true);
        return Number.isFinite(value) ? value : null;
      });
    }
    return decoded[place];
  }

  function series(line) {
    return [numbers(line.t).map((time) => time + line.from), numbers(line.v)];
  }

  // All lines over the same abscissas; where one has no value of its own it goes on.
  function joined(plot) {
    const pairs = plot.lines.map(series);
    const isOne = plot.lines.every((line) => line.t === plot.lines[0].t && line.from === plot.lines[0].from);
    if (isOne) return [pairs[0][0], ...pairs.map((pair) => pair[1])];
    return uPlot.join(pairs);
  }

  function linkOf(group, plot, key, index) {
    return group.linked && plot.x.startsWith("time") ? group.linked : `${key} ${index}`;
  }

  function rangeOf(link) {
    if (!ranges.has(link)) {
      const whole = [Infinity, -Infinity];
      for (const [key, group] of Object.entries(data.groups)) {
        group.plots.forEach((plot, index) => {
          if (linkOf(group, plot, key, index) !== link) return;
          for (const line of plot.lines) {
            const times = numbers(line.t);
            if (!times.length) continue;
            whole[0] = Math.min(whole[0], times[0] + line.from);
            whole[1] = Math.max(whole[1], times[times.length - 1] + line.from);
          }
        });
      }
      if (!(whole[1] > whole[0])) whole[1] = whole[0] + 1;
      ranges.set(link, { whole, shown: whole });
    }
    return ranges.get(link);
  }

  function show(link, low, high) {
    const range = rangeOf(link);
    const [begin, end] = range.whole;
    const width = Math.min(Math.max(high - low, 1e-6 * (end - begin)), end - begin);
    const from = Math.min(Math.max(low, begin), end - width);
    range.shown = [from, from + width];
    for (const one of drawn) {
      if (one.link === link) one.chart.setScale("x", { min: range.shown[0], max: range.shown[1] });
    }
  }

  function steer(event, link) {
    const [low, high] = rangeOf(link).shown;
    const width = high - low;
    const moves = {
      ArrowLeft: [low - 0.2 * width, high - 0.2 * width],
      ArrowRight: [low + 0.2 * width, high + 0.2 * width],
      "+": [low + 0.25 * width, high - 0.25 * width],
      "=": [low + 0.25 * width, high - 0.25 * width],
      "-": [low - 0.5 * width, high + 0.5 * width],
      0: rangeOf(link).whole,
    };
    if (moves[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) {
      event.preventDefault();
      show(link, ...moves[event.key]);
    }
  }

  const written = (value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(4))));

  function readOut(element, chart, plot) {
    const index = chart.cursor.idx;
    const output = element.parentElement.querySelector(".readout");
    if (index === null || index === undefined || chart.cursor.left < 0) {
      output.textContent = "";
      return;
    }
    let shown = plot.lines.map((line, k) => [line, k + 1]).filter(([line, k]) => {
      return chart.series[k].show && line.look !== "chance" && chart.data[k][index] != null;
    });
    if (shown.length > MOST_READ) {
      const away = ([, k]) => Math.abs(chart.valToPos(chart.data[k][index], "y") - chart.cursor.top);
      shown = [shown.reduce((a, b) => (away(b) < away(a) ? b : a))];
    }
    const values = shown.map(([line, k]) => `${line.label} ${written(chart.data[k][index])}`);
    output.textContent = `${written(chart.data[0][index])}: ${values.join(", ")}`;
  }

  function shade(chart, marks) {
    const { left, top, width, height } = chart.bbox;
    chart.ctx.save();
    chart.ctx.fillStyle = colour("mark");
    for (const [begin, end] of marks) {
      const from = Math.max(chart.valToPos(begin, "x", true), left);
      const to = Math.min(chart.valToPos(end, "x", true), left + width);
      if (to >= left && from <= left + width) chart.ctx.fillRect(from, top, Math.max(to - from, 2), height);
    }
    chart.ctx.restore();
  }

  // Range of the ordinate: the values in view, within the limits; a logarithmic scale has no limits.
  function rangeOfValues(plot) {
    if (plot.logY) return (chart, low, high) => (low > 0 ? [low / 1.3, high * 1.3] : [0.1, 10]);
    return (chart, low, high) => {
      const [from, to] = plot.limits || [-Infinity, Infinity];
      const [least, most] = low === null ? [-1, 1] : [Math.max(low, from), Math.min(high, to)];
      const room = 0.06 * (most - least) || 0.05 * Math.abs(most) || 1;
      return [least - room, most + room];
    };
  }

  // Few powers of ten, or where there is not one of them 1, 2 and 5 times such.
  function decades(low, high) {
    const [from, to] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
    const step = Math.max(1, Math.ceil((to - from + 1) / 5));
    const ticks = [];
    for (let power = from; power <= to; power += step) ticks.push(10 ** power);
    if (ticks.length > 1) return ticks;
    const finer = [];
    for (let power = from - 1; power <= to; power += 1) {
      for (const digit of [1, 2, 5]) {
        const value = digit * 10 ** power;
        if (value >= low && value <= high) finer.push(value);
      }
    }
    return finer.length ? finer : [low, high];
  }

  function options(element, plot, link) {
    const axis = { stroke: () => colour("quiet"), font: "12px system-ui, sans-serif", ticks: { show: false } };
    const grid = { stroke: () => colour("grid"), width: 1 };
    const log = { filter: (chart, ticks) => ticks, splits: (chart, index, low, high) => decades(low, high), values: (chart, ticks) => ticks.map(written) };
    const bands = [];
    plot.lines.forEach((line, k) => {
      const next = plot.lines[k + 1];
      if (line.look === "chance" && next && next.look === "chance") {
        bands.push({ series: [k + 1, k + 2], fill: () => colour("chance") });
      }
    });
    return {
      width: element.clientWidth,
      height: element.clientHeight,
      padding: [8, 18, 0, 0],
      legend: { show: false },
      scales: {
        x: { time: false, distr: plot.logX ? 3 : 1, range: (chart, low, high) => [low, high] },
        y: { distr: plot.logY ? 3 : 1, range: rangeOfValues(plot) },
      },
      axes: [
        { ...axis, grid, gap: 2, size: 20, label: plot.x, labelSize: 16, labelGap: 0, labelFont: axis.font, space: 45, ...(plot.logX ? log : {}) },
        { ...axis, grid, size: 58, space: 28, values: (chart, ticks) => ticks.map(written), ...(plot.logY ? log : {}) },
      ],
      bands,
      cursor: {
        drag: { x: true, y: false, setScale: false },
        points: { size: 6 },
        bind: { dblclick: () => () => show(link, ...rangeOf(link).whole) },
      },
      series: [{}, ...plot.lines.map((line) => style(line))],
      hooks: {
        setCursor: [(chart) => readOut(element, chart, plot)],
        setSelect: [(chart) => {
          if (chart.select.width < 3) return;
          const from = chart.posToVal(chart.select.left, "x");
          const to = chart.posToVal(chart.select.left + chart.select.width, "x");
          chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          show(link, from, to);
        }],
        drawClear: [(chart) => shade(chart, plot.marks)],
      },
    };
  }

  function style(line) {
    return {
      label: line.label,
      stroke: () => colour(line.look),
      width: line.look === "chance" ? 0 : width(line.look),
      dash: dash(line.look),
      points: { show: line.kind === "dots", size: 5 },
      paths: line.kind === "dots" ? () => null : line.kind === "steps" ? uPlot.paths.stepped({ align: 1 }) : undefined,
    };
  }

  function draw(element) {
    if (element.dataset.drawn) return;
    element.dataset.drawn = "yes";
    const key = element.dataset.group;
    const group = data.groups[key];
    const index = Number(element.dataset.plot);
    const plot = group.plots[index];
    const link = linkOf(group, plot, key, index);
    const output = document.createElement("span");
    output.className = "readout";
    output.setAttribute("aria-hidden", "true");
    element.parentElement.querySelector("h3").append(output);
    nameOwn(element, plot);
    const chart = new uPlot(options(element, plot, link), joined(plot), element);
    drawn.push({ chart, link, key, element, plot });
    choose(drawn[drawn.length - 1]);
    chart.setScale("x", { min: rangeOf(link).shown[0], max: rangeOf(link).shown[1] });
    new ResizeObserver(() => fit({ chart, element })).observe(element);
    element.addEventListener("keydown", (event) => steer(event, link));
  }

  function fit({ chart, element }) {
    if (element.clientWidth > 0 && element.clientWidth !== chart.width) {
      chart.setSize({ width: element.clientWidth, height: element.clientHeight });
    }
  }

  // Lines that a group's legend has taken away, by label, and the estimator that its list names.
  const hidden = new Map();
  function choose(one) {
    const list = document.querySelector(`select[data-group="${one.key}"]`);
    one.plot.lines.forEach((line, k) => {
      const wanted = (!line.of || !list || line.of === list.value) && !(hidden.get(one.key) || new Set()).has(line.label);
      if (one.chart.series[k + 1].show !== wanted) one.chart.setSeries(k + 1, { show: wanted });
    });
  }

  // A sample of a line with its dashes, for readers who do not see its colour.
  function sample(line) {
    const space = "http://www.w3.org/2000/svg";
    const swatch = document.createElementNS(space, "svg");
    const piece = document.createElementNS(space, "line");
    for (const [name, value] of Object.entries({ class: `swatch ${line.look}`, viewBox: "0 0 34 4", "aria-hidden": "true" })) {
      swatch.setAttribute(name, value);
    }
    for (const [name, value] of Object.entries({ x1: 0, x2: 34, y1: 2, y2: 2, "stroke-dasharray": dash(line.look).join(" "), "stroke-width": width(line.look) })) {
      piece.setAttribute(name, value);
    }
    swatch.append(piece);
    return swatch;
  }

  // Below a plot, what its lines are, where no legend above says so.
  function nameOwn(element, plot) {
    const own = new Map(plot.lines.filter((line) => line.key).map((line) => [line.key, line]));
    if (!own.size) return;
    const legend = document.createElement("p");
    legend.className = "own";
    for (const [word, line] of own) {
      const piece = document.createElement("span");
      piece.append(sample(line), word);
      legend.append(piece);
    }
    element.after(legend);
  }

  function entry(line, key) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "entry";
    button.setAttribute("aria-pressed", "true");
    button.append(sample(line), line.label);
    button.addEventListener("click", () => {
      const away = hidden.get(key);
      const isShown = away.has(line.label);
      if (isShown) away.delete(line.label); else away.add(line.label);
      button.setAttribute("aria-pressed", String(isShown));
      drawn.filter((one) => one.key === key).forEach(choose);
    });
    return button;
  }

  // Above the plots, once: what lines are what, each to be switched off.
  for (const [key, group] of Object.entries(data.groups)) {
    hidden.set(key, new Set());
    const lines = new Map();
    for (const line of group.plots.flatMap((plot) => plot.lines)) {
      if (!line.of && line.look !== "chance" && line.look !== "input") lines.set(line.label, line);
    }
    const first = document.querySelector(`.canvas[data-group="${key}"]`);
    if (!first || lines.size < 2) continue;
    const legend = document.createElement("p");
    legend.className = "controls";
    legend.append("Lines: ", ...[...lines.values()].map((line) => entry(line, key)));
    first.closest(".plots").before(legend);
  }

  for (const list of document.querySelectorAll("select[data-group]")) {
    list.addEventListener("change", () => drawn.filter((one) => one.key === list.dataset.group).forEach(choose));
  }
  for (const button of document.querySelectorAll("button[data-reset]")) {
    button.addEventListener("click", () => {
      const word = data.groups[button.dataset.reset].linked;
      show(word, ...rangeOf(word).whole);
    });
  }

  const elements = [...document.querySelectorAll(".canvas")];
  const seen = new IntersectionObserver((entries) => {
    for (const one of entries) {
      if (one.isIntersecting) {
        seen.unobserve(one.target);
        draw(one.target);
      }
    }
  }, { rootMargin: "400px" });
  elements.forEach((element) => seen.observe(element));

  function repaint() {
    colours = new Map();
    drawn.forEach((one) => one.chart.redraw(false, true));
    document.dispatchEvent(new Event("repaint"));
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  addEventListener("beforeprint", () => {
    document.documentElement.classList.add("paper");
    elements.forEach(draw);
    // Observers of sizes speak too late for paper.
    drawn.forEach(fit);
    repaint();
  });
  addEventListener("afterprint", () => {
    document.documentElement.classList.remove("paper");
    drawn.forEach(fit);
    repaint();
  });

  window.auvid = { data, numbers, colour, dash, width, drawn };
})();
