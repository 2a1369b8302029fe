// Numbers as people read them: units and factors come from Python with every quantity.

export function figure(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e5) return String(value).replace("-", "\u2212");
  if (size >= 1e5 || size < 1e-3) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    return `${mantissa.replace("-", "\u2212")}\u00d710${superscript(Number(power))}`;
  }
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(places, 6)).replace("-", "\u2212");
}

export function inUnit(value, quantity, digits = 3) {
  return value === null || value === undefined ? "–" : figure(value * quantity.factor, digits);
}

// Two numbers with one power of ten, and with as many digits as tell them apart.
export function span(low, high) {
  const size = Math.max(Math.abs(low), Math.abs(high));
  const digits = Math.abs(high - low) < 0.05 * size ? 4 : 2;
  if (size >= 1e-2 && size < 1e4) return `${figure(low, digits)} \u2026 ${figure(high, digits)}`;
  const power = Math.floor(Math.log10(size)), unit = 10 ** power;
  return `(${figure(low / unit, 2)} \u2026 ${figure(high / unit, 2)})\u00d710${superscript(power)}`;
}

export function superscript(power) {
  const digits = "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079";
  const text = String(Math.abs(power)).replace(/\d/g, (digit) => digits[digit]);
  return power < 0 ? `\u207b${text}` : text;
}

export function unitText(unit) {
  return unit.replace("um", "\u00b5m").replace("deg", "\u00b0").replace("^2", "\u00b2").replace("^3", "\u00b3");
}

export function length(metres) {
  if (metres === null || metres === undefined || !Number.isFinite(metres)) return "–";
  const size = Math.abs(metres);
  if (size < 1e-6) return `${figure(metres * 1e9)} nm`;
  if (size < 2e-4) return `${figure(metres * 1e6)} \u00b5m`;
  return `${figure(metres * 1e3)} mm`;
}

export function clock(seconds) {
  const sign = seconds < 0 ? "\u2212" : "";
  const whole = Math.abs(seconds);
  if (whole < 60) return `${sign}${whole.toFixed(2)} s`;
  return `${sign}${Math.floor(whole / 60)} min ${(whole % 60).toFixed(1).padStart(4, "0")} s`;
}

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "text") made.textContent = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

export function colourOf(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// A canvas as sharp as the screen; returns its size in CSS pixels.
export function fitted(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}
