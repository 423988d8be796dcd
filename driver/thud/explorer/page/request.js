// Requests to the server: each carries the token, long answers are streams of reports.

/** An error that the server reports. */
export class Refusal extends Error {}

/** The server is not running, or is another one with another token. */
export class Loss extends Error {}

const parameters = () => new URLSearchParams(location.hash.slice(1));

/** Store the token of the address and remove it from there. */
export function takeToken() {
  const fragment = parameters();
  const token = fragment.get("token");
  if (!token) return;
  localStorage.setItem("token", token);
  fragment.delete("token");
  history.replaceState(null, "", fragment.size ? `#${fragment}` : location.pathname);
}

/** Return the text of the case that the address holds. */
export function linkedCase() {
  return parameters().get("case");
}

/** Return the answer to a request; raise Refusal, Loss or, if it was cancelled, AbortError. */
export async function ask(path, options = {}) {
  // Another page of this browser may have stored the token of a new server.
  const headers = { "X-Thud-Token": localStorage.getItem("token") ?? "" };
  let response = null;
  try {
    response = await fetch(path, { ...options, headers });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Loss(`the server does not answer; start it again with: thud-driver explore --port ${location.port}`);
  }
  if (response.ok) return response;
  const message = await response.text();
  throw response.status === 403 ? new Loss(message) : new Refusal(message);
}

/** Return the answer at the end of a stream of reports; `report` gets the fraction that is done. */
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
      const message = JSON.parse(line);
      if ("answer" in message) return message.answer;
      if ("error" in message) throw new Refusal(message.error);
      report(message.done);
    }
    if (done) throw new Loss(`the server has stopped; start it again with: thud-driver explore --port ${location.port}`);
  }
}
