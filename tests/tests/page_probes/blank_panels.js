(async () => {
  const blank = [];
  // a chart draws when the present task is over
  const drawn = () => new Promise(r => setTimeout(r, 0));
  for (const [name, charts] of report.alive) for (const [i, c] of charts.entries()) {
    if (!c.plot) { if (!c.host.querySelector('svg').childElementCount) blank.push(name + '/' + i); continue; }
    const b = c.plot.bbox, look = () => new Uint32Array(c.plot.ctx.getImageData(b.left + 2, b.top + 2, b.width - 4, b.height - 4).data.buffer);
    const before = look(), marks = c.panel.marks;
    c.panel.marks = []; c.plot.redraw(); await drawn();
    const after = look();
    c.panel.marks = marks; c.plot.redraw(); await drawn();
    let differ = 0;
    for (let k = 0; k < after.length; k++) if (after[k] !== before[k]) differ++;
    if (differ < 40) blank.push(name + '/' + i + ': ' + differ);
  }
  return blank;
})()
