// Search in pages opened from disk, where browsers start no workers: what the worker runs goes into a hidden frame instead.
(() => {
  class FrameWorker extends EventTarget {
    constructor(url) {
      super();
      const frame = Object.assign(document.createElement("iframe"), { hidden: true });
      document.body.append(frame);
      const inside = (this.inside = frame.contentWindow);
      this.loaded = new Promise((resolve) => (inside.loaded = resolve));
      inside.answer = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      inside.document.write(
        `<script>postMessage = answer</script><script src="${url}"></script><script>loaded()</script>`,
      );
      inside.document.close();
    }
    async postMessage(data) {
      await this.loaded;
      this.inside.dispatchEvent(new this.inside.MessageEvent("message", { data: structuredClone(data) }));
    }
  }
  if (location.protocol === "file:") window.Worker = FrameWorker;
})();
