(() => {
  const touching = [];
  for (const svg of document.querySelectorAll('.plot > svg:first-child')) {
    svg.closest('.plot').classList.remove('alive');
    const boxes = [...svg.querySelectorAll('text.tick, text.row')].map(t => [t.textContent, t.getBBox()]).filter(([t]) => t);
    boxes.forEach(([t, a], i) => boxes.slice(i + 1).forEach(([u, b]) => {
      if (a.x < b.x + b.width - 1 && b.x < a.x + a.width - 1 && a.y < b.y + b.height - 3 && b.y < a.y + a.height - 3) touching.push(svg.getAttribute('aria-label') + ': ' + t + ' | ' + u);
    }));
  }
  return touching;
})()
