// Requests to the server. Each has the token; long computations answer with a stream of reports.

/** Error that the server reports. */
export class ServerError extends Error {}

/** The server is not running, or it was started again with another token. */
export class ConnectionError extends Error {}

const parameters = () => new URLSearchParams(location.hash.slice(1));

/** Store the token of the address and remove it from the address. */
export function storeToken() {
  const fragment = parameters();
  const token = fragment.get("token");
  if (!token) return;
  localStorage.setItem("token", token);
  fragment.delete("token");
  history.replaceState(null, "", fragment.size ? `#${fragment}` : location.pathname);
}

/** Return the text of the case in the address. */
export function linkedCase() {
  return parameters().get("case");
}

/** Return the response; throw ServerError, ConnectionError or, if the request was cancelled, AbortError. */
export async function ask(path, options = {}) {
  // Another page in this browser may have stored the token of a new server.
  const headers = { "X-Thud-Token": localStorage.getItem("token") ?? "" };
  let response = null;
  try {
    response = await fetch(path, { ...options, headers });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new ConnectionError(`the server does not answer; start it again with: thud-driver explore --port ${location.port}`);
  }
  if (response.ok) return response;
  const message = await response.text();
  throw response.status === 403 ? new ConnectionError(message) : new ServerError(message);
}

/** Return the answer at the end of a stream of reports; `onProgress` gets the completed fraction. */
export async function follow(path, body, signal, onProgress) {
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
      const report = JSON.parse(line);
      if ("answer" in report) return report.answer;
      if ("error" in report) throw new ServerError(report.error);
      onProgress(report.done);
    }
    if (done) throw new ConnectionError(`the server has stopped; start it again with: thud-driver explore --port ${location.port}`);
  }
}
