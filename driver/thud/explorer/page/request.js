// Requests to the server: each carries the token, long answers are streams of reports.

/** What the server refuses; its message is a sentence. */
export class Refusal extends Error {}

/** The server is not there, or another one with another token is. */
export class Loss extends Error {}

const parameters = () => new URLSearchParams(location.hash.slice(1));

/** Keep the token of the address, and take it out of the address. */
export function takeToken() {
  const given = parameters();
  const found = given.get("token");
  if (!found) return;
  localStorage.setItem("token", found);
  given.delete("token");
  history.replaceState(null, "", given.size ? `#${given}` : location.pathname);
}

/** Return the text of the case that the address holds. */
export function linkedCase() {
  return parameters().get("case");
}

/** Return the answer to a request; raise Refusal, Loss or, where it was ended, AbortError. */
export async function ask(path, options = {}) {
  // Another page of this browser may have brought the token of a new server.
  const headers = { "X-Thud-Token": localStorage.getItem("token") ?? "" };
  let response = null;
  try {
    response = await fetch(path, { ...options, headers });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Loss(`the server does not answer; start it again with: thud-driver explore --port ${location.port}`);
  }
  if (response.ok) return response;
  const sentence = await response.text();
  throw response.status === 403 ? new Loss(sentence) : new Refusal(sentence);
}

/** Return the answer at the end of a stream of reports; `report` is told what part is done. */
export async function follow(path, body, signal, report) {
  const response = await ask(path, { method: "POST", body, signal });
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read().catch((error) => {
      if (error.name === "AbortError") throw error;
      return { done: true };
    });
    const lines = (rest + (value ?? "")).split("\n");
    rest = done ? "" : lines.pop();
    for (const line of lines.filter(Boolean)) {
      const found = JSON.parse(line);
      if ("answer" in found) return found.answer;
      if ("error" in found) throw new Refusal(found.error);
      report(found.done);
    }
    if (done) throw new Loss(`the server has stopped; start it again with: thud-driver explore --port ${location.port}`);
  }
}
