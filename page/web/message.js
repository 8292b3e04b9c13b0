// The one place of the page where it says what it waits for, lacks, or failed in.

const element = (id) => document.getElementById(id);

/** Shows a message over the stage. */
export function showMessage(title, text = "") {
    element("message").hidden = false;
    element("message-title").textContent = title;
    element("message-text").textContent = text;
}

/** Hides the message. */
export function hideMessage() {
    element("message").hidden = true;
}
