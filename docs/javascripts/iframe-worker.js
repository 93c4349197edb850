// Search in pages that are opened as files: browsers start no worker there, so that of the search
// runs in a hidden frame. Served over HTTP this does nothing.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      this.frame = document.createElement("iframe")
      this.frame.hidden = true
      document.body.append(this.frame)
      this.ready = new Promise((done) => this.frame.addEventListener("load", done))
      addEventListener("message", (event) => {
        if (event.source !== this.frame.contentWindow) return
        const message = new MessageEvent("message", { data: event.data })
        this.dispatchEvent(message)
        if (this.onmessage) this.onmessage(message)
      })
      const inside = this.frame.contentDocument
      inside.open()
      inside.write(
        "<script>postMessage = (data) => parent.postMessage(data, '*');" +
          "importScripts = async () => {}</script>" +
          `<script src="${url}"></script>`,
      )
      inside.close()
    }

    async postMessage(data) {
      await this.ready
      this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }))
    }

    terminate() {
      this.frame.remove()
    }
  }
}
