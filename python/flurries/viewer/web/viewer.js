// The viewer's page: sliders, a picture that follows them, and the charts. The same in a notebook
// and in a browser; only how a question reaches Python differs (`ask`).

const CHARTS_EVERY = 2;   // pictures for each drawing of the charts while something moves
const IN_FLIGHT = 2;
// Groups of rows besides the effects, in their order.
const TITLES = { scene: "Scene", camera: "Camera", lens: "Lens blur", lamp: "A lamp" };

function element(kind, name, parent, text) {
  const made = document.createElement(kind);
  if (name) made.className = name;
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

function shown(control, value) {
  const digits = control.step >= 1 ? 0 : control.step >= 0.1 ? 1 : 2;
  const unit = control.unit === "°" ? "°" : control.unit ? ` ${control.unit}` : "";
  return `${Number(value).toFixed(digits)}${unit}`;
}

// ask(question) -> Promise of {head, buffers: [ArrayBuffer or DataView or Uint8Array]}
export function mount(root, about, ask) {
  root.classList.add("flurries");
  root.replaceChildren();
  const values = {}, state = { t: about.fps, playing: true, at: [0.5, 0.5], effect: Math.max(about.textured.indexOf(true), 0), under: 0, begin: true, turn: 0.6, tilt: 0.38 };
  let flying = 0, asked = 0, newest = 0, dirty = true, gone = false, chart = null, charted = false, last = 0, heldUntil = 0, clock = performance.now();
  // Where the sliders stood before each move of one; and how each row shows where it stands.
  const past = [], rows = [];
  let moving = null;
  const remember = (key) => { if (key !== moving) past.push({ ...values }); moving = key; };
  const stand = (wantedValues) => {
    const looks = (all) => JSON.stringify(Object.entries(all).filter(([key]) => key.endsWith(".preset")).sort());
    const same = looks(values) === looks(wantedValues);
    for (const key of Object.keys(values)) delete values[key];
    Object.assign(values, wantedValues);
    if (same) rows.forEach((row) => row()); else describe();
    moving = null;
    wanted();
  };
  const pace = [], page = Math.random().toString(36).slice(2);

  const stage = element("div", "fl-stage", root);
  const frame = element("div", "fl-frame", stage);
  const canvas = element("canvas", "fl-picture", frame);
  // A tall picture must leave room for the sliders.
  if (about.height > about.width) frame.style.maxWidth = `${Math.round(560 * about.width / about.height)}px`;
  canvas.width = about.width;
  canvas.height = about.height;
  const brush = canvas.getContext("2d");
  const marker = element("div", "fl-tile", frame);
  const bar = element("div", "fl-bar", frame);
  const play = element("button", "fl-play", bar, "❚❚");
  play.title = "Play or stop";
  const time = element("input", "fl-time", bar);
  Object.assign(time, { type: "range", min: 0, max: Math.max(about.frames || 0, Math.round(20 * about.fps)), step: 1, value: state.t });
  time.setAttribute("aria-label", "Frame");
  const clockText = element("span", "fl-clock", bar);
  const save = element("button", "fl-save", bar, "Save TOML");
  save.title = `Write the scene to ${about.save}`;
  const status = element("div", "fl-status", frame);

  const side = element("div", "fl-charts", stage);
  side.hidden = marker.hidden = !about.textured.includes(true);
  const spectrumHead = element("div", "fl-title", side, "Spectrum of a tile");
  spectrumHead.title = "Power of each wave over horizontal and vertical frequency, 24 dB from dark to white. Click the picture to choose a tile.";
  const spectrum = element("canvas", "fl-spectrum", side);
  const tentHead = element("div", "fl-title", side, "Its tent");
  tentHead.title = "Temporal frequency of each wave. Red: too fast for the frame rate. Drag to turn it.";
  const tent = element("canvas", "fl-tent", side);
  const note = element("div", "fl-note", side);

  const tools = element("div", "fl-tools", root);
  const undo = element("button", "fl-undo", tools, "Undo");
  const reset = element("button", "fl-reset", tools, "Reset");
  const code = element("button", "fl-code", tools, "Copy Python");
  const film = element("button", "fl-film", tools, "3 s film");
  film.title = "Write three seconds as an .mp4 beside the scene file";
  const panel = element("div", "fl-panel", root);
  let controls = about.controls;

  // Rows for what can be tuned; made anew where another look has other sliders.
  function build() {
    panel.replaceChildren();
    rows.length = 0;
    for (const group of [...about.effects, ...Object.keys(TITLES)]) {
      const own = controls.filter((control) => control.group === group);
      if (!own.length) continue;
      const box = element("fieldset", "fl-group", panel);
      element("legend", "", box, TITLES[group] || group);
      for (const control of own) {
        const row = element("label", "fl-row", box);
        row.dataset.row = control.key;
        element("span", "fl-name", row, control.label);
        (control.kind === "slider" ? slide : control.kind === "color" ? paint : pick)(control, row);
      }
    }
  }

  function touch(control, value) {
    values[control.key] = value;
    const effect = about.effects.indexOf(control.group);
    if (effect >= 0) state.under = effect;
    if (about.textured[effect]) state.effect = effect;
    wanted();
  }

  function slide(control, row) {
    const slider = element("input", "fl-slider", row);
    Object.assign(slider, { type: "range", min: control.low, max: control.high, step: control.step, value: values[control.key] ?? control.value });
    slider.dataset.key = control.key;
    slider.title = "Double-click to take it back";
    const number = element("output", "fl-value", row);
    const show = () => { number.textContent = shown(control, values[control.key] ?? control.value); row.classList.toggle("fl-touched", control.key in values); };
    show();
    rows.push(() => { slider.value = values[control.key] ?? control.value; show(); });
    slider.addEventListener("change", () => { moving = null; });
    slider.addEventListener("input", () => {
      remember(control.key);
      touch(control, Math.min(Math.max(Number(slider.value), control.low), control.high));
      show();
    });
    slider.addEventListener("dblclick", () => { remember(control.key); moving = null; delete values[control.key]; slider.value = control.value; show(); wanted(); });
  }

  function choices(names, row, key) {
    const list = element("select", "fl-choice", row);
    for (const name of names) element("option", "", list, name).value = name;
    list.dataset.key = key;
    return list;
  }

  function pick(control, row) {
    const list = choices(control.choices, row, control.key);
    rows.push(() => { list.value = values[control.key] ?? control.value; row.classList.toggle("fl-touched", control.key in values); });
    rows.at(-1)();
    list.addEventListener("change", () => {
      remember(control.key);
      moving = null;
      const place = control.key.match(/^(\d+\.)preset$/);
      // Another look: what was tuned of the one before is gone with it.
      if (place) for (const key of Object.keys(values)) if (key.startsWith(place[1])) delete values[key];
      touch(control, list.value);
      if (place) describe(); else rows.forEach((row) => row());
    });
  }

  const OWN = "own color";
  function paint(control, row) {
    const list = control.choices.length ? choices([...control.choices, OWN], row, `${control.key}.word`) : element("span", "", row);
    const picker = element("input", "fl-color", row);
    picker.type = "color";
    picker.dataset.key = control.key;
    rows.push(() => {
      const now = values[control.key] ?? control.value, own = now.startsWith("#");
      if (own) picker.value = now;
      list.value = own ? OWN : now;
      row.classList.toggle("fl-touched", control.key in values);
    });
    picker.value = "#ffffff";
    rows.at(-1)();
    const put = (value) => { touch(control, value); rows.forEach((row) => row()); };
    list.addEventListener("change", () => { remember(control.key); moving = null; put(list.value === OWN ? picker.value : list.value); });
    picker.addEventListener("input", () => { remember(control.key); put(picker.value); });
    picker.addEventListener("change", () => { moving = null; });
  }

  // Rows that change nothing now are grey, and say why.
  let inert = {};
  function grey() {
    for (const row of panel.querySelectorAll(".fl-row")) {
      const why = inert[row.dataset.row] || "";
      row.classList.toggle("fl-inert", why !== "");
      row.title = why && `Changes nothing now: ${why}`;
    }
  }

  async function describe() {
    const { head: answer } = await ask({ kind: "describe", values });
    if (answer.error) return fail(answer.error);
    controls = answer.controls;
    build();
    grey();
  }
  build();

  function wanted() { dirty = true; pump(); }

  // Two questions are on their way at a time: Python makes one picture while another is shown.
  function pump() {
    while (!gone && flying < IN_FLIGHT && (dirty || state.playing)) send();
    // The last picture of a drag has its charts.
    if (!flying && !gone && chart && !charted) wanted();
    root.dataset.idle = String(!flying && !dirty && !state.playing);
  }

  async function send() {
    const order = ++asked, now = performance.now();
    flying++;
    dirty = false;
    if (state.playing) {
      state.t += Math.min((now - clock) / 1000, 0.25) * about.fps;
      if (state.t > Number(time.max)) { state.t = 0; state.begin = true; }
    }
    clock = now;
    try {
      const charts = !chart || order % CHARTS_EVERY === 0 || !flying;
      const question = { kind: "frame", t: state.t, values, page, begin: state.begin, at: state.at, effect: state.under, chart: state.effect, charts };
      state.begin = false;
      const answer = await ask(question);
      if (answer.head.error) fail(answer.head.error); else await put(answer, order, charts);
    } catch (error) {
      state.playing = false;
      play.textContent = "▶";
      fail(`no answer: ${error.message || error}`);
    }
    flying--;
    // A hidden page gets no animation frames, and must not keep the machine busy.
    if (document.hidden) requestAnimationFrame(pump); else pump();
  }

  async function put({ head: found, buffers }, order, charts) {
    const picture = await createImageBitmap(new Blob([buffers[0]], { type: "image/jpeg" }));
    // Overtaken by a later one.
    if (order < newest) return;
    newest = order;
    inert = found.inert;
    grey();
    brush.drawImage(picture, 0, 0, canvas.width, canvas.height);
    picture.close();
    charted = charts;
    time.value = found.t;
    clockText.textContent = `frame ${Math.round(found.t)}`;
    if (found.chart) {
      // Copied: what arrives need not begin at a multiple of four.
      const floats = (part) => new Float32Array(new Uint8Array(part.buffer || part, part.byteOffset || 0, part.byteLength).slice().buffer);
      chart = { ...found.chart, rate: floats(buffers[1]), power: floats(buffers[2]) };
      redraw();
    } else if (charts && !found.chart) chart = null;
    side.classList.toggle("fl-none", !chart);
    // Between one picture and the next, while they follow each other.
    const now = performance.now();
    if (now - last < 1000) pace.push(now - last);
    last = now;
    if (pace.length > 20) pace.shift();
    const mean = pace.reduce((a, b) => a + b, 0) / Math.max(pace.length, 1);
    root.dataset.pictures = Number(root.dataset.pictures || 0) + 1;
    root.dataset.pace = mean.toFixed(2);
    if (now < heldUntil) return;
    status.textContent = (pace.length > 4 ? `${(1000 / mean).toFixed(0)} pictures/s · ` : "") + `${found.ms.toFixed(0)} ms in Python`;
    status.title = found.strength;
    status.classList.remove("fl-error");
  }

  function redraw() {
    if (!chart) return;
    const width = side.clientWidth || 240;
    drawSpectrum(spectrum, chart, Math.min(width, 232));
    drawTent(tent, chart, width, 200, state.turn, state.tilt);
    const [left, top, size] = chart.tile, sx = 100 / about.width, sy = 100 / about.height;
    Object.assign(marker.style, {
      left: `${left * sx}%`, top: `calc((100% - var(--fl-below)) * ${top / about.height})`,
      width: `${Math.min(size, about.width - left) * sx}%`,
      height: `calc((100% - var(--fl-below)) * ${Math.min(size, about.height - top) / about.height})`,
    });
    const [vx, vy] = chart.velocity, few = (v) => v.toFixed(Math.abs(v) < 10 ? 2 : 1);
    note.textContent = `${few(chart.band[0])}–${few(chart.band[1])} px · longest wave ${few(Math.hypot(vx, vy))} px/frame · ` +
      `${Math.round(100 * chart.kept)} % of the power left`;
  }

  function fail(text) {
    heldUntil = performance.now() + 5000;
    status.textContent = text;
    status.classList.add("fl-error");
  }

  play.addEventListener("click", () => {
    state.playing = !state.playing;
    play.textContent = state.playing ? "❚❚" : "▶";
    clock = performance.now();
    wanted();
  });
  time.addEventListener("input", () => { state.t = Number(time.value); wanted(); });
  canvas.addEventListener("pointerdown", (event) => {
    const box = canvas.getBoundingClientRect();
    state.at = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    chart = null;
    wanted();
  });
  tent.addEventListener("pointerdown", (event) => {
    tent.setPointerCapture(event.pointerId);
    const start = { x: event.clientX, y: event.clientY, turn: state.turn, tilt: state.tilt };
    const move = (next) => {
      state.turn = start.turn + (next.clientX - start.x) / 80;
      state.tilt = Math.min(Math.max(start.tilt + (next.clientY - start.y) / 120, 0.1), 1.4);
      redraw();
    };
    tent.addEventListener("pointermove", move);
    tent.addEventListener("pointerup", () => tent.removeEventListener("pointermove", move), { once: true });
  });
  undo.addEventListener("click", () => { if (past.length) stand(past.pop()); });
  reset.addEventListener("click", () => { past.push({ ...values }); stand({}); });
  code.addEventListener("click", async () => {
    const { head: answer } = await ask({ kind: "python", values });
    if (answer.error) return fail(answer.error);
    root.dataset.python = answer.text;
    try { await navigator.clipboard.writeText(answer.text); } catch { return fail(answer.text); }
    code.textContent = "Copied";
    setTimeout(() => { code.textContent = "Copy Python"; }, 1500);
  });
  film.addEventListener("click", async () => {
    film.disabled = true;
    film.textContent = "Writing";
    try {
      const { head: answer } = await ask({ kind: "film", values }, 120000);
      if (answer.error) fail(answer.error); else { root.dataset.film = answer.film; film.title = answer.film; }
    } finally {
      film.disabled = false;
      film.textContent = "3 s film";
    }
  });
  save.addEventListener("click", async () => {
    const { head: answer } = await ask({ kind: "save", values });
    if (answer.error) return fail(answer.error);
    save.textContent = "Saved";
    save.title = `${answer.saved}\n\n${answer.text}`;
    root.dataset.saved = answer.saved;
    setTimeout(() => { save.textContent = "Save TOML"; }, 1500);
  });

  pump();
  return () => { gone = true; };
}

// In a notebook anywidget calls this.
export default {
  render({ model, el }) {
    const waiting = new Map();
    let last = 0;
    const heard = (message, buffers) => {
      const settle = waiting.get(message.id);
      waiting.delete(message.id);
      if (settle) settle({ head: message.head, buffers });
    };
    model.on("msg:custom", heard);
    const ask = (question, patience = 15000) => new Promise((resolve, reject) => {
      const id = `${Date.now()}-${last++}`;
      waiting.set(id, resolve);
      setTimeout(() => waiting.delete(id) && reject(new Error("the kernel is busy or gone")), patience);
      model.send({ id, ask: question });
    });
    const stop = mount(el, model.get("about"), ask);
    return () => { stop(); model.off("msg:custom", heard); };
  },
};
