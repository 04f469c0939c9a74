// Drawing the spectrum and the tent of a tile. Together with viewer.js this is one module.

// Power in decibels below the strongest wave, dark to light.
const SHADES = [[14, 22, 34], [24, 52, 84], [44, 96, 138], [98, 156, 190], [184, 216, 232], [255, 255, 255]];
const FAST = [235, 110, 82];
const INK = "#9fb2c4", FAINT = "#33445a", ACCENT = "#ffb454";
const FLOOR_DB = 24;

function shade(power) {
  const place = Math.min(Math.max(1 + 10 * Math.log10(Math.max(power, 1e-9)) / FLOOR_DB, 0), 1) * (SHADES.length - 1);
  const low = Math.min(Math.floor(place), SHADES.length - 2), part = place - low;
  return SHADES[low].map((value, i) => Math.round(value + part * (SHADES[low + 1][i] - value)));
}

// A canvas whose lines are sharp on dense screens; the size is in CSS pixels.
function sheet(canvas, width, height) {
  const dense = Math.max(window.devicePixelRatio || 1, 1);
  if (canvas.width !== Math.round(width * dense)) {
    canvas.width = Math.round(width * dense);
    canvas.height = Math.round(height * dense);
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(dense, 0, 0, dense, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "11px system-ui, sans-serif";
  pen.lineWidth = 1;
  return pen;
}

function arrow(pen, x, y, dx, dy) {
  const length = Math.hypot(dx, dy);
  if (length < 3) return;
  const ux = dx / length, uy = dy / length;
  pen.strokeStyle = pen.fillStyle = ACCENT;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x + dx - 5 * ux, y + dy - 5 * uy);
  pen.stroke();
  pen.beginPath();
  pen.moveTo(x + dx, y + dy);
  pen.lineTo(x + dx - 9 * ux - 4 * uy, y + dy - 9 * uy + 4 * ux);
  pen.lineTo(x + dx - 9 * ux + 4 * uy, y + dy - 9 * uy - 4 * ux);
  pen.fill();
}

// The power of each wave; frequencies to the right and down, the motion as an arrow.
function drawSpectrum(canvas, chart, size) {
  const pen = sheet(canvas, size, size), { side, power, rate } = chart;
  const small = document.createElement("canvas");
  small.width = small.height = side;
  const brush = small.getContext("2d"), image = brush.createImageData(side, side);
  for (let i = 0; i < side * side; i++) {
    if (Number.isNaN(power[i])) continue;
    const [r, g, b] = Math.abs(rate[i]) >= 0.5 && power[i] > 0 ? FAST : shade(power[i]);
    image.data.set([r, g, b, 255], 4 * i);
  }
  brush.putImageData(image, 0, 0);
  pen.imageSmoothingEnabled = false;
  // dc is a bin: its middle, not its corner, is the middle of the sheet.
  const bin = size / side, middle = size / 2, dc = (Math.floor(side / 2) + 0.5) * bin;
  pen.drawImage(small, middle - dc, middle - dc, size, size);
  pen.strokeStyle = FAINT;
  for (const wavelength of chart.band) {
    pen.beginPath();
    pen.arc(middle, middle, size / wavelength, 0, 2 * Math.PI);
    pen.stroke();
  }
  const [vx, vy] = chart.velocity, speed = Math.hypot(vx, vy);
  if (speed > 1e-9) {
    const length = (0.12 + 0.3 * Math.min(speed / chart.band[1] / 0.5, 1)) * size;
    arrow(pen, middle, middle, length * vx / speed, length * vy / speed);
  }
}

function niceAbove(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1e-3)));
  return power * [1, 1.5, 2, 3, 5, 7.5, 10].find((step) => step * power >= value * 0.999);
}

// The tent: temporal frequency over spatial frequency, a surface seen from above at an angle.
function drawTent(canvas, chart, width, height, turn, tilt) {
  const pen = sheet(canvas, width, height), { side, power, rate } = chart;
  let most = 0;
  for (let i = 0; i < rate.length; i++) if (!Number.isNaN(power[i])) most = Math.max(most, Math.abs(rate[i]));
  const top = niceAbove(most), cos = Math.cos(turn), sin = Math.sin(turn);
  const scale = 0.86 * Math.min(width, 1.3 * height), lift = 0.36 * height * Math.cos(tilt) / top;
  const half = Math.floor(side / 2);
  const put = (fx, fy, w) => {
    const x = cos * fx - sin * fy, y = sin * fx + cos * fy;
    return [width / 2 + scale * x, 0.54 * height + scale * y * Math.sin(tilt) - lift * w, y];
  };
  const line = (points, color) => {
    pen.strokeStyle = color;
    pen.beginPath();
    points.forEach((p, i) => (i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
    pen.stroke();
  };
  const radius = 1 / Math.max(chart.band[0], 2);
  const ring = (w, color, from, to) => line(Array.from({ length: 49 }, (_, i) => {
    const angle = from + (to - from) * i / 48 - turn;
    return put(radius * Math.cos(angle), radius * Math.sin(angle), w);
  }), color);
  const fence = top >= 0.5 ? [-0.5, 0.5] : [];
  // Far halves first, near ones over the surface.
  for (const w of [0, ...fence]) ring(w, w ? "rgba(235, 110, 82, 0.6)" : FAINT, Math.PI, 2 * Math.PI);
  const quads = [];
  for (let row = 0; row + 1 < side; row++) for (let col = 0; col + 1 < side; col++) {
    const at = [row * side + col, row * side + col + 1, (row + 1) * side + col + 1, (row + 1) * side + col];
    if (at.some((i) => Number.isNaN(power[i]))) continue;
    const corners = at.map((i, n) => put((col + (n === 1 || n === 2) - half) / side, (row + (n > 1) - half) / side, rate[i]));
    const mean = at.reduce((sum, i) => sum + power[i], 0) / 4;
    const fast = at.some((i) => Math.abs(rate[i]) >= 0.5);
    quads.push({ corners, far: corners.reduce((sum, p) => sum + p[2], 0), color: fast ? FAST : shade(mean) });
  }
  quads.sort((a, b) => a.far - b.far);
  for (const { corners, color } of quads) {
    pen.fillStyle = `rgb(${color})`;
    pen.strokeStyle = `rgba(8, 14, 22, 0.55)`;
    pen.beginPath();
    corners.forEach((p, i) => (i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
    pen.closePath();
    pen.fill();
    pen.stroke();
  }
  for (const w of [0, ...fence]) ring(w, w ? "rgba(235, 110, 82, 0.6)" : FAINT, 0, Math.PI);
  const left = width / 2 - scale * radius - 6, base = 0.54 * height;
  line([[left, base + lift * top], [left, base - lift * top]], INK);
  pen.fillStyle = INK;
  for (const w of [top, -top]) line([[left - 3, base - lift * w], [left + 3, base - lift * w]], INK);
  pen.fillText(`± ${+top.toPrecision(2)} cycles/frame`, 8, 15);
}
