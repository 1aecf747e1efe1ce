// Numbers under the pointer, and a closer look: drag over a plot, double click to go back.
"use strict";
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const make = (tag, attributes, parent) => {
    const found = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(attributes)) found.setAttribute(key, value);
    parent.append(found);
    return found;
  };
  const tip = document.createElement("div");
  tip.id = "tip";
  tip.setAttribute("aria-hidden", "true");
  document.body.append(tip);

  const said = (value) => {
    if (value === 0 || Math.abs(value) < 1e-12) return "0";
    const size = Math.abs(value);
    const text = size >= 1e5 || size < 1e-3 ? value.toExponential(2) : String(Number(value.toPrecision(4)));
    return text.replace("-", "−");
  };
  const axis = (text) => {
    const [low, high, log] = text.split(" ").map(Number);
    const ends = log ? [Math.log10(low), Math.log10(high)] : [low, high];
    return {
      log: Boolean(log),
      at: (share) => ends[0] + share * (ends[1] - ends[0]),
      share: (value) => (value - ends[0]) / (ends[1] - ends[0]),
      value: (place) => (log ? 10 ** place : place),
    };
  };
  const points = (path) => {
    const numbers = path.getAttribute("d").match(/-?[\d.]+/g).map(Number);
    const dots = path.classList.contains("dots");
    const found = [];
    for (let i = 0; i + 1 < numbers.length; i += dots ? 3 : 2) found.push([numbers[i], numbers[i + 1]]);
    return found;
  };
  const ticks = (low, high) => {
    const rough = (high - low) / 4;
    const size = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * size).find((s) => s >= rough * 0.999);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return found;
  };

  for (const plot of document.querySelectorAll("svg.plot")) {
    const frame = plot.parentNode, grid = frame.querySelector(".grid");
    const [, , wide, high] = plot.getAttribute("viewBox").split(" ").map(Number);
    const x = axis(plot.dataset.x), y = axis(plot.dataset.y);
    const before = grid.innerHTML;
    let view = [0, 0, wide, high], series = null, from = null, box = null, cursor = null;
    const hit = make("rect", { width: wide, height: high, fill: "transparent" }, plot);
    plot.prepend(hit);

    const place = (event) => {
      const there = new DOMPoint(event.clientX, event.clientY).matrixTransform(hit.getScreenCTM().inverse());
      return [Math.min(view[0] + view[2], Math.max(view[0], there.x)), Math.min(view[1] + view[3], Math.max(view[1], there.y))];
    };
    const look = (next) => {
      view = next;
      plot.setAttribute("viewBox", view.join(" "));
      hit.setAttribute("x", view[0]); hit.setAttribute("y", view[1]);
      hit.setAttribute("width", view[2]); hit.setAttribute("height", view[3]);
      if (view[2] === wide && view[3] === high) { grid.innerHTML = before; return; }
      grid.replaceChildren();
      const left = x.at(view[0] / wide), right = x.at((view[0] + view[2]) / wide);
      const bottom = y.at(1 - (view[1] + view[3]) / high), top = y.at(1 - view[1] / high);
      for (const tick of ticks(left, right)) {
        const at = ((x.share(tick) * wide - view[0]) / view[2]) * wide;
        make("path", { d: `M${at} 0V${high}` }, grid);
        make("text", { x: at, y: high + 14, class: "tick middle" }, grid).textContent = said(x.value(tick));
      }
      for (const tick of ticks(bottom, top)) {
        const at = (((1 - y.share(tick)) * high - view[1]) / view[3]) * high;
        make("path", { d: `M0 ${at}H${wide}` }, grid);
        make("text", { x: -6, y: at + 3.5, class: "tick end" }, grid).textContent = said(y.value(tick));
      }
    };
    const tell = (event) => {
      series ??= [...plot.querySelectorAll("path[data-name]:not(.area)")].map((path) => [path.dataset.name, points(path)]);
      const [at] = place(event);
      let nearest = null;
      const lines = series.filter(([, all]) => all.length).map(([name, all]) => {
        const best = all.reduce((a, b) => (Math.abs(b[0] - at) < Math.abs(a[0] - at) ? b : a));
        if (nearest === null || Math.abs(best[0] - at) < Math.abs(nearest - at)) nearest = best[0];
        return `${name}: ${said(y.value(y.at(1 - best[1] / high)))}`;
      });
      if (nearest === null) return;
      cursor ??= make("path", { class: "cursor" }, plot);
      cursor.setAttribute("d", `M${nearest} ${view[1]}v${view[3]}`);
      tip.textContent = [said(x.value(x.at(nearest / wide))), ...lines].join("\n");
      tip.style.display = "block";
      const room = tip.getBoundingClientRect();
      tip.style.left = `${Math.min(event.clientX + 14, innerWidth - room.width - 4)}px`;
      tip.style.top = `${Math.max(4, event.clientY - room.height - 10)}px`;
    };
    const hide = () => { tip.style.display = "none"; cursor?.remove(); cursor = null; };
    plot.addEventListener("pointermove", (event) => {
      if (from === null) { tell(event); return; }
      hide();
      const to = place(event);
      box ??= make("rect", { class: "drag" }, plot);
      box.setAttribute("x", Math.min(from[0], to[0])); box.setAttribute("width", Math.abs(to[0] - from[0]));
      box.setAttribute("y", Math.min(from[1], to[1])); box.setAttribute("height", Math.abs(to[1] - from[1]));
    });
    plot.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "mouse" || event.button !== 0) return;
      from = place(event);
      plot.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    plot.addEventListener("pointerup", (event) => {
      if (from === null) return;
      const to = place(event), start = from;
      from = null; box?.remove(); box = null;
      const size = [Math.abs(to[0] - start[0]), Math.abs(to[1] - start[1])];
      if (size[0] < 0.02 * view[2] || size[1] < 0.02 * view[3]) return;
      look([Math.min(start[0], to[0]), Math.min(start[1], to[1]), ...size]);
    });
    plot.addEventListener("pointerleave", hide);
    plot.addEventListener("dblclick", () => look([0, 0, wide, high]));
  }
})();
