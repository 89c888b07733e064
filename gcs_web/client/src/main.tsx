/** Starts the page. */

import { render } from "preact";
import "uplot/dist/uPlot.min.css";
import { App } from "./app";
import { listen } from "./keys";
import { startLink } from "./link";
import { connect } from "./socket";
import "./style.css";
import "./controls.css";
import "./panels.css";
import "./inspector.css";
import "./jobs.css";
import "./map.css";
import "./learn.css";
import "./narrow.css";

const root = document.getElementById("app");
if (root !== null) render(<App />, root);
startLink();
listen();
connect();
