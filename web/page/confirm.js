// Commands that the server has taken and that no snapshot shows yet.
import { Unreachable } from "./api.js";

export class Unconfirmed {
  #waiting = new Set();

  /** Resolve once a snapshot shows a command; throw if it was refused, or not shown in time. */
  wait(number, patience) {
    return new Promise((resolve, reject) => {
      const end = (finish, value) => {
        clearTimeout(timer);
        this.#waiting.delete(one);
        finish(value);
      };
      const one = {
        number, done: () => end(resolve), refused: (reason) => end(reject, new Error(reason)),
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
      if (reasons.has(one.number)) one.refused(reasons.get(one.number));
      else if (commands >= one.number) one.done();
    }
  }

  /** The world of the commands is gone: its commands went with it. */
  drop() {
    for (const one of [...this.#waiting]) one.done();
  }
}
