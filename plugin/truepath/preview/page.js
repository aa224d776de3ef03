// Feeds the recorded scene to meshcat's viewer and connects what can be pressed.
const element = (id) => document.getElementById(id);
const ARRAYS = { f4: Float32Array, u4: Uint32Array };

function bytesOf(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let k = 0; k < binary.length; k += 1) bytes[k] = binary.charCodeAt(k);
  return bytes;
}

function revived(key, value) {
  return value && value.binary ? new ARRAYS[value.binary](bytesOf(value.base64).buffer) : value;
}

function start() {
  const data = JSON.parse(element("scene-data").textContent, revived);
  let viewer;
  try {
    viewer = new MeshCat.Viewer(element("meshcat-pane"));
  } catch (error) {
    element("no-webgl").hidden = false;
    element("playback").dataset.still = "";
    element("stage").hidden = true;
    return;
  }
  viewer.renderer.shadowMap.enabled = false; // hardly to be seen here, and a third of the work of a frame
  const chunks = data.chunks.map(bytesOf);
  for (const parts of data.commands) {
    const command = new Uint8Array(parts.reduce((length, k) => length + chunks[k].length, 0));
    let offset = 0;
    for (const k of parts) {
      command.set(chunks[k], offset);
      offset += chunks[k].length;
    }
    viewer.handle_command_bytearray(command);
  }
  const camera = makeCamera(viewer, element("meshcat-pane"), data.views);
  for (const when of ["load", "resize"]) window.addEventListener(when, camera.place);
  new ResizeObserver(camera.place).observe(element("meshcat-pane"));
  for (const button of document.querySelectorAll("#views button")) {
    button.addEventListener("click", () => camera.look(button.dataset.view));
  }
  connectLayers(viewer, data, camera);
  connectPlayback(viewer, data);
  connectPrinter(viewer);
  camera.place();
  viewer.render();
  document.body.dataset.ready = "";
}

function connectLayers(viewer, data, camera) {
  const show = (path, visible) => {
    viewer.scene_tree.find([data.root, ...path]).set_property("visible", visible);
    viewer.set_dirty();
  };
  for (const box of document.querySelectorAll(".layers input[data-nodes]")) {
    const apply = () => {
      show([box.dataset.nodes], box.checked);
      if (box.dataset.nodes === data.region) camera.include(box.checked);
    };
    box.addEventListener("change", apply);
    apply();
  }
  const byError = element("by-error");
  const colour = () => {
    document.body.classList.toggle("by-error", byError.checked);
    for (const name of data.two_looks) {
      show([name, "by_error"], byError.checked);
      show([name, "plain"], !byError.checked);
    }
  };
  byError.addEventListener("change", colour);
  colour();
}

function connectPlayback(viewer, data) {
  const [play, scrubber, place, statement] = ["play", "scrubber", "place", "statement"].map(element);
  const millimetres = (value) => `${value.toFixed(2)} mm`;
  const count = data.waypoints.length;
  const expectedAt = (k) =>
    data.expected_mm === null || data.outside[k] ? "not known" : `${millimetres(data.expected_mm)} expected`;
  const playback = makePlayback(viewer, data, (now) => {
    const next = Math.ceil(now.waypoint - 1e-3); // the statement at which the robot works
    scrubber.value = now.waypoint + 1;
    play.textContent = now.playing ? "Pause" : "Play";
    const line = data.lines ? ` · line ${data.lines[next]}` : "";
    place.textContent = `Waypoint ${next + 1} of ${count}${line}`;
    statement.textContent = data.labels[next] || "";
    statement.hidden = !statement.textContent;
    element("error-here").textContent =
      `Error ${millimetres(now.uncorrected_mm)} → ${expectedAt(next)}`;
  });
  const goTo = playback.goToWaypoint;
  play.addEventListener("click", () => playback.play(!playback.isPlaying()));
  scrubber.addEventListener("input", () => goTo(Number(scrubber.value) - 1));
  element("before").addEventListener("click", () => goTo(Math.ceil(playback.waypoint() - 1e-3) - 1));
  element("next").addEventListener("click", () => goTo(Math.floor(playback.waypoint() + 1e-3) + 1));
  for (const button of document.querySelectorAll("[data-waypoint]")) {
    button.addEventListener("click", () => {
      goTo(Number(button.dataset.waypoint) - 1);
      element("stage").scrollIntoView({ block: "nearest" });
    });
  }
  if (!playback.moves) element("playback").dataset.still = "";
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  playback.play(playback.moves && !calm);
}

function connectPrinter(viewer) {
  // A canvas is blank on paper: a picture stands in for it.
  const picture = element("picture");
  window.addEventListener("beforeprint", () => {
    picture.src = viewer.capture_image();
    picture.hidden = false;
  });
  window.addEventListener("afterprint", () => { picture.hidden = true; });
}

start();
