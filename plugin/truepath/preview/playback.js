// Where the arms are: a fractional row of the path, from which waypoint, time and joints follow.
function between(values, value) {
  // The place of a value in an array that never falls, as a fractional index.
  let [low, high] = [0, values.length - 1];
  if (value <= values[0]) return 0;
  if (value >= values[high]) return high;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle; else high = middle;
  }
  return low + (value - values[low]) / (values[high] - values[low]);
}

function valueAt(values, index, stride = 1, column = 0) {
  const low = Math.floor(index);
  const high = Math.min(low + 1, values.length / stride - 1);
  const [a, b] = [values[low * stride + column], values[high * stride + column]];
  return a + (index - low) * (b - a);
}

function makePlayback(viewer, data, show) {
  const { Quaternion } = MeshCat.THREE;
  const { frames, waypoints } = data;
  const joints = data.joints.length / 4;
  const arms = data.arms.map((name, k) => {
    const inner = data.joint_nodes;
    const nodes = inner.map((_, i) => viewer.scene_tree.find([data.root, name, ...inner.slice(0, i + 1)]).object);
    return { nodes, q: k === 0 ? frames.q_corrected : frames.q_uncorrected };
  });
  const atZero = Array.from({ length: joints }, (_, i) => new Quaternion(...data.joints.subarray(4 * i, 4 * i + 4)));
  const turn = new Quaternion();
  let row = waypoints[0];
  let playing = false;
  let clock = 0;

  function goTo(newRow) {
    row = newRow;
    const at = between(frames.position, row);
    for (const { nodes, q } of arms) {
      nodes.forEach((node, i) => {
        const half = valueAt(q, at, joints, i) / 2;
        node.quaternion.copy(atZero[i]).multiply(turn.set(0, 0, Math.sin(half), Math.cos(half)));
      });
    }
    viewer.set_dirty();
    show({
      waypoint: between(waypoints, row),
      uncorrected_mm: valueAt(frames.uncorrected_mm, at),
      playing,
    });
  }

  function step(now) {
    if (!playing) return;
    const end = frames.time_s[frames.time_s.length - 1];
    let time = valueAt(frames.time_s, between(frames.position, row)) + Math.min((now - clock) / 1000, 0.5);
    clock = now;
    if (time > end) time = 0;
    goTo(valueAt(frames.position, between(frames.time_s, time)));
    requestAnimationFrame(step);
  }

  return {
    goToWaypoint(waypoint) {
      playing = false;
      goTo(valueAt(waypoints, Math.min(Math.max(waypoint, 0), waypoints.length - 1)));
    },
    waypoint: () => between(waypoints, row),
    play(on) {
      playing = on;
      clock = performance.now();
      goTo(row);
      if (on) requestAnimationFrame(step);
    },
    isPlaying: () => playing,
    moves: frames.time_s.length > 1,
  };
}
