"use strict";
// One canvas for all maps of a page: zoom to the texel, under the UV layout and missed rays.
(async function () {
  const section = document.getElementById("maps");
  if (!section) return;
  const canvas = section.querySelector("canvas"), context = canvas.getContext("2d");
  const maps = texbake.json("map-settings"), mesh = await texbake.mesh("mesh-low");
  const control = function (name) { return section.querySelector(`[name="${name}"]`); };
  const ticked = function (name) { return control(name) !== null && control(name).checked; };
  const images = maps.map(function (_, k) { return document.getElementById("map-" + k); });
  const missed = await texbake.missed(), readout = section.querySelector(".readout");
  await Promise.all(images.map(function (image) { return image.decode(); }));

  // The map lies over the unit square, its height being 1 / aspect of its width on the screen.
  let width = 1, height = 1, ratio = 1, asked = false, current = 0;
  const at = { x: 0.5, y: 0.5, size: 0 };  // middle of the canvas; pixels that the map is wide
  const aspect = function () { return maps[current].width / maps[current].height; };
  const whole = function () { return 0.98 * Math.min(width, height * aspect()); };
  const corner = function () {
    // On whole pixels, so that texels are as wide as one another where a texel is a pixel.
    const left = width / 2 - at.x * at.size, top = height / 2 - at.y * at.size / aspect();
    return [Math.round(left * ratio) / ratio, Math.round(top * ratio) / ratio];
  };

  // ---- lines of the layout, in texture space with y down
  const lines = { inner: new Path2D(), outer: new Path2D() };
  const steps = mesh.head.uvSteps;
  for (let face = 0; face < mesh.borders.length; face++) {
    for (let k = 0; k < 3; k++) {
      const a = mesh.index[3 * face + k], b = mesh.index[3 * face + (k + 1) % 3];
      const isOuter = mesh.borders[face] >> k & 1;
      if (!isOuter && a > b) continue;  // its other side draws it
      const path = isOuter ? lines.outer : lines.inner;
      path.moveTo(mesh.uv[2 * a] / steps, 1 - mesh.uv[2 * a + 1] / steps);
      path.lineTo(mesh.uv[2 * b] / steps, 1 - mesh.uv[2 * b + 1] / steps);
    }
  }
  const drawLayout = function (left, top) {
    const down = at.size / aspect();
    context.save();
    context.setTransform(ratio * at.size, 0, 0, ratio * down, ratio * left, ratio * top);
    const stroke = function (path, pixels, color) {
      context.lineWidth = pixels / at.size;
      context.strokeStyle = color;
      context.stroke(path);
    };
    // Faint where triangles are too small for lines.
    const roomy = Math.min(1, at.size / Math.sqrt(mesh.borders.length) / 12);
    stroke(lines.inner, 0.8, `rgba(10, 20, 30, ${0.65 * roomy})`);
    stroke(lines.outer, 3, "rgba(10, 20, 30, 0.8)");
    stroke(lines.outer, 1.3, "#fff");
    context.restore();
  };
  const drawMissed = function (left, top) {
    const texel = at.size / missed.width, size = Math.max(texel, 4);
    const dots = new Path2D();
    for (const [x, y] of missed.places) {
      const px = left + (x + 0.5) * texel, py = top + (y + 0.5) * texel;
      if (px < -size || py < -size || px > width + size || py > height + size) continue;
      dots.rect(px - size / 2, py - size / 2, size, size);
    }
    context.fillStyle = "#ff1e3c";
    context.fill(dots);
  };
  const drawGrid = function (left, top) {
    const texel = at.size / maps[current].width;
    if (texel < 14) return;
    context.strokeStyle = "rgba(0, 0, 0, 0.25)";
    context.lineWidth = 1;
    context.beginPath();
    const across = maps[current].width, down = maps[current].height;
    for (let i = Math.max(0, Math.floor(-left / texel)); i <= across && left + i * texel < width; i++) {
      context.moveTo(left + i * texel, Math.max(top, 0));
      context.lineTo(left + i * texel, Math.min(top + down * texel, height));
    }
    for (let j = Math.max(0, Math.floor(-top / texel)); j <= down && top + j * texel < height; j++) {
      context.moveTo(Math.max(left, 0), top + j * texel);
      context.lineTo(Math.min(left + across * texel, width), top + j * texel);
    }
    context.stroke();
  };
  const draw = function () {
    asked = false;
    if (at.size === 0) return;  // the canvas is not laid out yet
    const image = images[current], [left, top] = corner();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = "#26292d";
    context.fillRect(0, 0, width, height);
    context.imageSmoothingEnabled = at.size * ratio < image.naturalWidth;
    context.imageSmoothingQuality = "high";
    context.drawImage(image, left, top, at.size, at.size / aspect());
    drawGrid(left, top);
    if (ticked("layout")) drawLayout(left, top);
    if (ticked("missed")) drawMissed(left, top);
    section.dataset.state = "ready";
  };
  const redraw = function () {
    if (!asked) { asked = true; requestAnimationFrame(draw); }
  };

  // ---- what a texel holds
  const probe = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  probe.canvas.width = probe.canvas.height = 1;
  const codesAt = function (image, u, v) {
    const x = Math.min(image.naturalWidth - 1, Math.floor(u * image.naturalWidth));
    const y = Math.min(image.naturalHeight - 1, Math.floor(v * image.naturalHeight));
    probe.clearRect(0, 0, 1, 1);
    probe.drawImage(image, x, y, 1, 1, 0, 0, 1, 1);
    return probe.getImageData(0, 0, 1, 1).data;
  };
  const meaning = function (map, codes) {
    if (map.coding === "normal") {
      const n = [codes[0], codes[1], codes[2]].map(function (c) { return Math.round(100 * (c / 127.5 - 1)) / 100 + 0; });
      n[1] *= map.green;
      return "normal " + n.map(function (c) { return c.toFixed(2); }).join(", ");
    }
    if (map.coding === "height" && map.scale) {
      return "height " + ((codes[0] / 255 - map.mid) * map.scale).toPrecision(3);
    }
    return "";
  };
  const readOut = function (px, py) {
    const [left, top] = corner(), map = maps[current];
    const u = (px - left) / at.size, v = (py - top) / at.size * aspect();
    if (u < 0 || v < 0 || u >= 1 || v >= 1) { readout.textContent = ""; return; }
    const codes = codesAt(images[current], u, v);
    const isMissed = missed && missed.isMissed[Math.floor(v * missed.height) * missed.width + Math.floor(u * missed.width)];
    const words = [
      `texel ${Math.floor(u * map.width)}, ${Math.floor(v * map.height)}`,
      `uv ${u.toFixed(4)}, ${(1 - v).toFixed(4)}`, `color ${codes[0]} ${codes[1]} ${codes[2]}`,
      meaning(map, codes), isMissed ? "missed" : "",
    ];
    readout.textContent = words.filter(Boolean).join("  ·  ");
  };

  // ---- what the reader does
  const move = function (dx, dy) {
    at.x = Math.max(0, Math.min(1, at.x - dx / at.size));
    at.y = Math.max(0, Math.min(1, at.y - dy / at.size * aspect()));
    redraw();
  };
  const zoom = function (factor, px, py) {
    const x = px === undefined ? width / 2 : px, y = py === undefined ? height / 2 : py;
    const before = at.size;
    if (before === 0) return;
    const least = Math.min(0.5 * whole(), maps[current].width / ratio), most = Math.max(64 * maps[current].width, whole());
    at.size = Math.max(least, Math.min(most, at.size * factor));
    // What lies below the pointer stays there.
    const share = 1 / before - 1 / at.size;
    at.x = Math.max(0, Math.min(1, at.x + (x - width / 2) * share));
    at.y = Math.max(0, Math.min(1, at.y + (y - height / 2) * share * aspect()));
    redraw();
  };
  const fit = function () { Object.assign(at, { x: 0.5, y: 0.5, size: whole() }); redraw(); };
  const one = function () { zoom(maps[current].width / ratio / at.size); };
  // Steps through missed texels, past those that are in view already.
  let nextMiss = -1;
  const goToMiss = function () {
    control("missed").checked = true;
    const size = 24 * missed.width, [left, top] = corner();
    const isSeen = function ([x, y]) {
      const px = left + (x + 0.5) * at.size / missed.width, py = top + (y + 0.5) * at.size / missed.width;
      return px > 0 && py > 0 && px < width && py < height;
    };
    for (let tried = 0; tried < missed.places.length; tried++) {
      nextMiss = (nextMiss + 1) % missed.places.length;
      if (at.size < size || !isSeen(missed.places[nextMiss])) break;
    }
    const [x, y] = missed.places[nextMiss];
    Object.assign(at, { x: (x + 0.5) / missed.width, y: (y + 0.5) / missed.height, size: Math.max(at.size, size) });
    redraw();
    readOut(width / 2, height / 2);
  };
  const choose = function () {
    current = Number(section.querySelector('[name="map"]:checked').value);
    section.querySelector(".caption").textContent =
      images[current].closest("figure").querySelector("figcaption").textContent;
    redraw();
  };
  texbake.dragged(canvas, move, zoom);
  canvas.addEventListener("pointermove", function (event) { readOut(event.offsetX, event.offsetY); });
  canvas.addEventListener("keydown", function (event) {
    const arrows = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (arrows[event.key]) move(...arrows[event.key]);
    else if (event.key === "+" || event.key === "=") zoom(1.25);
    else if (event.key === "-") zoom(0.8);
    else if (event.key === "0" || event.key === "Home") fit();
    else if (event.key === "1") one();
    else return;
    readOut(width / 2, height / 2);
    event.preventDefault();
  });
  control("in").addEventListener("click", function () { zoom(1.5); });
  control("out").addEventListener("click", function () { zoom(1 / 1.5); });
  control("fit").addEventListener("click", fit);
  control("one").addEventListener("click", one);
  if (missed) control("next").addEventListener("click", goToMiss);
  section.addEventListener("input", choose);
  section.querySelector(".plain").hidden = true;
  for (const part of section.querySelectorAll(".stage, .controls, .caption")) part.hidden = false;
  choose();
  texbake.fitted(canvas, function (w, h, r) {
    const isFirst = at.size === 0, share = at.size / whole();
    [width, height, ratio] = [w, h, r];
    canvas.width = Math.round(w * r);
    canvas.height = Math.round(h * r);
    at.size = isFirst ? whole() : share * whole();
    draw();
  });
})();
