// On every chart over time: drag and wheel zoom, clicks set cursors A and B, a double click shows all; a bar at the
// chart's corner and the box of the cursors ask the app for the rest.  Live charts (uPlot) have "t [s]" as their first
// series; figures (Plotly) are marked.  Where a name in viser's page has changed, the charts are as without it.
(() => {
  window.emavizMeasure?.end();
  const heard = new AbortController(), on = { capture: true, signal: heard.signal };
  const make = (name, parent = document.body, tag = 'div') => {
    const one = document.createElement(tag);
    one.className = `emaviz-${name}`;
    parent.append(one);
    return one;
  };
  const button = (parent, text, title, act) => {
    const one = make('measure-button', parent, 'button');
    one.textContent = text;
    one.title = title;
    one.addEventListener('click', act);
    return one;
  };

  // --- the charts of the page, live ones and figures alike ---
  const live = (over) => {
    for (const [id, { chart }] of Object.entries(window.__viserTestpoints?.uplots ?? {})) {
      if (chart.over !== over || chart.series[0]?.label !== 't [s]') continue;
      const { min, max } = chart.scales.x;
      return { key: `${id}:0`, over, parent: over, from: min, to: max, data: chart.data[0], at: () => ({
        left: 0, top: 0, width: over.clientWidth, height: over.clientHeight }) };
    }
    return null;
  };
  const figure = (over) => {
    const root = over.closest('.js-plotly-plot'), mark = root?.layout?.meta;
    const row = +(/^x(\d*)y/.exec(over.dataset.subplot)?.[1] || 1) - 1;
    const axis = root?._fullLayout?.[row ? `xaxis${row + 1}` : 'xaxis'];
    const side = root?._fullLayout?.[row ? `yaxis${row + 1}` : 'yaxis'];
    if (!mark?.chart || row >= (mark.rows ?? 1) || !axis?.range || !side) return null;
    const [from, to] = axis.range;
    return { key: `${mark.chart}:${row}`, over, parent: root, from, to, data: root.data, at: () => ({
      left: axis._offset, top: side._offset, width: axis._length, height: side._length }) };
  };
  const chartOf = (over) => (over.matches('.u-over') ? live(over) : figure(over));
  const OVER = '.u-over, .js-plotly-plot .nsewdrag';
  const shown = () => [...document.querySelectorAll(OVER)].filter(one => one.checkVisibility())
    .map(chartOf).filter(one => one);
  const under = (event) => {
    const over = event.target.closest?.(OVER);
    return over ? chartOf(over) : null;
  };
  const timeAt = (chart, event) => {
    const box = chart.over.getBoundingClientRect();
    const share = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    return chart.from + share * (chart.to - chart.from);
  };

  // --- what the app answers ---
  const ask = async (chart, what, more = {}) => {
    const query = new URLSearchParams({ chart: chart.key, do: what, ...more });
    try {
      const answer = await fetch(`/signals?${query}`, { headers: { 'X-Emaviz': '1' } });
      return answer.ok ? await answer.json() : null;
    } catch { return null; }  // the app has ended
  };
  let said = null;
  const tell = (chart, text) => {
    said?.remove();
    said = make('measure-note');
    said.textContent = text;
    const box = chart.over.getBoundingClientRect();
    said.style.left = `${box.left + 8}px`;
    said.style.top = `${box.top + 8}px`;
    const one = said;
    setTimeout(() => one.remove(), 4000);
  };

  // --- zoom: the app draws the window, with all points that there is room for ---
  let asking = false, wanted = null;  // the latest window waits for the answer to the one before
  const zoom = async (chart, range) => {
    wanted = { key: chart.key, chart, range, at: performance.now() };
    if (asking) return;
    asking = true;
    for (let one = null; one !== wanted;) {
      one = wanted;
      await ask(one.chart, 'zoom', one.range ? { from: one.range[0], to: one.range[1] } : {});
    }
    asking = false;
  };
  const window_ = (chart) => (wanted?.key === chart.key && wanted.range && performance.now() - wanted.at < 400
    ? wanted.range : [chart.from, chart.to]);
  let scrolled = -1e9;  // a panel that is being scrolled goes on where a chart comes under the pointer
  const wheel = (event) => {
    const chart = under(event);
    if (!chart || event.ctrlKey || event.metaKey || event.timeStamp - scrolled < 300) {
      scrolled = event.timeStamp;
      return;
    }
    event.preventDefault();
    event.stopPropagation();
    const box = chart.over.getBoundingClientRect(), [from, to] = window_(chart);
    const share = (event.clientX - box.left) / box.width, still = from + share * (to - from);
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
      const by = (to - from) * event.deltaX / box.width;
      zoom(chart, [from + by, to + by]);
      return;
    }
    const factor = Math.exp(Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 120) * 0.0025);
    zoom(chart, [still + (from - still) * factor, still + (to - still) * factor]);
  };
  const event_ = async (chart) => {
    const answer = await ask(chart, 'event');
    if (answer?.error) { tell(chart, answer.error); zoom(chart, null); }
  };

  // --- the pointer: a drag chooses a window, a click sets a cursor ---
  let cursors = { chart: null, a: null, b: null }, before = cursors, clicked = -1e9, down = null;
  const band = make('measure-band');
  const press = (event) => {
    if (event.button !== 0) return;
    const chart = under(event);
    if (!chart) return;
    event.preventDefault();
    if (event.type === 'mousedown') event.stopPropagation();  // Plotly's own zoom
    else down = { chart, x: event.clientX, time: timeAt(chart, event), moved: false };
  };
  const move = (event) => {
    if (!down) return;
    down.moved ||= Math.abs(event.clientX - down.x) > 4;
    if (!down.moved) return;
    const box = down.chart.over.getBoundingClientRect();
    const x = Math.min(box.right, Math.max(box.left, event.clientX));
    Object.assign(band.style, { display: 'block', left: `${Math.min(x, down.x)}px`, top: `${box.top}px`,
      width: `${Math.abs(x - down.x)}px`, height: `${box.height}px` });
  };
  const release = (event) => {
    if (!down) return;
    const { chart, time, moved } = down, to = timeAt(chart, event);
    down = null;
    band.style.display = 'none';
    if (event.type === 'pointercancel') return;
    if (moved) { if (to !== time) zoom(chart, [Math.min(time, to), Math.max(time, to)]); return; }
    if (event.timeStamp - clicked > 400) before = cursors;  // what a double click takes back
    clicked = event.timeStamp;
    setCursor(chart, time);
  };
  const double = (event) => {
    const chart = under(event);
    if (!chart) return;
    event.stopPropagation();
    event.preventDefault();
    cursors = before;
    zoom(chart, null);
    refresh();
  };
  const setCursor = (chart, time) => {
    const { a, b } = cursors;
    if (a === null) cursors = { chart, a: time, b: null };
    else if (b === null) cursors = { chart, a, b: time };
    else cursors = Math.abs(time - a) < Math.abs(time - b) ? { chart, a: time, b } : { chart, a, b: time };
    refresh();
  };
  const clear = () => { cursors = { chart: null, a: null, b: null }; refresh(); };

  // --- the box of the cursors ---
  const MINUS = '−';
  const number = (value) => {
    if (value === null || !Number.isFinite(value)) return '–';
    const size = Math.abs(value);
    return (size && (size < 1e-3 || size >= 1e5) ? value.toExponential(3) : String(+value.toPrecision(4)))
      .replace(/-/g, MINUS);
  };
  const movable = (box, head) => {
    head.addEventListener('pointerdown', (event) => {
      if (event.target.closest('button')) return;
      const from = box.getBoundingClientRect(), x = event.clientX - from.left, y = event.clientY - from.top;
      const go = (to) => {
        box.moved = true;
        box.style.left = `${Math.max(0, Math.min(innerWidth - 60, to.clientX - x))}px`;
        box.style.top = `${Math.max(0, Math.min(innerHeight - 30, to.clientY - y))}px`;
      };
      const end = () => { removeEventListener('pointermove', go); removeEventListener('pointerup', end); };
      addEventListener('pointermove', go);
      addEventListener('pointerup', end);
    });
  };
  const beside = (box, chart, top = 0) => {  // left of the chart, where there is room, as long as nobody has moved it
    if (box.moved) return;
    const at = chart.over.getBoundingClientRect(), size = box.getBoundingClientRect();
    const edge = (chart.over.closest('[data-dock-region=right]') ?? chart.over).getBoundingClientRect().left;
    const left = Math.min(at.left, edge) - size.width - 12;
    box.style.left = `${Math.max(8, left)}px`;
    box.style.top = `${Math.max(40, Math.min(at.top + top, innerHeight - 84 - size.height))}px`;
  };
  const box = make('measure-box'), head = make('measure-head', box), body = make('measure-body', box);
  const foot = make('measure-foot', box);
  box.setAttribute('role', 'region');
  box.setAttribute('aria-label', 'Cursors');
  movable(box, head);
  const range = () => ({ from: Math.min(cursors.a, cursors.b), to: Math.max(cursors.a, cursors.b) });
  const both = [
    button(foot, 'Zoom to A – B', 'The charts show what lies between the cursors', () => {
      const { from, to } = range();
      zoom(cursors.chart, [from, to]);
    }),
    button(foot, 'Spectrum of A – B', 'Amplitude against frequency between the cursors', () =>
      open(cursors.chart, 'spectrum', range())),
  ];
  button(foot, 'Remove', 'Takes the cursors away (Esc)', clear);
  let told = 0;
  const refresh = async () => {
    draw();
    const { chart, a, b } = cursors, turn = ++told;
    if (a === null) { box.style.display = 'none'; return; }
    const found = await ask(chart, 'read', b === null ? { a } : { a, b });
    if (turn !== told) return;
    if (!found || found.error) { box.style.display = 'none'; return; }
    head.textContent = `${found.title} [${found.unit}]`;
    body.replaceChildren();
    const times = make('measure-times', body);
    times.textContent = b === null ? `A ${number(a)} s. Click once more for B.`
      : `A ${number(a)} s   B ${number(b)} s   Δt ${number(b - a)} s   1/Δt ${number(1 / Math.abs(b - a))} Hz`;
    const table = make('measure-table', body, 'table');
    const heads = ['', 'A', ...(b === null ? [] : ['B', 'Δ', 'mean', 'rms', `slope ${found.unit}/s`])];
    const first = make('', table, 'tr');
    for (const text of heads) make('', first, 'th').textContent = text;
    for (const { name, colour, numbers } of found.rows) {
      const row = make('', table, 'tr'), cell = make('measure-name', row, 'td');
      cell.textContent = name;
      cell.style.borderLeft = `3px solid ${colour.slice(0, 7)}`;
      for (const value of numbers) make('', row, 'td').textContent = number(value);
    }
    for (const one of both) one.style.display = b === null ? 'none' : '';
    box.style.display = 'block';
    beside(box, chart);
  };

  // --- the cursors' lines, in every chart over time ---
  const line = (chart, name, time) => {
    const share = (time - chart.from) / (chart.to - chart.from), at = chart.at();
    if (!(share >= 0 && share <= 1)) return;
    const one = make('measure-line', chart.parent);
    one.dataset.name = name;
    Object.assign(one.style, { left: `${at.left + share * at.width}px`, top: `${at.top}px`, height: `${at.height}px` });
  };
  let drawn = '';
  const draw = () => {
    const charts = cursors.a === null ? [] : shown();
    const now = JSON.stringify([cursors.a, cursors.b, charts.map(one => [one.key, one.from, one.to, one.at(),
      one.parent.querySelectorAll(':scope > .emaviz-measure-line').length])]);
    if (now === drawn) return;
    document.querySelectorAll('.emaviz-measure-line').forEach(one => one.remove());
    for (const chart of charts) {
      line(chart, 'A', cursors.a);
      if (cursors.b !== null) line(chart, 'B', cursors.b);
    }
    drawn = JSON.stringify([cursors.a, cursors.b, charts.map(one => [one.key, one.from, one.to, one.at(),
      one.parent.querySelectorAll(':scope > .emaviz-measure-line').length])]);
  };

  // --- a spectrum or a difference, in a chart of its own ---
  const sheet = make('measure-sheet'), top = make('measure-head', sheet), place = make('measure-figure', sheet);
  const title = make('measure-title', top, 'span');
  let opened = null;
  movable(sheet, top);
  button(top, '×', 'Close', () => { opened = null; sheet.style.display = 'none'; });
  const open = (chart, what, range) => {
    opened = { chart, what, range };
    sheet.style.display = 'block';
    beside(sheet, chart);
    fill();
  };
  const fill = async () => {
    const now = opened, { chart, what, range } = now;
    const current = shown().find(one => one.key === chart.key) ?? chart;
    now.seen = [current.from, current.to, current.data];
    const found = await ask(chart, what, range ?? { from: current.from, to: current.to });
    if (opened !== now) return;
    title.textContent = { spectrum: range ? 'Spectrum between A and B' : 'Spectrum of what is shown',
      difference: 'Difference' }[what];
    if (!found || found.error || !window.Plotly) {
      window.Plotly?.purge(place);
      place.textContent = found?.error ?? 'No answer.';
      return;
    }
    if (!place.matches('.js-plotly-plot')) place.replaceChildren();
    await window.Plotly.react(place, found.data, { ...found.layout, width: place.clientWidth,
      height: place.clientHeight }, { displayModeBar: false });
  };

  // --- the bar at the corner of the chart under the pointer ---
  const bar = make('measure-bar');
  let at = null;
  button(bar, 'Event', 'Zooms to when something happens', () => at && event_(at));
  button(bar, 'All', 'Shows everything (double click)', () => at && zoom(at, null));
  button(bar, 'Spectrum', 'Amplitude against frequency of what is shown', () => at && open(at, 'spectrum'));
  button(bar, 'Δ', 'The difference of two lines in a chart of its own', () => at && open(at, 'difference'));
  const offer = (event) => {
    if (bar.contains(event.target) || event.target.id === 'emaviz-save-chart') return;
    const root = event.target.closest?.('.uplot, .js-plotly-plot');
    const over = event.target.closest?.(OVER) ?? root?.querySelector(OVER), chart = over && chartOf(over);
    bar.style.display = chart ? 'flex' : 'none';
    at = chart;
    if (!chart) return;
    const edge = root.getBoundingClientRect();
    bar.style.top = `${Math.max(edge.top + 3, 30)}px`;
    bar.style.right = `${innerWidth - edge.right + 54}px`;
  };

  // --- the play-head: an upright line in the charts of tabs whose moment the app tells.  It is no rule of a style sheet:
  //     where one changes, several times a second, the browser looks at the whole page again, and draws fewer poses ---
  const heads = () => {
    const share = document.querySelector('.emaviz-play-head')?.dataset.share ?? '';
    for (const mark of document.querySelectorAll('.emaviz-time')) {
      for (const over of mark.parentElement.parentElement.querySelectorAll('.u-over')) {
        const one = over.querySelector(':scope > .emaviz-play-line') ?? make('play-line', over);
        if (one.dataset.share === share) continue;
        one.dataset.share = share;
        one.style.left = `${share}%`;
        one.style.display = share ? '' : 'none';
      }
    }
  };
  const playing = setInterval(heads, 60);

  const key = (event) => { if (event.key === 'Escape' && cursors.a !== null) clear(); };
  let seen = null;
  const timer = setInterval(() => {
    draw();
    if (cursors.a !== null) {
      const chart = shown().find(one => one.key === cursors.chart.key);
      box.style.visibility = chart ? '' : 'hidden';  // its chart is on a tab that is not in front
      if (chart && chart.data !== seen) { seen = chart.data; refresh(); }
    }
    if (opened) {
      const chart = shown().find(one => one.key === opened.chart.key), was = opened.seen ?? [];
      sheet.style.visibility = chart ? '' : 'hidden';
      if (chart && [chart.from, chart.to, chart.data].some((one, i) => one !== was[i])) fill();
    }
  }, 250);
  document.addEventListener('pointerdown', press, on);
  document.addEventListener('mousedown', press, on);
  document.addEventListener('pointermove', move, on);
  document.addEventListener('pointerup', release, on);
  document.addEventListener('pointercancel', release, on);
  document.addEventListener('dblclick', double, on);
  document.addEventListener('wheel', wheel, { ...on, passive: false });
  document.addEventListener('mouseover', offer, on);
  document.addEventListener('keydown', key, on);
  window.emavizMeasure = { cursors: () => [cursors.a, cursors.b], end: () => {
    heard.abort();
    clearInterval(timer);
    clearInterval(playing);
    document.querySelectorAll('[class^=emaviz-measure], .emaviz-play-line').forEach(one => one.remove());
  } };
})();
