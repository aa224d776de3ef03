"use strict";
// Feeds the recorded scene to meshcat's viewer, points the camera, and runs the panel.
(() => {
  const FIELD_OF_VIEW_DEG = 32;
  const VIEW_MARGIN = 1.06;
  const data = JSON.parse(document.getElementById("scene-data").textContent);
  const element = (id) => document.getElementById(id);

  let viewer;
  try {
    viewer = new MeshCat.Viewer(element("meshcat-pane"));
  } catch (error) {
    element("no-webgl").hidden = false;
    element("playback").hidden = true;
    return;
  }
  const bytes = data.chunks.map((text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
  for (const parts of data.commands) {
    const command = new Uint8Array(parts.reduce((length, k) => length + bytes[k].length, 0));
    let offset = 0;
    for (const k of parts) {
      command.set(bytes[k], offset);
      offset += bytes[k].length;
    }
    viewer.handle_command_bytearray(command);
  }

  // Camera. The viewer's space has y up, the scene z; the panel's width is taken from the picture.
  const camera = viewer.camera;
  const { Vector3 } = MeshCat.THREE;
  const upright = ([x, y, z]) => new Vector3(x, z, -y);
  const points = data.view.points.map(upright);
  const direction = upright(data.view.direction).normalize();
  let moved = false;
  viewer.controls.addEventListener("start", () => { moved = true; });

  function place() {
    const [width, height] = [window.innerWidth, window.innerHeight];
    const covered = width > 760 ? element("panel").getBoundingClientRect().right : 0;
    viewer.set_3d_pane_size(width, height);
    camera.fov = FIELD_OF_VIEW_DEG;
    camera.setViewOffset(width, height, -covered / 2, 0, width, height);
    if (!moved) {
      fit((width - covered) / height);
    }
    viewer.set_dirty();
  }

  function fit(aspect) {
    const right = new Vector3(0, 1, 0).cross(direction).normalize();
    const up = direction.clone().cross(right);
    const seen = points.map((p) => [p.dot(right), p.dot(up), p.dot(direction)]);
    const tangent = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360) / VIEW_MARGIN;
    const slopes = [tangent * aspect, tangent];
    // Along each of right and up: the eye must be so far that the outermost points fit on both sides.
    const reach = slopes.map((slope, axis) => [
      Math.max(...seen.map((p) => p[axis] + slope * p[2])),
      Math.max(...seen.map((p) => -p[axis] + slope * p[2])),
    ]);
    const eye = reach.map(([a, b]) => (a - b) / 2);
    const depth = Math.max(...reach.map(([a, b], axis) => (a + b) / 2 / slopes[axis]));
    const middle = seen.reduce((sum, p) => sum + p[2], 0) / seen.length;
    const at = (z) => right.clone().multiplyScalar(eye[0]).addScaledVector(up, eye[1]).addScaledVector(direction, z);
    camera.position.copy(at(depth));
    viewer.controls.target.copy(at(middle));
    viewer.controls.update();
  }

  window.addEventListener("load", place);
  window.addEventListener("resize", place);
  requestAnimationFrame(place);

  // Legend: what is ticked is shown.
  for (const box of document.querySelectorAll(".legend input")) {
    box.addEventListener("change", () => {
      for (const name of box.dataset.nodes.split(" ")) {
        viewer.scene_tree.find([data.root, name]).set_property("visible", box.checked);
      }
      viewer.set_dirty();
    });
  }

  // Playback.
  const { animator } = viewer;
  const frames = data.frames;
  if (frames.time_s.length < 2) {
    element("playback").hidden = true;
    return;
  }
  const [play, scrubber] = [element("play"), element("scrubber")];
  scrubber.max = animator.duration;
  play.addEventListener("click", () => (animator.playing ? animator.pause() : animator.play()));
  scrubber.addEventListener("input", () => {
    animator.pause();
    animator.seek(Number(scrubber.value));
  });
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
    animator.pause();
  }

  const millimetres = (value) => `${value.toFixed(2)} mm`;
  function show() {
    const time = animator.actions[0].time;
    let k = frames.time_s.findIndex((t) => t >= time);
    k = k < 0 ? frames.time_s.length - 1 : k;
    const waypoint = Math.round(frames.waypoint[k]);
    const label = frames.labels[waypoint - 1];
    play.textContent = animator.playing ? "Pause" : "Play";
    scrubber.value = time;
    element("place").textContent = `Waypoint ${waypoint} of ${data.waypoints}${label ? ` · ${label}` : ""}`;
    element("error-here").textContent =
      `Error ${millimetres(frames.uncorrected_mm[k])} → ${millimetres(frames.corrected_mm[k])}`;
    requestAnimationFrame(show);
  }
  show();
})();
