// Requests to the server. Each has the token.
import { storeText, stored } from "thud/storage.js";

/** Error that the server reports; `field` is the field it is about, or null. */
export class ServerError extends Error {
  constructor({ error, field }) {
    super(error);
    this.field = field ?? null;
  }
}

/** The server is not running, or it was started again with another token. */
export class ConnectionError extends Error {}

const MISSING_TOKEN = "Open the full address shown in the terminal: it holds the token";
const restart = () => `start it again with: thud-driver explore --port ${location.port}`;

/** Return the parameters of the address; the token moves to the storage of the browser. */
export function takeFragment() {
  const parameters = new URLSearchParams(location.hash.slice(1));
  const token = parameters.get("token");
  if (token) {
    storeText("token", token);
    parameters.delete("token");
    setFragment(String(parameters));
  }
  return parameters;
}

/** Set the parameters of the address. */
export function setFragment(text) {
  history.replaceState(null, "", text ? `#${text}` : location.pathname);
}

/** Parameters with which the page was opened. */
export const fragment = takeFragment();

/** Return the response; throw ServerError, ConnectionError or, if cancelled, AbortError. */
export async function ask(path, options = {}) {
  // Another page in this browser may have stored the token of a new server.
  const token = stored("token");
  if (!token) throw new ConnectionError(MISSING_TOKEN);
  let response = null;
  try {
    response = await fetch(path, { ...options, headers: { "X-Thud-Token": token } });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new ConnectionError(`The server does not answer; ${restart()}`);
  }
  if (response.ok) return response;
  const report = await response.json().catch(() => ({ error: response.statusText }));
  throw response.status === 403 ? new ConnectionError(report.error) : new ServerError(report);
}

/** Return the answer of a task of the server. */
export async function follow(path, body, signal = null) {
  const response = await ask(path, { method: "POST", body, signal });
  const report = await response.json().catch((error) => {
    if (error.name === "AbortError") throw error;
    throw new ConnectionError(`The server has stopped; ${restart()}`);
  });
  if ("error" in report) throw new ServerError(report);
  return report.answer;
}

/** What the server says of itself, requested before the rest of the page has arrived. */
export const firstAbout = ask("about").then((response) => response.json());
firstAbout.catch(() => {});
