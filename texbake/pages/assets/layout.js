"use strict";
// The layout and the mesh side by side; a chart that is pointed at is shown in both.
(async function () {
  const section = document.getElementById("view"), settings = texbake.json("view-settings");
  const control = function (name) { return section.querySelector(`[name="${name}"]`); };
  const [mesh, faces] = await Promise.all([texbake.mesh("mesh-low"), texbake.unpack("layout-faces")]);
  const nFaces = faces.head.arrays.chart[0], head = mesh.head;

  // ---- geometry: each triangle has its own corners, which carry its chart and colors
  const places = new Float32Array(9 * nFaces), corners = new Float32Array(9 * nFaces);
  const uvs = new Float32Array(6 * nFaces), charts = new Float32Array(3 * nFaces);
  const colors = new Uint8Array(9 * nFaces), heat = new Uint8Array(9 * nFaces);
  const swatches = new Map(), lines = [[], []];
  for (let face = 0; face < nFaces; face++) {
    for (let k = 0; k < 3; k++) {
      const at = 3 * face + k, vertex = mesh.index[at];
      for (let axis = 0; axis < 3; axis++) {
        places[3 * at + axis] = head.low[axis] + mesh.position[3 * vertex + axis] * head.step;
        colors[3 * at + axis] = faces.colors[face] >> (16 - 8 * axis) & 255;
        heat[3 * at + axis] = faces.heat[face] >> (16 - 8 * axis) & 255;
      }
      for (let axis = 0; axis < 2; axis++) {
        const value = mesh.uv[2 * vertex + axis] / head.uvSteps;
        uvs[2 * at + axis] = value;
        corners[3 * at + axis] = value * settings.sides[axis] / Math.max(...settings.sides);
      }
      charts[at] = faces.chart[face];
    }
    swatches.set(faces.chart[face], faces.colors[face]);
    for (let k = 0; k < 3; k++) {
      if (!(faces.seams[face] >> k & 1)) continue;
      for (const at of [3 * face + k, 3 * face + (k + 1) % 3]) {
        for (let axis = 0; axis < 3; axis++) {
          lines[0].push(corners[3 * at + axis]);
          lines[1].push(places[3 * at + axis]);
        }
      }
    }
  }
  const shared = {
    mode: { value: 0 }, shown: { value: -1 }, cells: { value: settings.cells }, picks: { value: 0 },
    toEye: { value: new THREE.Vector3(0, 0, 1) },
  };
  const material = function (isLit) {
    return new THREE.ShaderMaterial({
      uniforms: Object.assign({}, shared), defines: { IS_LIT: isLit ? 1 : 0 }, side: THREE.DoubleSide,
      extensions: { derivatives: true },
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
      vertexShader: `
        attribute float chart; attribute vec3 chartColor, heatColor; attribute vec2 coordinates;
        varying float its; varying vec3 color, warmth, place; varying vec2 at;
        void main() {
          its = chart; color = chartColor; warmth = heatColor; at = coordinates; place = position;
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        }`,
      fragmentShader: `
        uniform int mode; uniform float shown, cells, picks; uniform vec3 toEye;
        varying float its; varying vec3 color, warmth, place; varying vec2 at;
        void main() {
          float number = floor(its + 0.5);
          if (picks > 0.5) {
            float code = number + 1.0;
            gl_FragColor = vec4(mod(code, 256.0), mod(floor(code / 256.0), 256.0), floor(code / 65536.0), 255.0) / 255.0;
            return;
          }
          vec3 c = mode == 1 ? warmth : color;
          if (mode == 2) {
            vec2 cell = floor(at * cells);
            c = mix(vec3(0.93), vec3(0.30 + 0.35 * fract(cell.x / cells), 0.42, 0.30 + 0.45 * fract(cell.y / cells)), mod(cell.x + cell.y, 2.0));
          }
          #if IS_LIT
          vec3 n = normalize(cross(dFdx(place), dFdy(place)));
          c *= 0.45 + 0.6 * abs(dot(n, normalize(toEye)));
          #endif
          if (shown >= 0.0) c = number == shown ? mix(c, vec3(1.0, 0.95, 0.55), 0.45) : c * 0.62;
          gl_FragColor = vec4(c, 1.0);
        }`,
    });
  };
  const scene = function (positions, ends, isLit) {
    const made = new THREE.BufferGeometry(), drawn = new THREE.Scene();
    const add = function (name, values, width, normalized) {
      made.setAttribute(name, new THREE.BufferAttribute(values, width, normalized));
    };
    add("position", positions, 3); add("chart", charts, 1); add("coordinates", uvs, 2);
    add("chartColor", colors, 3, true); add("heatColor", heat, 3, true);
    const surface = new THREE.Mesh(made, material(isLit)), outline = new THREE.BufferGeometry();
    outline.setAttribute("position", new THREE.BufferAttribute(new Float32Array(ends), 3));
    const seams = new THREE.LineSegments(outline, new THREE.LineBasicMaterial({ color: 0xd0102c }));
    for (const object of [surface, seams]) { object.frustumCulled = false; drawn.add(object); }
    return { scene: drawn, seams: seams };
  };

  // ---- two views
  const view = function (id, drawn, camera, place) {
    const canvas = document.querySelector(`#${id} canvas`);
    const renderer = new THREE.WebGLRenderer({ canvas: canvas, antialias: true });
    const target = new THREE.WebGLRenderTarget(1, 1), pixel = new Uint8Array(4);
    const made = { canvas: canvas, seams: drawn.seams, width: 1, height: 1, asked: false };
    renderer.setClearColor(0x26292d, 1);
    made.draw = function () {
      made.asked = false;
      place(made);
      renderer.render(drawn.scene, camera);
      section.dataset.state = "ready";
    };
    made.redraw = function () {
      if (!made.asked) { made.asked = true; requestAnimationFrame(made.draw); }
    };
    // The chart at a point: its number is drawn as the color of one pixel.
    made.chartAt = function (x, y) {
      place(made);
      camera.setViewOffset(made.width, made.height, x, y, 1, 1);
      const wasVisible = drawn.seams.visible;
      drawn.seams.visible = false;
      shared.picks.value = 1;
      renderer.setRenderTarget(target);
      renderer.setClearColor(0x000000, 0);
      renderer.clear();
      renderer.render(drawn.scene, camera);
      renderer.readRenderTargetPixels(target, 0, 0, 1, 1, pixel);
      renderer.setRenderTarget(null);
      renderer.setClearColor(0x26292d, 1);
      shared.picks.value = 0;
      drawn.seams.visible = wasVisible;
      camera.clearViewOffset();
      return pixel[0] + 256 * pixel[1] + 65536 * pixel[2] - 1;
    };
    texbake.fitted(canvas, function (width, height, ratio) {
      [made.width, made.height] = [width, height];
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
      made.draw();
    });
    return made;
  };
  const window2d = {};
  const orbit = texbake.orbit(settings, function () { return control("up").value === "y"; });
  const home = function () {
    orbit.home();
    const sides = settings.sides.map(function (side) { return side / Math.max(...settings.sides); });
    const low = settings.low.map(function (value, k) { return Math.min(value, 0) * sides[k]; });
    const high = settings.high.map(function (value, k) { return Math.max(value, 1) * sides[k]; });
    window2d.x = (low[0] + high[0]) / 2;
    window2d.y = (low[1] + high[1]) / 2;
    window2d.half = 0.52 * Math.max(high[0] - low[0], high[1] - low[1]);
  };
  const flatCamera = new THREE.OrthographicCamera(-1, 1, 1, -1, -1, 1);
  const placeFlat = function (made) {
    const unit = window2d.half / Math.min(made.width, made.height);
    flatCamera.left = window2d.x - unit * made.width; flatCamera.right = window2d.x + unit * made.width;
    flatCamera.bottom = window2d.y - unit * made.height; flatCamera.top = window2d.y + unit * made.height;
    flatCamera.updateProjectionMatrix();
    return 2 * unit;
  };
  const placeSolid = function (made) {
    orbit.place(made.width, made.height);
    shared.toEye.value.copy(orbit.back);
  };
  control("up").value = settings.up;
  home();
  let flat, solid;
  try {
    flat = view("flat", scene(corners, lines[0], false), flatCamera, placeFlat);
    solid = view("solid", scene(places, lines[1], true), orbit.camera, placeSolid);
  } catch (error) {
    section.querySelector(".failure").hidden = false;
    section.dataset.state = "failed";
    return;
  }
  section.querySelector(".still").hidden = true;
  const redraw = function () { flat.redraw(); solid.redraw(); };

  // ---- the chart that is shown
  const rows = new Map([...document.querySelectorAll("[data-chart]")].map(function (row) { return [Number(row.dataset.chart), row]; }));
  let kept = -1;
  const show = function (chart) {
    if (chart === shared.shown.value) return;
    for (const row of [rows.get(shared.shown.value), rows.get(chart)]) {
      if (row) row.classList.toggle("shown", row === rows.get(chart));
    }
    shared.shown.value = chart;
    const row = rows.get(chart);
    section.querySelector(".readout").textContent = chart < 0 ? "" : row
      ? `Chart ${chart}: ${row.cells[1].textContent} triangles, ${row.cells[2].textContent} of the surface, L2 stretch ${row.cells[4].textContent}`
      : `Chart ${chart}`;
    redraw();
  };
  const keep = function (chart) { kept = chart === kept ? -1 : chart; show(chart); };
  for (const [chart, row] of rows) {
    row.querySelector(".swatch").style.background = "#" + (swatches.get(chart) || 0).toString(16).padStart(6, "0");
    row.addEventListener("pointerenter", function () { show(chart); });
    row.addEventListener("pointerleave", function () { show(kept); });
    row.addEventListener("focus", function () { show(chart); });
    row.addEventListener("click", function () { keep(chart); });
  }
  const move = function (dx, dy) {
    const size = placeFlat(flat);
    window2d.x -= dx * size;
    window2d.y += dy * size;
    flat.redraw();
  };
  const turn = function (across, above) { orbit.turn(across, above); solid.redraw(); };
  const pan = function (dx, dy) { orbit.pan(dx, dy, solid.width, solid.height); solid.redraw(); };
  const zooms = {
    flat: function (factor) { window2d.half = Math.max(0.002, Math.min(20, window2d.half / factor)); flat.redraw(); },
    solid: function (factor) { orbit.zoom(factor); solid.redraw(); },
  };
  texbake.dragged(flat.canvas, move, zooms.flat);
  texbake.dragged(solid.canvas, function (dx, dy, pans) {
    if (pans) pan(dx, dy); else turn(-0.4 * dx, 0.4 * dy);
  }, zooms.solid);
  for (const [name, made] of [["flat", flat], ["solid", solid]]) {
    let pressed = null;
    made.canvas.addEventListener("pointermove", function (event) {
      if (event.buttons !== 0) return;
      const chart = made.chartAt(event.offsetX, event.offsetY);
      show(chart < 0 ? kept : chart);
    });
    made.canvas.addEventListener("pointerleave", function () { show(kept); });
    made.canvas.addEventListener("pointerdown", function (event) { pressed = [event.offsetX, event.offsetY]; });
    made.canvas.addEventListener("pointerup", function (event) {
      const still = pressed && Math.hypot(event.offsetX - pressed[0], event.offsetY - pressed[1]) < 4;
      pressed = null;
      if (still) keep(made.chartAt(event.offsetX, event.offsetY));
    });
    texbake.steered(made.canvas, function (right, up, isShifted) {
      if (name === "flat") move(-40 * right, 40 * up);
      else if (isShifted) pan(-20 * right, 20 * up);
      else turn(5 * right, 5 * up);
    }, zooms[name], function () { home(); redraw(); });
  }
  section.addEventListener("input", function () {
    const mode = section.querySelector('[name="color"]:checked').value;
    shared.mode.value = ["charts", "stretch", "checker"].indexOf(mode);
    section.querySelector(".when-stretch").hidden = mode !== "stretch";
    flat.seams.visible = solid.seams.visible = control("seams").checked;
    redraw();
  });
  control("home").addEventListener("click", function () { home(); redraw(); });
})();
