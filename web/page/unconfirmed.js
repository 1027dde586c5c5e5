// Commands that the server has taken and that no snapshot shows yet.
import { Unreachable } from "./api.js";

/** The stream of snapshots was lost before one showed a command: its effect is unknown. */
export class Lost extends Error {}

export class Unconfirmed {
  #waiting = new Set();

  /** Resolve once a snapshot shows a command; throw if it was refused, lost or is late. */
  wait(number, patience) {
    return new Promise((resolve, reject) => {
      const end = (finish, value) => {
        clearTimeout(timer);
        this.#waiting.delete(one);
        finish(value);
      };
      const one = {
        number, done: () => end(resolve), failed: (error) => end(reject, error),
      };
      const late = `no snapshot has shown it within ${Math.round(patience / 1000)} s`;
      const timer = setTimeout(() => end(reject, new Unreachable(late)), patience);
      this.#waiting.add(one);
    });
  }

  /** Take in a snapshot of the world. */
  see({ commands, refused }) {
    const reasons = new Map(refused.map(({ number, reason }) => [number, reason]));
    for (const one of [...this.#waiting]) {
      if (reasons.has(one.number)) one.failed(new Error(reasons.get(one.number)));
      else if (commands >= one.number) one.done();
    }
  }

  /** The stream of snapshots is lost. */
  drop() {
    for (const one of [...this.#waiting]) one.failed(new Lost());
  }
}
