"""What every chart of the page can do: its values stand at the cursor, and a button saves it as a picture.

viser's charts take no functions from Python, so that a script on the page looks at them: live ones (uPlot), static ones
(Plotly), and pictures of ours in HTML.  Where a name in viser's page has changed, the charts are as without it.
"""

from __future__ import annotations

from emaviz.server.viser_private import Inside

_SCRIPT = r"""
(() => {
  window.emavizCharts?.end();
  const make = (css, parent = document.body) => {
    const one = document.createElement('div');
    one.style.cssText = css;
    parent.append(one);
    return one;
  };
  const ink = () => getComputedStyle(document.querySelector('[data-dock-region]') ?? document.body);
  const said = make('position:fixed;z-index:400;pointer-events:none;display:none;padding:3px 7px;white-space:nowrap;' +
    'border-radius:4px;font:12px/1.45 system-ui;font-variant-numeric:tabular-nums;box-shadow:0 1px 6px #0005');
  said.id = 'emaviz-values';
  const save = make('position:fixed;z-index:399;display:none;padding:1px 7px;border-radius:4px;cursor:pointer;' +
    'font:11px/1.6 system-ui;border:1px solid rgba(134,142,150,.5);opacity:.85');
  save.id = 'emaviz-save-chart';
  save.textContent = 'PNG';
  save.title = 'Save this chart as a picture';
  const KINDS = '.uplot, .js-plotly-plot, .emaviz-picture';
  let at = null;
  const live = (root) => Object.values(window.__viserTestpoints?.uplots ?? {}).map(u => u.chart)
    .find(chart => chart?.root === root);
  const shown = (value) => {
    const size = Math.abs(value);
    return (size && (size < 1e-3 || size >= 1e5) ? value.toExponential(3) : String(+value.toPrecision(4)))
      .replace(/-/g, '−');
  };
  const unit = (chart, scale) => /\[([^\]]*)\]/.exec(chart.axes.find(a => a.scale === scale)?.label ?? '')?.[1] ?? '';
  // a line that lies beneath another, as a frozen run that is none
  const hidden = (chart, s) => chart.data.some((line, other) => other > s && chart.series[other].width !== 0 &&
    line.length > 2 && line.every((value, i) => value === chart.data[s][i]));
  const told = (chart, s) => {
    const one = chart.series[s], colour = typeof one.stroke === 'function' ? one.stroke(chart, s) : one.stroke;
    return one.show !== false && one.width !== 0 && one.label && !/^#.{6}00$/.test(colour) && !hidden(chart, s)
      ? colour : null;
  };
  const tell = (event) => {
    const root = event.target.closest?.('.u-over')?.closest('.uplot'), chart = root && live(root);
    const i = chart?.cursor?.idx;
    if (i == null) { said.style.display = 'none'; return; }
    said.replaceChildren(...chart.series.flatMap((one, s) => {
      const value = chart.data[s]?.[i], colour = s && told(chart, s);
      if (value == null || colour === null) return [];
      const line = document.createElement('div'), [, label, of] = /^(.*?)\s*(?:\[(.*)\])?$/.exec(one.label ?? '');
      line.textContent = `${label}  ${shown(value)} ${of ?? unit(chart, one.scale)}`.trimEnd();
      if (s) line.style.cssText = `border-left:3px solid ${colour};padding-left:5px`;
      return [line];
    }));
    const look = ink();
    said.style.background = look.backgroundColor;
    said.style.color = look.color;
    said.style.display = 'block';
    const { width, height } = said.getBoundingClientRect();
    said.style.left = `${event.clientX + 16 + width > innerWidth ? event.clientX - 12 - width : event.clientX + 16}px`;
    said.style.top = `${Math.max(4, Math.min(event.clientY + 14, innerHeight - height - 4))}px`;
  };
  const offer = (event) => {
    if (event.target === save) return;
    at = event.target.closest?.(KINDS) ?? null;
    save.style.display = at ? 'block' : 'none';
    if (!at) return;
    const box = at.getBoundingClientRect(), look = ink();
    save.style.left = `${box.right - 48}px`;
    save.style.top = `${Math.max(box.top + 3, 30)}px`;
    save.style.background = look.backgroundColor;
    save.style.color = look.color;
  };
  const titled = (root) => (root.querySelector('.u-title, .gtitle, [aria-label]')?.textContent ||
    root.querySelector('[aria-label]')?.ariaLabel || 'chart').trim();
  const give = (canvas, name) => {
    const link = document.createElement('a');
    link.href = canvas.toDataURL('image/png');
    link.download = `emaviz ${name.replace(/[^\w.()+ -]+/g, ' ').trim() || 'chart'}.png`;
    link.click();
  };
  const sheet = (width, height, scale) => {
    const canvas = document.createElement('canvas'), look = ink();
    canvas.width = width * scale;
    canvas.height = height * scale;
    const pen = canvas.getContext('2d');
    pen.scale(scale, scale);
    pen.fillStyle = look.backgroundColor;
    pen.fillRect(0, 0, width, height);
    pen.fillStyle = look.color;
    return [canvas, pen];
  };
  const ofLive = (root, chart) => {
    const drawn = chart.ctx.canvas, box = drawn.getBoundingClientRect(), top = 24, below = 22;
    const [canvas, pen] = sheet(box.width, box.height + top + below, drawn.width / box.width);
    pen.font = '600 13px system-ui';
    pen.textAlign = 'center';
    pen.fillText(titled(root), box.width / 2, 16);
    pen.drawImage(drawn, 0, top, box.width, box.height);
    pen.font = '11px system-ui';
    pen.textAlign = 'left';
    let x = 10;
    chart.series.forEach((one, s) => {
      const colour = s && told(chart, s);
      if (!colour) return;
      pen.fillStyle = colour;
      pen.fillRect(x, box.height + top + 10, 14, 3);
      pen.fillStyle = ink().color;
      pen.fillText(one.label, x + 18, box.height + top + 15);
      x += 30 + pen.measureText(one.label).width;
    });
    give(canvas, titled(root));
  };
  const ofPicture = (root) => {
    const svg = root.querySelector('svg').cloneNode(true), box = root.querySelector('svg').getBoundingClientRect();
    svg.setAttribute('xmlns', 'http://www.w3.org/2000/svg');
    svg.setAttribute('width', box.width);
    svg.setAttribute('height', box.height);
    svg.setAttribute('style', `color:${ink().color}`);
    const picture = new Image();
    picture.onload = () => {
      const [canvas, pen] = sheet(box.width, box.height, 2);
      pen.drawImage(picture, 0, 0, box.width, box.height);
      give(canvas, titled(root));
    };
    picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(new XMLSerializer().serializeToString(svg))}`;
  };
  save.onclick = () => {
    if (!at?.isConnected) return;
    const name = `emaviz ${titled(at).replace(/[^\w.()+ -]+/g, ' ').trim()}`;
    if (at.matches('.js-plotly-plot'))
      window.Plotly?.downloadImage(at, { format: 'png', scale: 2, filename: name,
        width: at.clientWidth, height: at.clientHeight });
    else if (at.matches('.uplot')) ofLive(at, live(at));
    else ofPicture(at);
  };
  const hide = () => { said.style.display = 'none'; };
  document.addEventListener('mousemove', tell);
  document.addEventListener('mouseover', offer);
  document.addEventListener('mouseleave', hide);
  window.emavizCharts = { end: () => {
    document.removeEventListener('mousemove', tell);
    document.removeEventListener('mouseover', offer);
    document.removeEventListener('mouseleave', hide);
    said.remove();
    save.remove();
  } };
})();
"""


def add_chart_tools(inside: Inside) -> None:
    """In every page that is or will be open."""
    inside.run(_SCRIPT)
