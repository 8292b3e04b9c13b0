//! The colours of lines, by their names.

use plotters::style::RGBColor;

/// An engine's own broad phase, pbig on the CPU, and pbig on a GPU, as in the viewer and on the page. They differ for the colour-blind, too.
const OWN: u32 = 0xd94724;
const PBIG: u32 = 0x0a8075;
const GPU: u32 = 0x6b42cc;

/// All other lines, in their order.
const OTHERS: [u32; crate::MAX_LINES] = [0x505050, 0xe69f00, 0x56b4e9, 0xcc79a7, 0x8c5614, 0x000000];

/// Returns a colour for each name. Lines of one family are shades of its colour.
pub(crate) fn colours<'a>(names: impl Iterator<Item = &'a str>) -> Vec<RGBColor> {
    let mut used = [0; 4];
    let colour = |name| {
        let family = family(name);
        let at = used[family];
        used[family] += 1;
        match [OWN, PBIG, GPU].get(family) {
            Some(&colour) => shade(rgb(colour), at),
            None => rgb(OTHERS[at % OTHERS.len()]),
        }
    };
    names.map(colour).collect()
}

/// Returns the number of a name's family: an engine's own broad phase, pbig, pbig on a GPU, others.
fn family(name: &str) -> usize {
    let is_pbig = name.split([' ', ',', '\'']).any(|word| word == "pbig");
    match name {
        _ if name.contains("stock") || name.contains("parry") => 0,
        _ if is_pbig && (name.contains("adapter") || name.contains("GPU")) => 2,
        _ if is_pbig => 1,
        _ => 3,
    }
}

/// Returns the colour itself, then a light one, then a dark one.
fn shade(RGBColor(r, g, b): RGBColor, at: usize) -> RGBColor {
    let mix = |part: u8| match at % 3 {
        0 => part,
        1 => part / 2 + 115,
        _ => part / 2,
    };
    RGBColor(mix(r), mix(g), mix(b))
}

fn rgb(hex: u32) -> RGBColor {
    let [_, r, g, b] = hex.to_be_bytes();
    RGBColor(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_family_has_its_colour_in_each_chart() {
        let names =
            ["parry 0.31", "pbig", "search from nothing", "pbig, one thread", "pbig, software adapter"];
        let [own, pbig, other, lone, gpu] = colours(names.into_iter())[..] else {
            panic!("a colour is missing")
        };
        assert_eq!([own, pbig, other, gpu], [OWN, PBIG, OTHERS[0], GPU].map(rgb));
        assert_eq!(lone, shade(rgb(PBIG), 1));
        assert_eq!(colours(["PBIG's grid, CPU", "column, stock"].into_iter()), [OTHERS[0], OWN].map(rgb));
        let scenes = colours(["a, pbig", "b, pbig", "c, pbig"].into_iter());
        assert!((1..3).all(|i| !scenes[..i].contains(&scenes[i])), "{scenes:?}");
    }

    #[test]
    fn viewer_and_page_have_the_same_colours() {
        let style = include_str!("../../../page/web/style.css");
        let graph = include_str!("../../../viewer/src/graph.rs");
        for (name, colour) in [("stock", OWN), ("pbig", PBIG), ("gpu", GPU)] {
            assert!(style.contains(&format!("--{name}: #{colour:06x};")), "style.css: {name}");
            assert!(graph.contains(&format!("0x{colour:06x}")), "graph.rs: {name}");
        }
    }
}
