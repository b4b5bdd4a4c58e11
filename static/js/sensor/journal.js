// The strides of this phone until the server has them: they survive a reload, a lock and minutes without a network.
//
// One record of the run (its name, its session, the last number given) and one for each stride, by number.

const NAME = "garry-sensor";

const done = (request) =>
  new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });

export class Journal {
  #database;

  static async open() {
    const request = indexedDB.open(NAME, 1);
    request.onupgradeneeded = () => {
      request.result.createObjectStore("strides", { keyPath: "number" });
      request.result.createObjectStore("run");
    };
    const journal = new Journal();
    journal.#database = await done(request);
    return journal;
  }

  #store(name, mode) {
    return this.#database.transaction(name, mode).objectStore(name);
  }

  async read() {
    const run = await done(this.#store("run").get("now"));
    return { run, strides: await done(this.#store("strides").getAll()) };
  }

  // Store the stride and the run that numbered it, both or neither.
  async add(run, stride) {
    const both = this.#database.transaction(["run", "strides"], "readwrite");
    both.objectStore("strides").put(stride);
    both.objectStore("run").put(run, "now");
    await new Promise((resolve, reject) => {
      both.oncomplete = resolve;
      both.onerror = () => reject(both.error);
    });
  }

  // Drop what the server has.
  async acknowledge(number) {
    await done(this.#store("strides", "readwrite").delete(IDBKeyRange.upperBound(number)));
  }

  async begin(run) {
    await done(this.#store("strides", "readwrite").clear());
    await done(this.#store("run", "readwrite").put(run, "now"));
  }
}
