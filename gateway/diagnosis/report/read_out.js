"use strict";
// The values under the pointer. The points are read from the drawn curves; nothing else is stored.
for (const plot of document.querySelectorAll(".plot")) {
  const draw = plot.querySelector(".draw"),
    numbers = (name) => plot.dataset[name].split(" ").map(Number);
  const [x0, x1] = numbers("x"),
    [y0, y1] = numbers("y");
  const read = document.createElement("div"),
    hair = document.createElement("div");
  read.className = "read";
  hair.className = "hair";
  hair.hidden = true;
  plot.append(read);
  draw.append(hair);
  let curves = null;
  const points = (path) => {
    const all = [];
    for (const piece of path.getAttribute("d").split("M").slice(1)) {
      const steps = piece.match(/-?\d+/g).map(Number);
      let x = steps[0],
        y = steps[1];
      all.push([x, y]);
      for (let k = 2; k + 1 < steps.length; k += 2) {
        x += steps[k];
        y += steps[k + 1];
        all.push([x, y]);
      }
    }
    return all;
  };
  const nearest = (all, x) => {
    let low = 0,
      high = all.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (all[middle][0] < x) low = middle;
      else high = middle;
    }
    return Math.abs(all[low][0] - x) < Math.abs(all[high][0] - x) ? all[low] : all[high];
  };
  const text = (value, span) =>
    value.toFixed(Math.min(6, Math.max(0, 3 - Math.ceil(Math.log10(span))))).replace("-", "\u2212");
  const leave = () => {
    hair.hidden = true;
    read.textContent = "";
  };
  draw.addEventListener("pointerleave", leave);
  draw.addEventListener("pointermove", (event) => {
    const box = draw.getBoundingClientRect(),
      share = (event.clientX - box.left) / box.width;
    curves ??= [...plot.querySelectorAll(".curve")]
      .filter((c) => c.dataset.l && c.getAttribute("d"))
      .map((c) => [c.dataset.l, points(c).sort((a, b) => a[0] - b[0])]);
    const values = curves.map(
      ([name, all]) =>
        name +
        " " +
        text(y1 - (nearest(all, share * 3000)[1] / 1000) * (y1 - y0), y1 - y0) +
        "\u00a0" +
        plot.dataset.uy,
    );
    read.textContent = [text(x0 + share * (x1 - x0), x1 - x0) + "\u00a0" + plot.dataset.ux, ...values].join(" · ");
    hair.hidden = false;
    hair.style.left = 100 * share + "%";
  });
}
