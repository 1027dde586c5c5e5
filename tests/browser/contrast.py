"""How well text stands out on a page: WCAG 2.2 contrast ratios as the browser draws it."""

from playwright.sync_api import Page

AA_SMALL, AA_LARGE = 4.5, 3.0
"""Least ratios of WCAG 2.2, success criterion 1.4.3."""

FAINT_TEXT = """([small, large]) => {
  const LEFT_OUT = ":disabled, [aria-hidden=true], option, script, noscript, .sr";
  const paint = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const read = (colour) => {
    paint.clearRect(0, 0, 1, 1);
    paint.fillStyle = colour;
    paint.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = paint.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = (top, below) => [0, 1, 2].map((k) => top[k] * top[3] + below[k] * (1 - top[3]));
  const light = (rgb) => {
    const [r, g, b] = rgb.map((c) => c / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ratio = (a, b) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  const behind = (element) => {
    const layers = [];
    for (let one = element; one; one = one.parentElement) {
      const style = getComputedStyle(one);
      if (style.backgroundImage !== "none") return null;
      layers.push(read(style.backgroundColor));
      if (layers.at(-1)[3] === 1) break;
    }
    return layers.reverse().reduce((below, layer) => over(layer, below), [255, 255, 255]);
  };
  const faint = [];
  const words = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (words.nextNode()) {
    const element = words.currentNode.parentElement;
    const text = words.currentNode.textContent.trim();
    if (!text || element.closest(LEFT_OUT)) continue;
    if (!element.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
    const style = getComputedStyle(element);
    const back = behind(element);
    if (!back) continue;
    let clear = 1;
    for (let one = element; one; one = one.parentElement) {
      clear *= getComputedStyle(one).opacity;
    }
    const [r, g, b, a] = read(style.color);
    const found = ratio(light(over([r, g, b, a * clear], back)), light(back));
    const size = parseFloat(style.fontSize);
    const big = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    if (found < (big ? large : small)) {
      const name = element.className || element.tagName;
      faint.push(`${found.toFixed(2)} ${name}: ${text.slice(0, 40)}`);
    }
  }
  return faint;
}"""


def faint_text(page: Page) -> list[str]:
    """Return text that is seen now and stands out less than AA asks for, with its ratio.

    Text on a background image is left out, and so is what is disabled, as the criterion says.
    """
    found: list[str] = page.evaluate(FAINT_TEXT, [AA_SMALL, AA_LARGE])
    return found
