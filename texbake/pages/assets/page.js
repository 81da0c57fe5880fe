"use strict";
// What all pages share: meshes unpacked, and buttons that copy.
var texbake = {
  text: function (id) { return document.getElementById(id).textContent; },
  json: function (id) { return JSON.parse(this.text(id)); },

  // The other half of pack() in packing.py: name to Int32Array with .width, and .head.
  unpack: async function (id) {
    const letters = atob(this.text(id)), packed = new Uint8Array(letters.length);
    for (let i = 0; i < letters.length; i++) packed[i] = letters.charCodeAt(i);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    const headBytes = new DataView(bytes.buffer).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + headBytes)));
    const arrays = { head: head };
    let at = 4 + headBytes;
    for (const [name, [count, width]] of Object.entries(head.arrays)) {
      const values = new Int32Array(count * width);
      for (let column = 0; column < width; column++, at += 4 * count) {
        for (let row = 0, last = 0; row < count; row++) {
          const code = bytes[at + row] | bytes[at + count + row] << 8 |
            bytes[at + 2 * count + row] << 16 | bytes[at + 3 * count + row] << 24;
          last = (last + (code >>> 1 ^ -(code & 1))) | 0;
          values[row * width + column] = last;
        }
      }
      arrays[name] = values;
    }
    return arrays;
  },

  meshes: {},
  mesh: function (id) {
    return this.meshes[id] = this.meshes[id] || this.unpack(id);
  },

  // Missed texels as [column, row], and the size of the map; null if there are none.
  missed: async function () {
    const image = document.getElementById("missed");
    if (!image) return null;
    await image.decode();
    const width = image.naturalWidth, height = image.naturalHeight;
    const canvas = Object.assign(document.createElement("canvas"), { width: width, height: height });
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    const pixels = new Uint32Array(context.getImageData(0, 0, width, height).data.buffer);
    const places = [], isMissed = new Uint8Array(pixels.length);
    for (let i = 0; i < pixels.length; i++) {
      if (!pixels[i]) continue;
      isMissed[i] = 1;
      places.push([i % width, Math.floor(i / width)]);
    }
    return { width: width, height: height, places: places, isMissed: isMissed };
  },

  // A canvas keeps as many pixels as it covers on the screen; calls back when that changes, and
  // when the browser has lost what was drawn.
  fitted: function (canvas, changed) {
    const fit = function () {
      if (canvas.clientWidth === 0) return;  // hidden for now: the picture stays as it is
      changed(canvas.clientWidth, canvas.clientHeight, Math.min(window.devicePixelRatio || 1, 2));
    };
    new ResizeObserver(fit).observe(canvas);
    for (const name of ["contextrestored", "webglcontextrestored"]) canvas.addEventListener(name, fit);
  },

  // Drags of one or two fingers or the mouse: moved(dx, dy, {pans, x, y}), zoomed(factor, x, y).
  dragged: function (canvas, moved, zoomed) {
    const down = new Map();
    const middle = function () {
      const points = [...down.values()], sum = [0, 0];
      for (const [x, y] of points) { sum[0] += x / points.length; sum[1] += y / points.length; }
      const [a, b] = points;
      return [sum[0], sum[1], b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0];
    };
    canvas.addEventListener("pointerdown", function (event) {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, [event.offsetX, event.offsetY]);
    });
    canvas.addEventListener("pointermove", function (event) {
      if (!down.has(event.pointerId)) return;
      const before = middle();
      down.set(event.pointerId, [event.offsetX, event.offsetY]);
      const after = middle();
      const pans = down.size > 1 || event.shiftKey || (event.buttons & 6) !== 0;
      moved(after[0] - before[0], after[1] - before[1], pans);
      if (before[2] > 0) zoomed(after[2] / before[2], after[0], after[1]);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, function (event) { down.delete(event.pointerId); });
    }
    canvas.addEventListener("contextmenu", function (event) { event.preventDefault(); });
    // The wheel scrolls the page until the picture has been clicked or is reached by the keyboard.
    canvas.addEventListener("wheel", function (event) {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      const steps = event.deltaY * (event.deltaMode === 1 ? 20 : 1);
      zoomed(Math.exp(-Math.max(-100, Math.min(100, steps)) / 300), event.offsetX, event.offsetY);
    }, { passive: false });
  },

  // A camera that turns about a point, at which settings.view, center, radius and fov place it.
  orbit: function (settings, isYUp) {
    const camera = new THREE.PerspectiveCamera(settings.fov, 1, 0.01, 10);
    const orbit = { camera: camera, back: new THREE.Vector3() };
    let azimuth, elevation, zoom, target;
    orbit.home = function () {
      [azimuth, elevation] = settings.view;
      zoom = 1;
      target = new THREE.Vector3(...settings.center);
    };
    // Places the camera for a picture; returns the length that a pixel covers at the center.
    orbit.place = function (width, height) {
      const a = azimuth * Math.PI / 180, e = elevation * Math.PI / 180, isY = isYUp();
      const across = Math.sin(a) * Math.cos(e), along = Math.cos(a) * Math.cos(e), above = Math.sin(e);
      if (isY) orbit.back.set(across, above, along); else orbit.back.set(across, -along, above);
      const slope = Math.tan(settings.fov * Math.PI / 360), half = Math.atan(slope * Math.min(1, width / height));
      const distance = 1.03 * settings.radius / Math.sin(half) / zoom;
      camera.aspect = width / height;
      camera.near = Math.max(distance - 2 * settings.radius, 0.01 * distance);
      camera.far = distance + 3 * settings.radius;
      camera.up.set(0, isY ? 1 : 0, isY ? 0 : 1);
      camera.position.copy(target).addScaledVector(orbit.back, distance);
      camera.lookAt(target);
      camera.updateProjectionMatrix();
      camera.updateMatrixWorld();
      return 2 * distance * slope / height;
    };
    orbit.turn = function (across, above) {
      azimuth += across;
      elevation = Math.max(-89, Math.min(89, elevation + above));
    };
    orbit.pan = function (dx, dy, width, height) {
      const size = orbit.place(width, height);
      target.add(new THREE.Vector3(-dx * size, dy * size, 0).applyQuaternion(camera.quaternion));
    };
    orbit.zoom = function (factor) { zoom = Math.max(0.3, Math.min(60, zoom * factor)); };
    orbit.home();
    return orbit;
  },

  // Keys: arrow(right, up, isShifted), zoom(factor), home().
  steered: function (canvas, arrow, zoom, home) {
    canvas.addEventListener("keydown", function (event) {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (step) arrow(step[0], step[1], event.shiftKey);
      else if (event.key === "+" || event.key === "=") zoom(1.15);
      else if (event.key === "-") zoom(1 / 1.15);
      else if (event.key === "Home") home();
      else return;
      event.preventDefault();
    });
  },

  copy: async function (button) {
    const source = document.getElementById(button.dataset.copies), label = button.textContent;
    try {
      await navigator.clipboard.writeText(source.textContent);
    } catch (error) {
      getSelection().selectAllChildren(source);
      document.execCommand("copy");
    }
    button.textContent = "Copied";
    setTimeout(function () { button.textContent = label; }, 1500);
  },
};
for (const button of document.querySelectorAll("button[data-copies]")) {
  button.addEventListener("click", function () { texbake.copy(button); });
}
