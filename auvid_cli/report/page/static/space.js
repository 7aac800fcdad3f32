"use strict";
// Paths in space, to be turned with pointer or keys.
(() => {
  const { data, numbers, colour, dash, width: widthOf } = window.auvid;
  const first = { azimuth: -0.9, elevation: 0.5, zoom: 1 };
  // Height of the box divided by its width.
  const TALL = 0.66;

  // Without a minus before a zero.
  const tenths = (value) => (Math.round(10 * value) / 10 + 0).toFixed(1);

  function boundsOf(tracks) {
    const extreme = (k, pick) => pick(...tracks.map((track) => track[k].reduce((a, b) => pick(a, b))));
    const low = [0, 1, 2].map((k) => extreme(k, Math.min));
    const high = [0, 1, 2].map((k) => extreme(k, Math.max));
    const wide = Math.max(high[0] - low[0], high[1] - low[1], 1e-3);
    const deep = Math.max(high[2] - low[2], 1e-3);
    return { low, high, wide, deep, middle: [0, 1, 2].map((k) => 0.5 * (low[k] + high[k])) };
  }

  function start(canvas) {
    const entries = data.spaces[canvas.dataset.space];
    const tracks = entries.map((entry) => entry.at.map(numbers));
    const bounds = boundsOf(tracks);
    let view = { ...first };

    // North, east, down to the screen: what is nearer is lower, for the eye is above.
    function project([north, east, down], width, height) {
      const x = (east - bounds.middle[1]) / bounds.wide;
      const y = (north - bounds.middle[0]) / bounds.wide;
      const z = (-TALL * (down - bounds.middle[2])) / bounds.deep;
      const across = x * Math.cos(view.azimuth) - y * Math.sin(view.azimuth);
      const away = x * Math.sin(view.azimuth) + y * Math.cos(view.azimuth);
      const up = z * Math.cos(view.elevation) + away * Math.sin(view.elevation);
      const size = 0.62 * Math.min(width, 1.25 * height) * view.zoom;
      return [0.5 * width + size * across, 0.5 * height - size * up];
    }

    function paint() {
      const ratio = window.devicePixelRatio || 1;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      if (!width) return;
      canvas.width = width * ratio;
      canvas.height = height * ratio;
      const context = canvas.getContext("2d");
      context.scale(ratio, ratio);
      context.font = "12px system-ui, sans-serif";
      context.lineJoin = "round";
      const path = (points, look, line = 1, dash = []) => {
        context.strokeStyle = colour(look);
        context.lineWidth = line;
        context.setLineDash(dash);
        context.beginPath();
        points.forEach((point, k) => context[k ? "lineTo" : "moveTo"](...project(point, width, height)));
        context.stroke();
      };
      const half = 0.5 * bounds.wide;
      const [n, e] = bounds.middle;
      const floor = bounds.high[2];
      const roof = bounds.low[2];
      for (let k = -2; k <= 2; k += 1) {
        const shift = 0.5 * k * half;
        path([[n - half, e + shift, floor], [n + half, e + shift, floor]], "grid");
        path([[n + shift, e - half, floor], [n + shift, e + half, floor]], "grid");
      }
      for (const [a, b] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
        path([[n + a * half, e + b * half, floor], [n + a * half, e + b * half, roof]], "grid");
      }
      context.fillStyle = colour("quiet");
      context.textAlign = "center";
      // With an edge, so that a word stays legible over another and over lines.
      const write = (text, x, y) => {
        context.strokeStyle = colour("paper");
        context.lineWidth = 3;
        context.setLineDash([]);
        context.strokeText(text, x, y);
        context.fillText(text, x, y);
      };
      const label = (text, point) => {
        const [x, y] = project(point, width, height);
        const room = 0.5 * context.measureText(text).width + 4;
        write(text, Math.min(Math.max(x, room), width - room), Math.min(Math.max(y, 14), height - 6));
      };
      label("north", [n + 1.25 * half, e, floor]);
      label("east", [n, e + 1.12 * half, floor]);
      label(`${tenths(roof)} m`, [n - half, e - 1.12 * half, roof]);
      label(`depth ${tenths(floor)} m`, [n - half, e - 1.12 * half, floor]);
      label(`${bounds.wide.toPrecision(3)} m wide`, [n - 1.2 * half, e, floor]);
      // The shadow on the floor tells near from far; the truth lies below, wide.
      const whole = tracks.map((track) => track[0].map((_, k) => [track[0][k], track[1][k], track[2][k]]));
      path(whole[0].map(([north, east]) => [north, east, floor]), "shadow", 1);
      whole.forEach((points, k) => {
        const { look } = entries[k];
        path(points, look, look === "true" ? 6 : widthOf(look), dash(look));
      });
      const ends = [[whole[0][0], "start"], [whole[0][whole[0].length - 1], "end"]];
      for (const [point, word] of ends) {
        const [x, y] = project(point, width, height);
        context.fillStyle = colour("ink");
        context.setLineDash([]);
        context.beginPath();
        context.arc(x, y, 4, 0, 2 * Math.PI);
        context.fill();
        write(word, x, y - 8);
      }
    }

    function turn(azimuth, elevation) {
      view.azimuth += azimuth;
      view.elevation = Math.min(Math.max(view.elevation + elevation, -Math.PI / 2), Math.PI / 2);
      paint();
    }

    function zoom(times) {
      view.zoom = Math.min(Math.max(view.zoom * times, 0.5), 8);
      paint();
    }

    let held = null;
    canvas.addEventListener("pointerdown", (event) => {
      held = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      turn(0.01 * (event.clientX - held[0]), 0.01 * (event.clientY - held[1]));
      held = [event.clientX, event.clientY];
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { held = null; });
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(event.deltaY < 0 ? 1.1 : 1 / 1.1);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const moves = {
        ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
        "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), 0: () => { view = { ...first }; paint(); },
      };
      if (moves[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) {
        event.preventDefault();
        moves[event.key]();
      }
    });
    new ResizeObserver(paint).observe(canvas);
    document.addEventListener("repaint", paint);
    paint();
  }

  document.querySelectorAll("canvas[data-space]").forEach(start);
})();
