"use strict";
// The high-poly, low-poly and baked mesh, two of them in one view, with a slider between.
(async function () {
  const section = document.getElementById("view");
  const canvas = section.querySelector("canvas"), settings = texbake.json("view-settings");
  const control = function (name) { return section.querySelector(`[name="${name}"]`); };
  const chosen = function (name) { return section.querySelector(`[name="${name}"]:checked`).value; };
  const ticked = function (name) { return control(name) !== null && control(name).checked; };

  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas: canvas, antialias: true });
  } catch (error) {
    section.querySelector(".failure").hidden = false;
    section.querySelector(".divider").hidden = true;
    section.dataset.state = "failed";
    return;
  }
  section.querySelector(".still").hidden = true;
  renderer.autoClear = false;
  const dark = new THREE.Color(0x26292d), light = new THREE.Vector3();
  const orbit = texbake.orbit(settings, function () { return control("up").value === "y"; });
  const camera = orbit.camera;

  // ---- meshes
  const direction = function (values, width, row, steps, out) {
    let x = values[row * width] / steps, y = values[row * width + 1] / steps;
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) {
      const folded = x;
      x = (1 - Math.abs(y)) * (x < 0 ? -1 : 1);
      y = (1 - Math.abs(folded)) * (y < 0 ? -1 : 1);
    }
    const size = Math.hypot(x, y, z);
    out[0] = x / size; out[1] = y / size; out[2] = z / size;
  };
  const geometry = function (mesh) {
    const head = mesh.head, count = head.arrays.position[0], made = new THREE.BufferGeometry();
    const positions = new Float32Array(3 * count), normals = new Float32Array(3 * count);
    const vector = [0, 0, 0];
    for (let i = 0; i < count; i++) {
      direction(mesh.normal, 2, i, head.directionSteps, vector);
      for (let k = 0; k < 3; k++) {
        positions[3 * i + k] = head.low[k] + mesh.position[3 * i + k] * head.step;
        normals[3 * i + k] = vector[k];
      }
    }
    made.setIndex(new THREE.BufferAttribute(new Uint32Array(mesh.index), 1));
    made.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    made.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
    if (mesh.uv) {
      const tangents = new Float32Array(4 * count);
      for (let i = 0; i < count; i++) {
        direction(mesh.tangent, 3, i, head.directionSteps, vector);
        tangents.set(vector, 4 * i);
        tangents[4 * i + 3] = mesh.tangent[3 * i + 2];
      }
      const uvs = Float32Array.from(mesh.uv, function (value) { return value / head.uvSteps; });
      made.setAttribute("uv", new THREE.BufferAttribute(uvs, 2));
      made.setAttribute("tangent", new THREE.BufferAttribute(tangents, 4));
    }
    return made;
  };

  // ---- textures: the pictures in the page
  const textures = {};
  const texture = async function (id) {
    const image = document.getElementById(id);
    if (!image) return null;
    if (!textures[id]) {
      // An image in the page reports its width on the screen, not its number of texels.
      const detached = Object.assign(new Image(), { src: image.src });
      await detached.decode();
      const made = textures[id] = new THREE.Texture(detached);
      made.wrapS = made.wrapT = THREE.RepeatWrapping;
      made.anisotropy = Math.min(8, renderer.capabilities.getMaxAnisotropy());
      made.needsUpdate = true;
    }
    return textures[id];
  };
  const maps = document.getElementById("map-settings") ? texbake.json("map-settings") : [];
  const place = function (name) { return maps.findIndex(function (map) { return map.name === name; }); };
  const normals = maps[place(settings.normals)];

  // ---- shading
  const white = new THREE.DataTexture(new Uint8Array([255, 255, 255, 255]), 1, 1);
  white.needsUpdate = true;
  const shared = {
    normalMap: { value: white }, surfaceMap: { value: white }, missedMap: { value: white },
    green: { value: normals ? normals.green : 1 }, toLight: { value: light },
    toEye: { value: new THREE.Vector3() }, up: { value: new THREE.Vector3(0, 1, 0) },
    shows: { value: 0 }, showsMissed: { value: 0 },
  };
  const material = function (normalSpace, hasMaps, encodes) {
    return new THREE.ShaderMaterial({
      // References are kept, so that setting one sets all.
      uniforms: Object.assign({}, shared),
      defines: { NORMAL_SPACE: normalSpace, HAS_MAPS: hasMaps, ENCODES: encodes },
      side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
      vertexShader: `
        #if HAS_MAPS
        attribute vec4 tangent;
        varying vec4 cornerTangent;
        #endif
        varying vec3 place; varying vec3 cornerNormal; varying vec2 coordinates;
        void main() {
          place = position; cornerNormal = normal; coordinates = uv;
          #if HAS_MAPS
          cornerTangent = tangent;
          #endif
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        }`,
      fragmentShader: `
        uniform sampler2D normalMap, surfaceMap, missedMap;
        uniform vec3 toLight, toEye, up;
        uniform float green; uniform int shows; uniform float showsMissed;
        #if HAS_MAPS
        varying vec4 cornerTangent;
        #endif
        varying vec3 place; varying vec3 cornerNormal; varying vec2 coordinates;
        vec2 octahedral(vec3 n) {
          n /= abs(n.x) + abs(n.y) + abs(n.z);
          vec2 turned = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
          return (n.z < 0.0 ? turned : n.xy) * 0.5 + 0.5;
        }
        void main() {
          vec3 n = cornerNormal;
          #if NORMAL_SPACE > 0
          vec3 c = texture2D(normalMap, coordinates).xyz * 2.0 - 1.0;
          c.y *= green;
          #if NORMAL_SPACE == 1
          // As it was baked: tangents and normals interpolated and not normalized.
          n = c.x * cornerTangent.xyz + c.y * cornerTangent.w * cross(n, cornerTangent.xyz) + c.z * n;
          #else
          n = c;
          #endif
          #endif
          n = normalize(gl_FrontFacing ? n : -n);
          #if ENCODES
          vec2 codes = floor(octahedral(n) * 65535.0 + 0.5);
          vec2 high = floor(codes / 256.0);
          gl_FragColor = vec4(high.x, codes.x - 256.0 * high.x, high.y, codes.y - 256.0 * high.y) / 255.0;
          #else
          vec3 v = normalize(toEye - place), h = normalize(v + toLight);
          float facing = max(dot(n, toLight), 0.0);
          float sky = 0.5 + 0.5 * dot(n, up);
          vec3 color = vec3(0.60) * (vec3(1.0, 0.97, 0.93) * facing * 1.15 + mix(vec3(0.10, 0.095, 0.09), vec3(0.24, 0.27, 0.31), sky));
          color += 0.16 * pow(max(dot(n, h), 0.0), 28.0) * step(0.0, dot(n, toLight));
          color = pow(color, vec3(1.0 / 2.2));
          #if HAS_MAPS
          if (shows == 2) color = texture2D(surfaceMap, coordinates).rgb;
          #endif
          if (shows == 1) color = n * 0.5 + 0.5;
          #if HAS_MAPS
          color = mix(color, vec3(1.0, 0.12, 0.24), showsMissed * texture2D(missedMap, coordinates).a);
          #endif
          gl_FragColor = vec4(color, 1.0);
          #endif
        }`,
    });
  };
  const normalSpace = normals ? (normals.space === "tangent" ? 1 : 2) : 0;

  // ---- the angle between the normals of the high-poly and the baked mesh
  const stops = settings.colors.map(function (color) { return new THREE.Color(color); });
  const rampData = new Uint8Array(4 * stops.length);
  stops.forEach(function (color, k) {
    rampData.set([255 * color.r + 0.5, 255 * color.g + 0.5, 255 * color.b + 0.5, 255], 4 * k);
  });
  const ramp = new THREE.DataTexture(rampData, stops.length, 1);
  ramp.magFilter = ramp.minFilter = THREE.LinearFilter;
  ramp.needsUpdate = true;
  const targets = [0, 1].map(function () {
    return new THREE.WebGLRenderTarget(1, 1, { minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter });
  });
  const angles = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), new THREE.ShaderMaterial({
    uniforms: {
      highNormals: { value: targets[0].texture }, bakedNormals: { value: targets[1].texture },
      ramp: { value: ramp }, pixels: { value: new THREE.Vector2() },
      greatest: { value: settings.greatest * Math.PI / 180 }, steps: { value: stops.length },
    },
    depthTest: false, depthWrite: false,
    vertexShader: "void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }",
    fragmentShader: `
      uniform sampler2D highNormals, bakedNormals, ramp; uniform vec2 pixels; uniform float greatest, steps;
      vec3 decoded(vec4 c) {
        vec2 p = vec2(dot(c.xy, vec2(65280.0, 255.0)), dot(c.zw, vec2(65280.0, 255.0))) / 65535.0 * 2.0 - 1.0;
        vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
        if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
        return normalize(n);
      }
      void main() {
        vec4 a = texture2D(highNormals, gl_FragCoord.xy / pixels), b = texture2D(bakedNormals, gl_FragCoord.xy / pixels);
        bool hasA = dot(a, a) > 0.0, hasB = dot(b, b) > 0.0;
        if (!hasA && !hasB) discard;
        vec3 m = decoded(a), n = decoded(b);
        float angle = 2.0 * atan(length(m - n), length(m + n));
        float level = min(angle / greatest, 1.0) * (steps - 1.0) / steps + 0.5 / steps;
        gl_FragColor = hasA && hasB ? texture2D(ramp, vec2(level, 0.5)) : vec4(0.42, 0.44, 0.47, 1.0);
      }`,
  }));
  angles.frustumCulled = false;
  const errorScene = new THREE.Scene();
  errorScene.add(angles);

  const alone = document.getElementById("mesh-high") === null;
  const unpacked = await Promise.all([texbake.mesh(alone ? "mesh-low" : "mesh-high"), texbake.mesh("mesh-low")]);
  const [highGeometry, lowGeometry] = unpacked.map(geometry), hasMaps = unpacked[1].uv ? 1 : 0;
  const made = {
    high: new THREE.Mesh(highGeometry, material(0, 0, 0)),
    low: new THREE.Mesh(lowGeometry, material(0, hasMaps, 0)),
    baked: new THREE.Mesh(lowGeometry, material(normalSpace, hasMaps, 0)),
    highNormals: new THREE.Mesh(highGeometry, material(0, 0, 1)),
    bakedNormals: new THREE.Mesh(lowGeometry, material(normalSpace, hasMaps, 1)),
  };
  const scenes = { error: errorScene };
  for (const [name, mesh] of Object.entries(made)) {
    mesh.frustumCulled = false;
    scenes[name] = new THREE.Scene();
    scenes[name].add(mesh);
  }
  if (normals) shared.normalMap.value = await texture("map-" + place(normals.name));

  let wires = null;
  const showTriangles = function (on) {
    if (on && !wires) {
      const lines = new THREE.WireframeGeometry(lowGeometry);
      wires = ["low", "baked"].map(function (name) {
        const wire = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: 0x0d1a26, transparent: true, opacity: 0.55 }));
        wire.frustumCulled = false;
        scenes[name].add(wire);
        return wire;
      });
    }
    for (const wire of wires || []) wire.visible = on;
  };

  // ---- the camera
  let width = 1, height = 1, ratio = 1, asked = false;
  const placeCamera = function () {
    orbit.place(width, height);
    const turn = Number(control("light").value) * Math.PI / 180;
    light.set(Math.sin(turn) * 0.8, 0.55, Math.cos(turn) * 0.8).normalize();
    light.applyQuaternion(camera.quaternion);
    shared.toEye.value.copy(camera.position);
    shared.up.value.copy(camera.up);
  };

  const half = function (name, x, across) {
    if (across <= 0) return;
    renderer.setScissor(x, 0, across, height);
    renderer.render(scenes[name], camera);
  };
  const draw = function () {
    asked = false;
    if (width < 2 || height < 2) return;
    placeCamera();
    const left = chosen("left"), right = chosen("right");
    const split = Math.round(width * control("wipe").value / 1000);
    if (left === "error" || right === "error") {
      ["highNormals", "bakedNormals"].forEach(function (name, k) {
        renderer.setRenderTarget(targets[k]);
        renderer.setClearColor(0x000000, 0);
        renderer.clear();
        renderer.render(scenes[name], camera);
      });
      renderer.setRenderTarget(null);
    }
    renderer.setScissorTest(false);
    renderer.setClearColor(dark, 1);
    renderer.clear();
    renderer.setScissorTest(true);
    half(left, 0, split);
    half(right, split, width - split);
    section.querySelector(".divider").style.left = split + "px";
    section.querySelector(".tag.left").textContent = settings.labels[left];
    section.querySelector(".tag.right").textContent = settings.labels[right];
    section.querySelector(".when-error").hidden = left !== "error" && right !== "error";
    section.dataset.state = "ready";
  };
  const redraw = function () {
    if (!asked) { asked = true; requestAnimationFrame(draw); }
  };

  // ---- what the reader does
  const turn = function (azimuth, elevation) { orbit.turn(azimuth, elevation); redraw(); };
  const move = function (dx, dy) { orbit.pan(dx, dy, width, height); redraw(); };
  const zoom = function (factor) { orbit.zoom(factor); redraw(); };
  const home = function () { orbit.home(); redraw(); };
  const wipeTo = function (x) {
    control("wipe").value = 1000 * x / width;
    redraw();
  };
  texbake.dragged(canvas, function (dx, dy, pans) {
    if (pans) move(dx, dy); else turn(-0.4 * dx, 0.4 * dy);
  }, zoom);
  texbake.steered(canvas, function (right, up, isShifted) {
    if (isShifted) move(-20 * right, 20 * up); else turn(5 * right, 5 * up);
  }, zoom, home);
  const divider = section.querySelector(".divider");
  divider.addEventListener("pointerdown", function (event) {
    divider.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  divider.addEventListener("pointermove", function (event) {
    if (!divider.hasPointerCapture(event.pointerId)) return;
    wipeTo(event.clientX - canvas.getBoundingClientRect().left);
  });
  // Missed texels as a texture in which a single one is visible from a distance.
  let missedTexture = null;
  const missed = async function () {
    if (missedTexture) return missedTexture;
    const found = await texbake.missed(), across = 1024;
    const down = Math.max(1, Math.round(across * found.height / found.width));
    const picture = Object.assign(document.createElement("canvas"), { width: across, height: down });
    const context = picture.getContext("2d");
    context.fillStyle = "#fff";
    const dot = Math.max(5, across / found.width);
    for (const [x, y] of found.places) {
      context.fillRect((x + 0.5) * across / found.width - dot / 2, (y + 0.5) * down / found.height - dot / 2, dot, dot);
    }
    missedTexture = new THREE.CanvasTexture(picture);
    return missedTexture;
  };
  const choose = async function () {
    const surface = control("surface").value, k = place(surface);
    shared.shows.value = surface === "lit" ? 0 : surface === "normals" ? 1 : 2;
    if (k >= 0) shared.surfaceMap.value = await texture("map-" + k);
    shared.showsMissed.value = ticked("missed") ? 1 : 0;
    if (ticked("missed")) shared.missedMap.value = await missed();
    showTriangles(ticked("wire"));
    redraw();
  };
  section.addEventListener("input", choose);
  control("home").addEventListener("click", home);
  control("up").value = settings.up;
  if (!normals) {
    settings.labels.baked += maps.length ? "; there is no normal map" : "";
    control("surface").value = maps.length ? maps[0].name : "lit";
  }
  await choose();
  texbake.fitted(canvas, function (w, h, r) {
    [width, height, ratio] = [w, h, r];
    renderer.setPixelRatio(ratio);
    renderer.setSize(width, height, false);
    for (const target of targets) target.setSize(Math.round(width * ratio), Math.round(height * ratio));
    angles.material.uniforms.pixels.value.set(Math.round(width * ratio), Math.round(height * ratio));
    draw();
  });
})();
