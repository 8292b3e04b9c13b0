// A rolling chart of one time: a line for each broad phase.

import uPlot from "uplot";
import { BROAD_PHASES } from "./settings.js";
import { onThemeChange, themeColour } from "./theme.js";

const HEIGHT = 110;
const FONT = "11px system-ui, sans-serif";

/** Creates a chart in an element. Its `setData` takes the columns of `Times`. */
export function createChart(element) {
    const chart = new uPlot(options(element.clientWidth), [[], ...BROAD_PHASES.map(() => [])], element);
    new ResizeObserver(() => chart.setSize({ width: element.clientWidth, height: HEIGHT })).observe(element);
    onThemeChange(() => chart.redraw());
    return chart;
}

function options(width) {
    return {
        width,
        height: HEIGHT,
        padding: [6, 14, 0, 0],
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false }, y: { range: (_, __, max) => [0, max > 0 ? max * 1.1 : 1] } },
        axes: [axis({ size: 22 }), axis({ size: 40, splits: fewSplits })],
        series: [{}, ...BROAD_PHASES.map((name) => line(`--${name}`))],
    };
}

function axis(rest) {
    const faint = { stroke: () => themeColour("--line"), width: 1 };
    return { stroke: () => themeColour("--soft"), font: FONT, grid: faint, ticks: { show: false }, ...rest };
}

function line(colour) {
    return { stroke: () => themeColour(colour), width: 1.5, points: { show: false } };
}

function fewSplits(_, __, min, max) {
    return [min, max / 2.2, max / 1.1].map((ms) => Number(ms.toPrecision(2)));
}
