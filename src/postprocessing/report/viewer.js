// The viewer of a report: a body that turns, with a choice of time and field. It fills triangles itself, with a depth buffer, so that
// it draws the same in every browser, without WebGL.
(() => {
  "use strict";
  const root = document.currentScript.closest(".viewer");
  const data = JSON.parse(root.querySelector("script[type='application/json']").textContent);
  const one = (name) => root.querySelector(`[name=${name}]`);
  const [about, canvas, key, reading] = [".about", "canvas", ".key", ".reading"].map((name) => root.querySelector(name));
  const context = canvas.getContext("2d");

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  const NONE = 65535;
  const unpacked = ({ least, most }, text) =>
    Float32Array.from(new Uint16Array(bytes(text)), (n) => (n === NONE ? NaN : least + ((most - least) * n) / (NONE - 1)));
  const places = new Float32Array(bytes(data.places));
  const faces = new Uint32Array(bytes(data.faces));
  const inside = new Uint8Array(bytes(data.inside));
  const vertices = places.length / 3;
  const isSolid = data.dimension === 3;

  // Numbers as in the rest of the page.
  const number = (value) => {
    if (value === 0 || !Number.isFinite(value)) return String(value);
    const digits = (x) => String(Number(x.toPrecision(4))).replace("-", "−");
    const size = Math.abs(value);
    if (size >= 1e-3 && size < 1e6) return digits(value);
    const power = Math.floor(Math.log10(size));
    const raised = [...String(power)].map((letter) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(letter)]).join("");
    return `${digits(value / 10 ** power)} × 10${raised}`;
  };

  // Colours of the pictures: from the smallest value to the largest, and of states.
  const colour = (text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
  const [shades, states] = [data.shades, data.states].map((all) => all.map(colour));
  const shade = (share) => {
    const along = Math.min(Math.max(share, 0), 1) * 16, below = Math.min(Math.floor(along), 15);
    return [0, 1, 2].map((i) => shades[below][i] + (along - below) * (shades[below + 1][i] - shades[below][i]));
  };
  const css = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;
  const table = Array.from({ length: 256 }, (_, n) => shade(n / 255));
  const UNKNOWN = [190, 190, 190];

  const view = { field: data.shown, time: data.times.length - 1, factor: data.magnification };
  // The displaced vertices and the values of the field at the time shown.
  let moved, values, drawn;

  const displacements = (time) => data.displacement && unpacked(data.displacement, data.displacement.values[time]);
  const displaced = (time) => {
    const displacement = displacements(time);
    return displacement ? places.map((x, i) => x + view.factor * displacement[i]) : places;
  };

  const reset = () => {
    const toward = data.toward || [0, 0, 1];
    Object.assign(view, { around: Math.atan2(toward[1], toward[0]), above: Math.asin(toward[2]), zoom: 1, shift: [0, 0] });
    frame = extents();
  };

  // Unit vectors to the right, upwards, and toward the viewer.
  const axes = () => {
    if (!isSolid) return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    const [c, s, a, b] = [Math.cos(view.around), Math.sin(view.around), Math.cos(view.above), Math.sin(view.above)];
    return [[-s, c, 0], [-b * c, -b * s, a], [a * c, a * s, b]];
  };
  const along = (axis, points, at) => axis[0] * points[at] + axis[1] * points[at + 1] + axis[2] * points[at + 2];

  // What the first view has to show: the point in its middle, about which the body turns, and the sizes to the right and upwards in which
  // the body fits, undeformed and at some times; a solid also, nearly, once it is turned.
  const extents = () => {
    const last = data.times.length - 1, count = Math.min(last, 5);
    const all = [places];
    for (let n = 0; n <= count; n += 1) all.push(displaced(count ? Math.round((n * last) / count) : last));
    const directions = axes();
    const ends = directions.map((axis) => {
      let [low, high] = [Infinity, -Infinity];
      for (const points of all) {
        for (let at = 0; at < points.length; at += 3) {
          const x = along(axis, points, at);
          low = Math.min(low, x);
          high = Math.max(high, x);
        }
      }
      return [low, high];
    });
    const middle = [0, 1, 2].map((i) => directions.reduce((sum, axis, n) => sum + (axis[i] * (ends[n][0] + ends[n][1])) / 2, 0));
    const sizes = ends.map(([low, high]) => high - low);
    const diagonal = isSolid ? Math.hypot(...sizes) : 0;
    return { middle, sizes, wide: Math.max(sizes[0], 0.8 * diagonal), tall: Math.max(sizes[1], 0.55 * diagonal) };
  };
  let frame;

  const draw = () => {
    const density = Math.min(window.devicePixelRatio || 1, 2);
    const across = Math.max(Math.round(canvas.clientWidth * density), 1);
    const { wide, tall } = frame;
    const high = Math.round(across * Math.min(Math.max(tall / wide || 0.75, 0.3), 1));
    if (canvas.width !== across || canvas.height !== high) Object.assign(canvas, { width: across, height: high });
    const scale = 0.94 * view.zoom * Math.min(across / wide || Infinity, high / tall || Infinity);
    const [right, up, toward] = axes();
    const centre = [along(right, frame.middle, 0), along(up, frame.middle, 0)];
    const points = new Float32Array(3 * vertices);
    for (let n = 0; n < 3 * vertices; n += 3) {
      points[n] = across / 2 + scale * (along(right, moved, n) - centre[0]) + view.shift[0] * across;
      points[n + 1] = high / 2 - scale * (along(up, moved, n) - centre[1]) + view.shift[1] * across;
      points[n + 2] = scale * along(toward, moved, n);
    }
    const image = context.createImageData(across, high);
    drawn = { across, high, points, face: new Int32Array(across * high).fill(-1) };
    const depth = isSolid ? new Float32Array(across * high).fill(-Infinity) : null;
    const pixels = image.data;
    const field = data.fields[view.field];
    const { low, high: top } = field;
    const place = field.logarithmic ? (v) => Math.log(Math.max(v, low) / low) / Math.log(top / low) : (v) => (v - low) / (top - low);
    const perFace = field.place === "face";
    // Lines of cells that are smaller than a few pixels would hide everything.
    const area = (frame.sizes[0] * frame.sizes[1] + frame.sizes[1] * frame.sizes[2] + frame.sizes[2] * frame.sizes[0]) * (isSolid ? 2 : 1);
    const isFine = scale * Math.sqrt(area / (faces.length / 3)) < 5 * density;
    const line = one("edges").checked && !isFine ? 0.5 * density : 0;
    for (let face = 0; 3 * face < faces.length; face += 1) {
      const corners = [0, 1, 2].map((i) => 3 * faces[3 * face + i]);
      const [ax, ay, az, bx, by, bz, cx, cy, cz] = corners.flatMap((at) => [points[at], points[at + 1], points[at + 2]]);
      const twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
      // Counterclockwise from outside is clockwise in pixels downwards.
      if (twice === 0 || (isSolid && twice > 0)) continue;
      let light = 1;
      if (isSolid) {
        const [ux, uy, uz, vx, vy, vz] = [bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az];
        const normal = [uz * vy - uy * vz, uz * vx - ux * vz, -twice];
        const facing = (0.3 * normal[0] + 0.5 * normal[1] + 0.81 * normal[2]) / Math.hypot(...normal);
        light = 0.72 + 0.28 * Math.max(facing, 0);
      }
      const [left, end] = [Math.max(Math.ceil(Math.min(ax, bx, cx)), 0), Math.min(Math.floor(Math.max(ax, bx, cx)), across - 1)];
      const [from, to] = [Math.max(Math.ceil(Math.min(ay, by, cy)), 0), Math.min(Math.floor(Math.max(ay, by, cy)), high - 1)];
      const at = perFace ? [face, face, face] : corners.map((corner) => corner / 3);
      const [va, vb, vc] = at.map((n) => values[n]);
      // Distances in pixels from the edges, per unit of a share; those of edges inside a cell are never small.
      const sizes = [[bx - ax, by - ay], [cx - bx, cy - by], [ax - cx, ay - cy]].map((edge) => Math.abs(twice) / Math.hypot(...edge));
      const [ab, bc, ca] = sizes.map((size, edge) => ((inside[face] >> edge) & 1 ? Infinity : size));
      for (let y = from; y <= to; y += 1) {
        for (let x = left; x <= end; x += 1) {
          const b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / twice;
          const c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / twice;
          const a = 1 - b - c;
          if (a < -1e-6 || b < -1e-6 || c < -1e-6) continue;
          const pixel = y * across + x;
          if (depth) {
            const near = a * az + b * bz + c * cz;
            if (near <= depth[pixel]) continue;
            depth[pixel] = near;
          }
          drawn.face[pixel] = face;
          // A state has no values in between: that of the nearest node counts.
          const value = field.states ? (a > b && a > c ? va : b > c ? vb : vc) : perFace ? va : a * va + b * vb + c * vc;
          let rgb = UNKNOWN;
          if (value === value) {
            rgb = field.states ? states[Math.round(value) % states.length] : table[Math.round(255 * Math.min(Math.max(place(value), 0), 1))];
          }
          const isLine = line && (a * bc < line || b * ca < line || c * ab < line);
          const dim = isLine ? 0.7 * light : light;
          pixels[4 * pixel] = rgb[0] * dim;
          pixels[4 * pixel + 1] = rgb[1] * dim;
          pixels[4 * pixel + 2] = rgb[2] * dim;
          pixels[4 * pixel + 3] = 255;
        }
      }
    }
    context.putImageData(image, 0, 0);
    if (isSolid) directions([right, up], density);
    canvas.dataset.drawn = drawn.face.reduce((count, face) => count + (face >= 0), 0);
  };

  // The directions of x, y and z in the lower left corner.
  const directions = ([right, up], density) => {
    const [length, foot] = [26 * density, [38 * density, canvas.height - 38 * density]];
    context.lineWidth = 1.5 * density;
    context.strokeStyle = context.fillStyle = "#1a1a1a";
    context.font = `${13 * density}px sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    ["x", "y", "z"].forEach((name, i) => {
      const [x, y] = [length * right[i], -length * up[i]];
      context.beginPath();
      context.moveTo(...foot);
      context.lineTo(foot[0] + x, foot[1] + y);
      context.stroke();
      if (Math.hypot(x, y) > 0.2 * length) context.fillText(name, foot[0] + 1.35 * x, foot[1] + 1.35 * y);
    });
  };

  // The words above the drawing and the colours below it.
  const explain = () => {
    const { words, unit, least, most, low, high, logarithmic, states: names } = data.fields[view.field];
    const shown = view.factor === 1 ? "to scale" : `× ${number(view.factor)}`;
    about.textContent = `t = ${number(data.times[view.time])} s, ${data.displacement ? `displacement ${shown}` : "undeformed"}`;
    canvas.setAttribute("aria-label", `The body coloured by ${words}`);
    const quantity = unit ? `${words} / ${unit.includes(" ") ? `(${unit})` : unit}` : words;
    key.replaceChildren();
    const add = (tag, text, style = {}) => {
      const element = document.createElement(tag);
      element.textContent = text;
      Object.assign(element.style, style);
      key.append(element);
    };
    add("strong", quantity);
    if (names) {
      names.forEach((name, n) => {
        add("i", "", { background: css(states[n % states.length]) });
        add("span", name);
      });
      return;
    }
    const stops = Array.from({ length: 17 }, (_, n) => css(shade(n / 16))).join(",");
    add("span", number(low));
    add("i", "", { background: `linear-gradient(to right,${stops})`, flex: "1 1 8rem" });
    add("span", number(high) + (logarithmic ? " (logarithmic)" : ""));
    if (least < low - 0.05 * (high - low) || most > high + 0.05 * (high - low)) {
      add("span", `values from ${number(least)} to ${number(most)}`);
    }
  };

  // The value at a point of the drawing, in pixels of the page.
  const read = (event) => {
    const box = canvas.getBoundingClientRect();
    const x = Math.round(((event.clientX - box.left) / box.width) * drawn.across);
    const y = Math.round(((event.clientY - box.top) / box.height) * drawn.high);
    const face = x >= 0 && y >= 0 && x < drawn.across && y < drawn.high ? drawn.face[y * drawn.across + x] : -1;
    if (face < 0) {
      reading.textContent = "";
      return;
    }
    const corners = [0, 1, 2].map((i) => faces[3 * face + i]);
    const distance = (vertex) => Math.hypot(drawn.points[3 * vertex] - x, drawn.points[3 * vertex + 1] - y);
    const nearest = corners.reduce((a, b) => (distance(b) < distance(a) ? b : a));
    const { words, unit, place, states: names } = data.fields[view.field];
    const value = values[place === "face" ? face : nearest];
    const shown = names ? names[Math.round(value)] : value === value ? `${number(value)} ${unit}` : "none";
    const point = [...places.subarray(3 * nearest, 3 * nearest + data.dimension)].map(number).join(", ");
    reading.textContent = `${words}: ${shown} at the node that was at (${point}) m`;
  };

  let isWaiting = false;
  const redraw = () => {
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(() => {
      isWaiting = false;
      draw();
    });
  };
  const update = () => {
    const field = data.fields[view.field];
    values = unpacked(field, field.values[view.time]);
    moved = displaced(view.time);
    explain();
    redraw();
  };

  // Controls.
  one("factor").value = view.factor;
  one("field").addEventListener("change", (event) => {
    view.field = Number(event.target.value);
    update();
  });
  one("time").addEventListener("input", (event) => {
    view.time = Number(event.target.value);
    update();
  });
  one("factor").addEventListener("change", (event) => {
    const factor = Number(event.target.value);
    view.factor = factor >= 0 && Number.isFinite(factor) ? factor : data.magnification;
    event.target.value = view.factor;
    update();
  });
  one("edges").addEventListener("change", redraw);
  let clock = null;
  const stop = () => {
    clearInterval(clock);
    clock = null;
    one("play").textContent = "Play";
  };
  one("play").addEventListener("click", () => {
    if (clock) return stop();
    one("play").textContent = "Pause";
    clock = setInterval(() => {
      view.time = (view.time + 1) % data.times.length;
      one("time").value = view.time;
      update();
    }, Math.max(80, 6000 / data.times.length));
  });
  one("time").addEventListener("input", () => clock && stop());
  for (const button of root.querySelectorAll("[name=zoom]")) {
    button.addEventListener("click", () => {
      view.zoom *= Number(button.value);
      redraw();
    });
  }
  for (const button of root.querySelectorAll("[name=along]")) {
    button.addEventListener("click", () => {
      const axis = Number(button.value);
      // A second press shows the opposite side.
      const [around, above] = [[0, 0], [-Math.PI / 2, 0], [-Math.PI / 2, Math.PI / 2]][axis];
      const isThere = Math.abs(view.around - around) < 1e-9 && Math.abs(view.above - above) < 1e-9;
      Object.assign(view, isThere ? (axis === 2 ? { above: -above } : { around: around + Math.PI }) : { around, above });
      redraw();
    });
  }
  one("reset").addEventListener("click", () => {
    reset();
    redraw();
  });
  const turn = (x, y) => {
    view.around -= x;
    view.above = Math.min(Math.max(view.above + y, -Math.PI / 2), Math.PI / 2);
  };
  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    held = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => (held = null));
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return read(event);
    const [x, y] = [event.clientX - held[0], event.clientY - held[1]];
    held = [event.clientX, event.clientY];
    if (isSolid && !event.shiftKey) {
      turn(0.01 * x, 0.01 * y);
    } else {
      view.shift = [view.shift[0] + x / canvas.clientWidth, view.shift[1] + y / canvas.clientWidth];
    }
    redraw();
  });
  canvas.addEventListener("click", read);
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step) return;
    event.preventDefault();
    if (isSolid) {
      turn(0.1 * step[0], 0.1 * step[1]);
    } else {
      view.shift = [view.shift[0] - 0.05 * step[0], view.shift[1] - 0.05 * step[1]];
    }
    redraw();
  });
  new ResizeObserver(redraw).observe(canvas);

  root.hidden = false;
  reset();
  update();
  draw();
})();
