// The page of `flurries view`: questions go to the server that sent it.
import { mount } from "./viewer.js";

async function ask(question) {
  const reply = await fetch("ask", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(question) });
  // A question that is refused has an answer too, which says why.
  const answered = reply.headers.get("Content-Type") === "application/octet-stream";
  if (!answered) throw new Error(`the server said ${reply.status}`);
  const bytes = await reply.arrayBuffer(), length = new DataView(bytes).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  const buffers = [];
  let start = 4 + length;
  for (const size of head.buffers) {
    buffers.push(bytes.slice(start, start + size));
    start += size;
  }
  return { head, buffers };
}

const { head } = await ask({ kind: "describe" });
mount(document.querySelector("main"), head, ask);
