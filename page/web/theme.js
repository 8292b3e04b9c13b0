// Colours, which the style sheet keeps for light and dark schemes.

/** Returns the value of a custom property of the style sheet, such as `--stock`. */
export function themeColour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Calls a function whenever the user's scheme changes. */
export function onThemeChange(call) {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", call);
}
