// Where the graph's boxes lie: publishers left, topics in the middle, readers right; nodes near what they touch.

export const ROW = 22;
export const NODE = 26;

// `topics` are [{name, pubs, subs}]; gives the columns as Maps from name to y, and the height.
export function layout(topics) {
  const middle = new Map(topics.map((topic, index) => [topic.name, ROW / 2 + index * ROW]));
  const side = (end) => {
    const touched = new Map();
    for (const topic of topics) {
      for (const node of topic[end]) {
        if (!touched.has(node)) touched.set(node, []);
        touched.get(node).push(middle.get(topic.name));
      }
    }
    const wanted = [...touched].map(([node, ys]) => [node, ys.reduce((a, b) => a + b, 0) / ys.length]).sort((a, b) => a[1] - b[1] || (a[0] < b[0] ? -1 : 1));
    return new Map(apart(wanted.map(([, y]) => y)).map((y, index) => [wanted[index][0], y]));
  };
  const left = side("pubs"), right = side("subs");
  const lowest = Math.max(0, ...[...left.values(), ...right.values()].map((y) => y + NODE / 2), topics.length * ROW);
  return { left, middle, right, height: lowest + 4 };
}

// The nearest rising places that are NODE apart: those that would overlap share their mean.
function apart(wanted) {
  const groups = [];
  for (const y of wanted) {
    groups.push({ sum: y, count: 1, first: y - NODE / 2 });
    for (;;) {
      const last = groups[groups.length - 1], before = groups[groups.length - 2];
      last.first = Math.max(0, last.sum / last.count - (last.count * NODE) / 2);
      if (!before || before.first + before.count * NODE <= last.first) break;
      groups.pop();
      before.sum += last.sum;
      before.count += last.count;
    }
  }
  return groups.flatMap(({ first, count }) => Array.from({ length: count }, (_, i) => first + NODE / 2 + i * NODE));
}
