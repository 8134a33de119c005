/**
 * The bus on which the modules meet. `fire` tells, `invoke` asks; both are typed by a map, so a misspelled name does not
 * compile. A question has exactly one answerer.
 */
export class Events<Notices extends object, Questions extends object = Record<never, never>> {
  private readonly listeners_ = new Map<keyof Notices, Set<(value: never) => void>>();
  private readonly answerers_ = new Map<keyof Questions, unknown>();

  /** Calls `listener` at each notice; returns the function that ends it. */
  on<Name extends keyof Notices>(name: Name, listener: (value: Notices[Name]) => void): () => void {
    let set = this.listeners_.get(name);
    if (!set) {
      set = new Set();
      this.listeners_.set(name, set);
    }
    set.add(listener as (value: never) => void);
    return () => {
      set.delete(listener as (value: never) => void);
    };
  }

  /** Tells every listener, also where one throws: its error is reported after the others were told. */
  fire<Name extends keyof Notices>(name: Name, value: Notices[Name]): void {
    const errors: unknown[] = [];
    for (const listener of [...(this.listeners_.get(name) ?? [])]) {
      try {
        (listener as (value: Notices[Name]) => void)(value);
      } catch (error) {
        errors.push(error);
      }
    }
    if (errors.length > 0) throw errors[0];
  }

  /** Makes `answer` the one answerer of a question; throws where there is one already. */
  function<Name extends keyof Questions>(name: Name, answer: Questions[Name]): () => void {
    if (this.answerers_.has(name)) throw new Error(`question "${String(name)}" is answered already`);
    this.answerers_.set(name, answer);
    return () => {
      this.answerers_.delete(name);
    };
  }

  /** Asks; throws where nobody answers. */
  invoke<Name extends keyof Questions>(
    name: Name,
    ...args: Questions[Name] extends (...args: infer Args) => unknown ? Args : never
  ): Questions[Name] extends (...args: never[]) => infer Result ? Result : never {
    const answer = this.answerers_.get(name);
    if (typeof answer !== "function") throw new Error(`nobody answers "${String(name)}"`);
    return answer(...args);
  }
}
