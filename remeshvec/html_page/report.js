"use strict";
(() => {
  const { scene, charts } = JSON.parse(document.getElementById("data").textContent);
  const ids = ["view-before", "view-after"];
  const config = { displayModeBar: false, displaylogo: false, responsive: true };
  const LIFT = 0.002; // height of edges above the faces; the surface reaches from -1 to 1
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function unpack(text, type) {
    const letters = atob(text);
    const bytes = new Uint8Array(letters.length);
    for (let k = 0; k < letters.length; k++) bytes[k] = letters.charCodeAt(k);
    return new type(bytes.buffer);
  }

  // Every third number, starting at the first, the second and the third.
  function columns(array) {
    return [0, 1, 2].map((k) => array.filter((_, at) => at % 3 === k));
  }

  const meshes = scene.meshes.map((packed) => ({
    vertices: unpack(packed.vertices, Float32Array),
    faces: unpack(packed.faces, Uint32Array),
    curves: unpack(packed.curves, Uint32Array),
    sides: packed.sides,
    levels: Object.fromEntries(
      Object.entries(packed.levels).map(([key, text]) => [key, unpack(text, Uint8Array)])
    ),
  }));

  // Undirected edges, each once: sorted numbers of pairs, below 2^53 for any mesh that fits here.
  function edgesOf(mesh) {
    const { faces } = mesh;
    const n = mesh.vertices.length / 3;
    const keys = new Float64Array(faces.length);
    for (let h = 0; h < faces.length; h++) {
      const a = faces[h], b = faces[h % 3 === 2 ? h - 2 : h + 1];
      keys[h] = Math.min(a, b) * n + Math.max(a, b);
    }
    keys.sort();
    const once = keys.filter((key, at) => at === 0 || key !== keys[at - 1]);
    return [once.map((key) => Math.floor(key / n)), once.map((key) => key % n)];
  }

  // Area-weighted normals at the vertices; zero where there is no area.
  function normalsOf({ vertices, faces }) {
    const normals = new Float32Array(vertices.length);
    for (let f = 0; f < faces.length; f += 3) {
      const [p, q, r] = [0, 1, 2].map((c) => 3 * faces[f + c]);
      const u = [0, 1, 2].map((c) => vertices[q + c] - vertices[p + c]);
      const v = [0, 1, 2].map((c) => vertices[r + c] - vertices[p + c]);
      for (let c = 0; c < 3; c++) {
        const along = u[(c + 1) % 3] * v[(c + 2) % 3] - u[(c + 2) % 3] * v[(c + 1) % 3];
        for (const corner of [p, q, r]) normals[corner + c] += along;
      }
    }
    for (let v = 0; v < normals.length; v += 3) {
      const length = Math.hypot(normals[v], normals[v + 1], normals[v + 2]) || 1;
      for (let c = 0; c < 3; c++) normals[v + c] /= length;
    }
    return normals;
  }

  // Rounding would hide edges that lie in the faces, so they are drawn a little above them: on the
  // outside of a closed surface, else on both sides.
  function edgeTrace(mesh, ends, line) {
    const normals = normalsOf(mesh);
    const count = ends[0].length;
    const at = [0, 1, 2].map(() => new Float32Array(3 * mesh.sides.length * count).fill(NaN));
    mesh.sides.forEach((side, turn) => {
      const lifted = mesh.vertices.map((x, i) => x + side * LIFT * normals[i]);
      for (let k = 0; k < count; k++) {
        const start = 3 * (turn * count + k); // the third point stays NaN: no line to the next edge
        for (let c = 0; c < 3; c++) {
          at[c][start] = lifted[3 * ends[0][k] + c];
          at[c][start + 1] = lifted[3 * ends[1][k] + c];
        }
      }
    });
    return {
      type: "scatter3d", mode: "lines", x: at[0], y: at[1], z: at[2], connectgaps: false,
      hoverinfo: "skip", line,
    };
  }

  // Curves that were kept, in red.
  function curveTrace(mesh) {
    const ends = [0, 1].map((c) => mesh.curves.filter((_, at) => at % 2 === c));
    return edgeTrace(mesh, ends, { color: style("--kept"), width: 4 });
  }

  // Thin lines, fainter where they are too dense to tell apart.
  function wire(mesh, view) {
    const { vertices, faces } = mesh;
    let total = 0;
    for (let h = 0; h < faces.length; h += 3) {
      const a = 3 * faces[h], b = 3 * faces[h + 1];
      total += Math.hypot(...[0, 1, 2].map((c) => vertices[a + c] - vertices[b + c]));
    }
    const pixels = total / (faces.length / 3) * view.clientHeight / 2;
    const alpha = Math.min(Math.max(pixels / 12, 0.35), 0.8);
    return { color: `rgba(${style("--wire")}, ${alpha.toFixed(2)})`, width: pixels > 40 ? 2 : 1 };
  }

  function faceTrace(mesh, colouring) {
    const [x, y, z] = columns(mesh.vertices);
    const [i, j, k] = columns(mesh.faces);
    return {
      type: "mesh3d", x, y, z, i, j, k, hoverinfo: "skip", showscale: false, flatshading: true,
      intensitymode: "cell", ...colours(mesh, colouring),
      lightposition: { x: -30, y: 90, z: -1 }, // beside the eye, which it follows
      lighting: {
        ambient: 0.55, diffuse: 0.5, specular: 0.03, roughness: 0.9, fresnel: 0,
        facenormalsepsilon: 0, vertexnormalsepsilon: 1e-12,
      },
    };
  }

  const stops = (list) => list.map((colour, k) => [k / (list.length - 1), colour]);

  function colours(mesh, colouring) {
    return {
      intensity: Array.from(mesh.levels[colouring.key], (level) => level / 255),
      cmin: 0, cmax: 1, colorscale: stops(colouring.colours),
    };
  }

  // The camera of the first view, moved until everything fits into a picture of this shape: the lens
  // sees 45 degrees upwards, and what is near looks larger. Plotly's cube, from -1 to 1 for us, has
  // edges of length 1 for its camera.
  function firstCamera(view) {
    const { right, up, eye } = scene.camera;
    const top = 0.95 * Math.tan(Math.PI / 8), side = top * view.clientWidth / view.clientHeight;
    let distance = 2, x = 0, y = 0;
    for (let round = 0; round < 6; round++) {
      const [west, east, south, north] = onScreen(x, y, distance);
      x += (west + east) / 2 * distance;
      y += (south + north) / 2 * distance;
      distance *= Math.max((east - west) / 2 / side, (north - south) / 2 / top, 0.3);
    }
    const centre = [0, 1, 2].map((c) => x * right[c] + y * up[c]);
    const named = ([a, b, c]) => ({ x: a, y: b, z: c });
    return {
      eye: named(centre.map((m, c) => m + distance * eye[c])), up: named(up), center: named(centre),
    };
  }

  // How far the object reaches to the left, right, down and up as seen from there, in slopes.
  function onScreen(x, y, distance) {
    const { right, up, eye } = scene.camera;
    const dot = (v, at, axis) => (v[at] * axis[0] + v[at + 1] * axis[1] + v[at + 2] * axis[2]) / 2;
    const reach = [Infinity, -Infinity, Infinity, -Infinity];
    for (const { vertices } of meshes) {
      for (let v = 0; v < vertices.length; v += 3) {
        const depth = Math.max(distance - dot(vertices, v, eye), 0.05);
        const across = (dot(vertices, v, right) - x) / depth, upwards = (dot(vertices, v, up) - y) / depth;
        reach[0] = Math.min(reach[0], across);
        reach[1] = Math.max(reach[1], across);
        reach[2] = Math.min(reach[2], upwards);
        reach[3] = Math.max(reach[3], upwards);
      }
    }
    return reach.every(Number.isFinite) ? reach : [-1, 1, -1, 1];
  }

  function viewLayout(view) {
    const axis = { visible: false, range: [-1.01, 1.01], autorange: false };
    return {
      margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)",
      scene: {
        xaxis: axis, yaxis: axis, zaxis: axis, aspectmode: "cube", dragmode: "orbit",
        hovermode: false, bgcolor: "rgba(0,0,0,0)", camera: firstCamera(view),
      },
    };
  }

  const views = ids.map((id) => document.getElementById(id));
  const cameraOf = (view) => view._fullLayout.scene._scene.getCamera();
  // Plotly gives a camera back with other rounding than it was set with.
  const same = (one, other) => ["eye", "center", "up"].every((what) =>
    ["x", "y", "z"].every((axis) => Math.abs(one[what][axis] - other[what][axis]) < 1e-6));

  // Turning one view turns the other; a view that already looks so is left alone, which ends the echo.
  function link(view, other) {
    let waiting = false;
    const follow = () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        const camera = cameraOf(view);
        if (!same(camera, cameraOf(other))) Plotly.relayout(other, { "scene.camera": camera });
      });
    };
    view.on("plotly_relayouting", follow);
    view.on("plotly_relayout", follow);
  }

  function showLegend(colouring) {
    const list = stops(colouring.colours).map(([at, colour]) => `${colour} ${100 * at}%`);
    document.getElementById("ramp").style.background = `linear-gradient(to right, ${list})`;
    document.getElementById("meaning").textContent = colouring.title;
    const ticks = document.getElementById("ticks");
    ticks.replaceChildren(...colouring.ticks.map((text) => {
      const tick = document.createElement("span");
      tick.textContent = text;
      return tick;
    }));
  }

  function choose(colouring) {
    showLegend(colouring);
    return Promise.all(views.map((view, k) => {
      const { intensity, colorscale } = colours(meshes[k], colouring);
      return Plotly.restyle(view, { intensity: [intensity], colorscale: [colorscale] }, [0]);
    }));
  }

  function addColourings() {
    const box = document.getElementById("colourings");
    scene.colourings.forEach((colouring, k) => {
      const label = document.createElement("label");
      const input = document.createElement("input");
      Object.assign(input, { type: "radio", name: "colouring", value: colouring.key, checked: !k });
      input.addEventListener("change", () => choose(colouring));
      label.title = colouring.title;
      label.append(input, colouring.name);
      box.append(label);
    });
    showLegend(scene.colourings[0]);
  }

  function addControls() {
    const edges = document.getElementById("edges");
    if (scene.edges) {
      edges.addEventListener("change", () =>
        views.forEach((view) => Plotly.restyle(view, { visible: edges.checked }, [1])));
    } else {
      edges.parentElement.remove();
    }
    document.getElementById("reset").addEventListener("click", () =>
      views.forEach((view) => Plotly.relayout(view, { "scene.camera": firstCamera(view) })));
  }

  async function drawView(view, mesh) {
    const traces = [faceTrace(mesh, scene.colourings[0])];
    if (scene.edges) traces.push(edgeTrace(mesh, edgesOf(mesh), wire(mesh, view)));
    if (mesh.curves.length) traces.push(curveTrace(mesh));
    await Plotly.newPlot(view, mesh.faces.length ? traces : [], viewLayout(view), config);
  }

  function bars(chart, k) {
    return {
      type: "bar", name: ["before", "after"][k], x: chart.centres, y: chart.percent[k],
      width: chart.width, customdata: chart.counts[k], opacity: 0.62,
      marker: { color: style(["--before", "--after"][k]), line: { width: 0 } },
      hovertemplate: "%{y:.1f} % (%{customdata:,})",
    };
  }

  function chartLayout(chart) {
    const axis = { gridcolor: style("--rule"), zeroline: false, fixedrange: true, automargin: true };
    const line = { color: style("--faint"), width: 1.5, dash: "dash" };
    return {
      barmode: "overlay", bargap: 0, showlegend: false, hovermode: "x unified",
      margin: { l: 45, r: 10, t: 30, b: 40 },
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: style("--ink") },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      hoverlabel: { bgcolor: style("--card") },
      title: { text: chart.name, font: { size: 15 }, x: 0, xref: "paper", y: 0.97, yanchor: "top" },
      xaxis: {
        ...axis, showgrid: false, title: { text: chart.axis },
        ...(chart.whole ? { dtick: 1 } : {}),
      },
      yaxis: { ...axis, ticksuffix: " %", rangemode: "tozero" },
      shapes: [{
        type: "line", x0: chart.ideal, x1: chart.ideal, y0: 0, y1: 1, yref: "paper", line,
      }],
    };
  }

  function drawCharts() {
    return Promise.all(charts.map((chart, k) => {
      const id = `chart-${k}`;
      let place = document.getElementById(id);
      if (!place) {
        place = Object.assign(document.createElement("div"), { id });
        document.getElementById("charts").append(place);
      }
      return Plotly.react(place, [bars(chart, 0), bars(chart, 1)], chartLayout(chart), config);
    }));
  }

  function followTheme() {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      drawCharts();
      if (scene.edges) {
        views.forEach((view, k) =>
          Plotly.restyle(view, { "line.color": wire(meshes[k], view).color }, [1]));
      }
    });
  }

  // Let the browser show each part when it is ready: text at once, then charts, then one view at a time.
  const pause = () => new Promise((done) => setTimeout(done, 20));

  async function draw() {
    addColourings();
    await pause();
    await drawCharts();
    for (const [k, view] of views.entries()) {
      await pause();
      await drawView(view, meshes[k]);
    }
    link(views[0], views[1]);
    link(views[1], views[0]);
    addControls();
    followTheme();
    document.documentElement.dataset.state = "drawn"; // what the tests wait for
  }

  draw();
})();
