// The camera. The viewer's space has y up, the scene's z.
const FIELD_OF_VIEW_DEG = 32;
const VIEW_MARGIN = 1.08;

function makeCamera(viewer, pane, views) {
  const { Vector3 } = MeshCat.THREE;
  const upright = ([x, y, z]) => new Vector3(x, z, -y);
  const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, k) => upright(flat.subarray(3 * k, 3 * k + 3)));
  const arm = triples(views.arm);
  const path = triples(views.path);
  const region = triples(views.region);
  const side = upright(views.direction).normalize();
  const kinds = {
    arm: [arm, side],
    path: [path, side],
    above: [arm, upright([1e-3 * views.direction[0], 1e-3 * views.direction[1], 1]).normalize()],
  };
  let withRegion = false;
  let chosen = "arm";
  let moved = false;
  viewer.controls.addEventListener("start", () => { moved = true; });

  function place() {
    const [width, height] = [pane.clientWidth, pane.clientHeight];
    if (!width || !height) return; // on paper, where a picture stands in for it
    viewer.set_3d_pane_size(width, height);
    viewer.camera.fov = FIELD_OF_VIEW_DEG;
    viewer.camera.near = 0.002;
    const [points, direction] = kinds[chosen];
    if (!moved) fit(withRegion && chosen !== "path" ? points.concat(region) : points, direction, width / height);
    viewer.set_dirty();
  }

  function fit(points, direction, aspect) {
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
    const middle = seen.reduce((sum, p) => sum + p[2], 0) / seen.length;
    const depth = Math.max(middle + 0.05, ...reach.map(([a, b], axis) => (a + b) / 2 / slopes[axis]));
    const at = (z) => right.clone().multiplyScalar(eye[0]).addScaledVector(up, eye[1]).addScaledVector(direction, z);
    viewer.camera.position.copy(at(depth));
    viewer.controls.target.copy(at(middle));
    viewer.controls.update();
  }

  return {
    place,
    include(shown) {
      withRegion = shown;
      place();
    },
    look(kind) {
      chosen = kind;
      moved = false;
      place();
    },
  };
}
