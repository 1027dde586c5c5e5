// What a browser keeps for this page: in `localStorage` for all its windows, in `sessionStorage` for one.

/** The value that is kept under a key; null where there is none. */
export function kept(storage, key) {
  try {
    return JSON.parse(window[storage].getItem(key));
  } catch {
    return null;
  }
}

export function keep(storage, key, value) {
  try {
    window[storage].setItem(key, JSON.stringify(value));
  } catch {
    // A browser that keeps nothing: the value holds until the page is loaded again.
  }
}
