// Runs before the modules, as a plain script, to say why they may not start.
"use strict";

function say(title, text) {
    document.getElementById("message").hidden = false;
    document.getElementById("message-title").textContent = title;
    document.getElementById("message-text").textContent = text;
}

// A script that cannot be fetched tells it to the window in the capture phase only.
function sayWhichIsMissing({ target }) {
    if (target instanceof HTMLScriptElement) say("A part of the page is missing", `Could not load ${target.src}.`);
}

if (location.protocol === "file:") {
    say("This page needs a file server", "A browser loads no modules from files. See page/README.md for the command.");
} else {
    addEventListener("error", sayWhichIsMissing, true);
}
