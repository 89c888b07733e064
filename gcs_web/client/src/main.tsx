/** Starts the page. */

import { render } from "preact";
import "uplot/dist/uPlot.min.css";
import "./styles/style.css";
import "./styles/controls.css";
import "./styles/panels.css";
import "./styles/inspector.css";
import "./panels/view/view.css";
import { App } from "./app";
import { listen } from "./panels/frame/keys";
import { startWhereItLacks } from "./panels/start/fill";
import { startLink } from "./panels/compare/link";
import { connect } from "./core/socket";
import "./styles/narrow.css";

const root = document.getElementById("app");
if (root !== null) render(<App />, root);
startWhereItLacks();
startLink();
listen();
connect();
// Not where a certificate was only waved through, nor in a window that keeps nothing: the page needs none.
navigator.serviceWorker?.register("/static/worker.js", { scope: "/" }).catch(() => {});
